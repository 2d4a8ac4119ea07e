"""The toolkit-free core: document, scene, project file, light, shading. Also the scripting API."""

__version__ = "0.1.0"
