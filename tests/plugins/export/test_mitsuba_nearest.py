"""What Mitsuba has no model for goes out as the nearest that it can have."""

from __future__ import annotations

from typing import Any

import pytest

from studio_core.exchange.measuring import between
from studio_core.library.presets import PRESETS
from studio_core.registry import PluginHost
from studio_core.scene.nodes import Material
from studio_core.shading.materials import resolve
from studio_plugins.export.mitsuba_materials import nearest


@pytest.mark.parametrize(
    ("name", "model", "most"),
    [
        ("Plaster", "lambert", 0.05),
        ("Velvet, bottle green", "lambert", 0.05),
        ("Brass, satin", "ggx", 0.02),
        ("Lacquer, red", "ggx", 0.06),
        ("Glass, clear", "ggx", 0.05),
        ("Stainless steel, brushed", "ggx", 0.35),
    ],
)
def test_presets(host: PluginHost, name: str, model: str, most: float) -> None:
    (material,) = (kept.material for kept in PRESETS if kept.name == name)
    meant = resolve(material, host)
    made = nearest(material, meant, host)
    assert (made.model, made.id) == (model, material.id)
    matte: Any = Material(id="x", model="lambert", values={"base_color": (0.2, 0.2, 0.2)})
    off = between(resolve(made, host), meant)
    assert off < most
    assert off < between(resolve(matte, host), meant)
