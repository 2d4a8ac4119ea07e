"""MaterialX: materials of other programs as `.mtlx` files. Needs the extra `materialx`."""

from studio_core.contract import API, Plugin

_HERE = "studio_plugins.materialx"
plugin = Plugin(
    id="materialx",
    label="MaterialX",
    api=API,
    provides={
        "importer": {"materialx": f"{_HERE}.importer:IMPORTER"},
        "exporter": {"materialx": f"{_HERE}.exporter:EXPORTER"},
    },
)
