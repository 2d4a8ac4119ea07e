"""The brute-force backend that every other one is compared with."""

from studio_core.contract import API, Plugin

plugin = Plugin(
    id="reference",
    label="Reference",
    api=API,
    provides={"backend": {"reference": "studio_plugins.reference.backend:BACKEND"}},
)
