"""The brute-force backend and the path tracing that every other method is compared with."""

from studio_core.contract import API, Plugin

plugin = Plugin(
    id="reference",
    label="Reference",
    api=API,
    provides={
        "backend": {"reference": "studio_plugins.reference.backend:BACKEND"},
        "indirect": {"paths": "studio_plugins.reference.paths:METHOD"},
    },
)
