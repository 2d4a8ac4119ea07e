"""Says what this plugin has, without importing any of it."""

from studio_core.contract import API, Plugin

plugin = Plugin(
    id="example",
    label="Example plugin",
    api=API,
    provides={
        "brdf": {
            "minnaert": "lucarne_example.minnaert:MODEL",
            "unfinished": "lucarne_example.unfinished:MODEL",
        },
        "panel": {"census": "lucarne_example.census:MAKER"},
    },
)
