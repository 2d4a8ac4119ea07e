"""Exporters: glTF and Mitsuba 3."""

from studio_core.contract import API, Plugin

_HERE = "studio_plugins.export"
plugin = Plugin(
    id="export",
    label="Exporters",
    api=API,
    provides={"exporter": {"glb": f"{_HERE}.glb:EXPORTER", "mitsuba": f"{_HERE}.mitsuba:EXPORTER"}},
)
