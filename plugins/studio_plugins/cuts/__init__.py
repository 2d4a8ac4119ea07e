"""Visibility cuts: every vertex' visibility kept as intervals, its light as the nodes of a tree."""

from studio_core.contract import API, Plugin

plugin = Plugin(
    id="cuts",
    label="Cuts: interactive light",
    api=API,
    provides={"backend": {"cuts": "studio_plugins.cuts.backend:BACKEND"}},
)
