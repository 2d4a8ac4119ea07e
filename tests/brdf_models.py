"""Every registered reflectance model: bundled ones, and those of installed plugins."""

from __future__ import annotations

import importlib
from collections.abc import Iterator
from importlib.metadata import entry_points
from typing import Any

from studio_plugins.brdfs import plugin as bundled


def _models() -> Iterator[Any]:
    found = [bundled, *(point.load() for point in entry_points(group="studio.plugins"))]
    for name in {name: None for plugin in found for name in plugin.provides.get("brdf", {}).values()}:
        module, _, attribute = name.partition(":")
        yield getattr(importlib.import_module(module), attribute)


MODELS = {model.id: model for model in _models()}
BUNDLED = tuple(bundled.provides["brdf"])
