"""Importers of mesh files."""

from studio_core.contract import API, Plugin

_HERE = "studio_plugins.meshes"
plugin = Plugin(
    id="meshes",
    label="Mesh files",
    api=API,
    provides={
        "importer": {
            "gltf": f"{_HERE}.gltf:IMPORTER",
            "obj": f"{_HERE}.obj:IMPORTER",
            "ply": f"{_HERE}.plain:PLY",
            "stl": f"{_HERE}.plain:STL",
        }
    },
)
