"""Which of our models a surface of another program becomes, and that nothing is lost without a word."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from studio_core.exchange.incoming import MOST_TEXELS, material_of
from studio_core.exchange.surface import Surface, ior_of, stretched
from studio_core.params import check, param_infos
from studio_core.registry import PluginHost
from studio_core.scene.geometry import Image, Texture
from studio_core.scene.nodes import Material
from studio_plugins.brdfs import plugin as brdfs


def taken(surface: Surface) -> tuple[Material, list[str]]:
    notes: list[str] = []
    return material_of(surface, notes.append), notes


def picture(value: float = 0.5, size: int = 2) -> Texture:
    pixels = np.full((size, size, 1), value, np.float32)
    pixels[0] *= 0.5
    return Texture(Image(pixels, "data"))


def test_metallic_roughness_is_ggx_without_a_word() -> None:
    made, notes = taken(
        Surface(name="oak", base_color=(0.5, 0.3, 0.2), roughness=0.4, metallic=0.25, ior=1.6)
    )
    assert made.model == "ggx"
    assert made.values["specular"] == pytest.approx((0.6 / 2.6) ** 2 / 0.08)
    assert made.values["roughness"] == 0.4
    assert notes == []


@pytest.mark.parametrize(
    ("changes", "model", "word"),
    [
        ({"specular": 0.0}, "lambert", ""),
        ({"specular": 0.0, "diffuse_roughness": 0.7}, "oren-nayar", ""),
        ({"clearcoat": 1.0, "clearcoat_roughness": 0.1}, "plastic", "below its clear coat"),
        ({"clearcoat": 1.0, "specular": 0.0}, "plastic", ""),
        ({"clearcoat": 0.2}, "ggx", "clear coat is left out"),
        ({"clearcoat": 1.0, "metallic": 1.0}, "ggx", "clear coat is left out"),
        ({"specular": 0.6}, "plastic", ""),
        ({"sheen_color": (0.3, 0.2, 0.1), "specular": 0.0}, "cloth", ""),
        ({"sheen_color": (0.3, 0.2, 0.1), "roughness": 0.8}, "cloth", "matte"),
        ({"sheen_color": (0.3, 0.2, 0.1), "roughness": 0.2}, "ggx", "sheen is left out"),
        ({"specular": 0.6, "metallic": 0.6}, "ggx", "weakened"),
        ({"ior": 2.4}, "plastic", ""),
        ({"ior": 2.4, "metallic": 0.7}, "ggx", "instead of 17%"),
        ({"specular_color": (1.0, 0.5, 0.2)}, "specgloss", ""),
        ({"specular_color": (0.3, 0.1, 0.1)}, "ggx", "became grey"),
        ({"specular_color": (1.0, 0.5, 0.2), "metallic": 0.6}, "ggx", "became grey"),
        ({"base_color": (0.0, 0.0, 0.0), "specular_color": (1.0, 0.5, 0.2)}, "ggx-dielectric", ""),
        ({"metallic": 1.0, "edge_tint": (0.5, 0.6, 0.7)}, "ggx-conductor", ""),
        ({"metallic": 0.6, "edge_tint": (0.5, 0.6, 0.7)}, "ggx", "rim's tint is left out"),
        ({"metallic": 1.0, "anisotropy": 0.6}, "ward", "no brighter rim"),
        ({"anisotropy": 0.3}, "ggx", "grain is left out"),
        ({"anisotropy": 0.6, "roughness": 0.3}, "ashikhmin-shirley", ""),
    ],
)
def test_the_nearest_model(changes: dict[str, Any], model: str, word: str) -> None:
    made, notes = taken(Surface(name="thing", **changes))
    assert made.model == model
    assert (word in " ".join(notes)) if word else notes == []


def test_a_grain_keeps_its_two_widths_and_its_direction() -> None:
    surface = Surface(metallic=1.0, roughness=0.3, anisotropy=0.4, anisotropy_rotation=30.0)
    made, _ = taken(surface)
    alpha, lean = float(made.values["roughness"]) ** 2, 1 - 0.9 * float(made.values["anisotropy"])  # type: ignore[arg-type]
    wide, narrow = surface.alphas
    np.testing.assert_allclose([alpha / lean**0.5, alpha * lean**0.5], [wide, narrow], rtol=1e-9)
    assert made.values["direction"] == pytest.approx(-60.0)


def test_pictures_of_what_is_one_number_become_their_mean() -> None:
    surface = Surface(
        name="sofa",
        clearcoat=1.0,
        specular=0.0,
        textures={"base_color": picture(), "clearcoat_roughness": picture()},
    )
    made, notes = taken(replace(surface, clearcoat_roughness=0.4))
    assert set(made.textures) == {"base_color"}
    surface = Surface(name="tap", metallic=1.0, edge_tint=(0.5,) * 3, textures={"roughness": picture(0.8)})
    made, notes = taken(surface)
    assert made.values["roughness"] == pytest.approx(0.5 * 0.6)
    assert any("roughness" in note for note in notes)


def test_pictures_that_lie_otherwise_or_are_too_large_become_their_mean() -> None:
    moved = replace(picture(1.0), scale=(2.0, 2.0))
    made, notes = taken(Surface(metallic=1.0, textures={"base_color": picture(), "metallic": moved}))
    assert set(made.textures) == {"base_color"}
    assert made.values["metallic"] == pytest.approx(0.75)
    assert any("lies otherwise" in note for note in notes)
    large = picture(1.0, 2 + int(MOST_TEXELS**0.5))
    made, notes = taken(Surface(metallic=1.0, textures={"base_color": picture(), "metallic": large}))
    assert any("too large" in note for note in notes)


@given(st.floats(0.0, 0.6), st.floats(0, 1), st.floats(0, 1))
def test_index_and_widths_come_back(f0: float, wide: float, narrow: float) -> None:
    assert Surface(ior=ior_of(f0)).f0 == pytest.approx(f0, abs=1e-9)
    roughness, strength = stretched(max(wide, narrow), min(wide, narrow))
    found = Surface(roughness=roughness, anisotropy=strength).alphas
    np.testing.assert_allclose(found, (max(wide, narrow), min(wide, narrow)), atol=1e-9)


UNIT = st.sampled_from([0.0, 0.3, 1.0]) | st.floats(0, 1)
COLOUR = st.tuples(UNIT, UNIT, UNIT)
SURFACES = st.builds(
    Surface,
    base_color=COLOUR,
    metallic=UNIT,
    roughness=UNIT,
    diffuse_roughness=UNIT,
    ior=st.floats(1, 1000),
    specular=UNIT,
    specular_color=COLOUR,
    edge_tint=COLOUR,
    anisotropy=UNIT,
    anisotropy_rotation=st.floats(-1e6, 1e6),
    sheen_color=COLOUR,
    sheen_roughness=UNIT,
    clearcoat=UNIT,
    clearcoat_roughness=UNIT,
    opacity=UNIT,
)


@settings(max_examples=200)
@given(SURFACES)
def test_whatever_comes_is_within_the_ranges_of_its_model(surface: Surface) -> None:
    made, _ = taken(surface)
    brdf = PluginHost([brdfs]).brdf(made.model)
    infos = param_infos(brdf.Params)
    assert set(made.values) <= set(infos)
    for name, value in made.values.items():
        check(name, infos[name], value)
