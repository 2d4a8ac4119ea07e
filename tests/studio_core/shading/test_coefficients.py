"""Which materials need a map of their own, and what a change of one makes anew."""

from __future__ import annotations

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from studio_core.kernels.compose import AFFINE, CONSTANT, GENERAL
from studio_core.scene.geometry import Image, Texture
from studio_core.scene.nodes import Material, Scene
from studio_core.shading.coefficients import CoefficientTable
from studio_core.shading.materials import coefficients, resolve

RNG = np.random.default_rng(1)
PICTURE = Image(RNG.random((6, 10, 3)).astype(np.float32))
OTHER = Image(RNG.random((5, 4, 3)).astype(np.float32))
GREY = Image(RNG.random((4, 4, 1)).astype(np.float32))


def table_of(host, *materials, keeper=None):
    scene = Scene().with_materials(*materials)
    unpainted = SimpleNamespace(objects=())
    surfaces = SimpleNamespace(materials=tuple(m.id for m in materials), mesh=unpainted)
    return (keeper or CoefficientTable(host))(scene, surfaces)


def material(model, textures, values=None, name="m"):
    maps = {key: Texture(image) for key, image in textures.items()}
    return Material(id=name, name=name, model=model, values=values or {}, textures=maps)


@pytest.mark.parametrize(
    ("look", "kind"),
    [
        (material("lambert", {}), CONSTANT),
        (material("lambert", {"base_color": PICTURE}), AFFINE),
        (material("ggx", {"base_color": PICTURE}), AFFINE),
        (material("ggx", {"specular": GREY}), AFFINE),
        (material("ggx", {"metallic": PICTURE}), AFFINE),
        (material("phong", {"diffuse": PICTURE}, {"specular": (0.0,) * 3}), AFFINE),
        (material("phong", {"diffuse": PICTURE}, {"diffuse": (1.0,) * 3, "specular": (0.5,) * 3}), GENERAL),
        (material("lambert", {"base_color": Image(PICTURE.pixels * 3)}), GENERAL),  # colours stop at 1
        (material("ggx", {"base_color": PICTURE, "metallic": GREY}), GENERAL),
    ],
)
def test_texels_give_the_coefficients_of_the_model(host, look, kind):
    table = table_of(host, look)
    maps = table.maps
    assert maps.kind[0] == kind
    resolved = resolve(look, host)
    expected = coefficients(resolved).reshape(-1, resolved.brdf.terms * 3)
    made = table.plain[0][None]
    start, count = maps.first[0, 0], int(np.prod(maps.size[0, 0]))
    if kind == AFFINE:
        texels = np.tile(maps.texels[start : start + count], resolved.brdf.terms)
        made = table.plain[0] + table.slope[0] * texels
    elif kind == GENERAL:
        made = maps.tables[start : start + count]
    np.testing.assert_allclose(made, expected, atol=2e-6)
    np.testing.assert_allclose(table.typical[0], expected.mean(axis=0), rtol=0.05, atol=1e-6)


@given(st.integers(1, 9), st.integers(1, 9))
@settings(max_examples=20)
def test_levels_halve_down_to_one_texel_and_lie_one_after_another(host, height, width):
    picture = Image(np.random.default_rng(height).random((height, width, 3)).astype(np.float32))
    maps = table_of(host, material("lambert", {"base_color": picture})).maps
    level = picture.pixels[::-1]
    for at in range(maps.levels[0]):
        assert tuple(maps.size[0, at]) == level.shape[:2]
        start = maps.first[0, at]
        stored = maps.texels[start : start + level.shape[0] * level.shape[1]].reshape(level.shape)
        np.testing.assert_allclose(stored, level, atol=1e-6)
        h, w = max(level.shape[0] // 2, 1), max(level.shape[1] // 2, 1)
        y, x = level.shape[0] // h, level.shape[1] // w
        level = level[: h * y, : w * x].reshape(h, y, w, x, 3).mean(axis=(1, 3))
    assert tuple(maps.size[0, maps.levels[0] - 1]) == (1, 1)


def test_a_colour_keeps_the_maps_and_another_picture_does_not(host):
    keeper = CoefficientTable(host)
    look = material("ggx", {"base_color": PICTURE})
    plain = material("lambert", {}, name="plain")
    first = table_of(host, look, plain, keeper=keeper)
    assert table_of(host, look, plain, keeper=keeper) is first
    tinted = dataclasses.replace(look, values={"base_color": (0.2, 0.5, 0.9), "roughness": 0.1})
    second = table_of(host, tinted, plain, keeper=keeper)
    assert second.maps is first.maps
    assert not np.array_equal(second.slope, first.slope)
    np.testing.assert_array_equal(second.slope, table_of(host, tinted, plain).slope)
    other = material("ggx", {"base_color": OTHER})
    third = table_of(host, other, plain, keeper=keeper)
    fresh = table_of(host, other, plain)
    assert third.maps is not first.maps
    np.testing.assert_array_equal(third.maps.texels, fresh.maps.texels)
    shifted = dataclasses.replace(other, textures={"base_color": Texture(OTHER, (2.0, 2.0))})
    fourth = table_of(host, shifted, plain, keeper=keeper)
    assert fourth.maps.texels is third.maps.texels
    assert not np.array_equal(fourth.maps.uv_map, third.maps.uv_map)


def test_one_picture_on_two_materials_is_stored_once(host):
    one, two = (material("ggx", {"base_color": PICTURE}, name=name) for name in "ab")
    alone, both = table_of(host, one), table_of(host, one, two)
    assert len(both.maps.texels) == len(alone.maps.texels)
    assert (both.maps.first[0] == both.maps.first[1]).all()


def test_pictures_that_are_no_longer_used_are_dropped_and_come_back_right(host):
    keeper = CoefficientTable(host)
    one, two = (material("ggx", {"base_color": p}, name=n) for p, n in ((PICTURE, "a"), (OTHER, "b")))
    both = table_of(host, one, two, keeper=keeper)
    alone = table_of(host, two, keeper=keeper)
    assert len(alone.maps.texels) < len(both.maps.texels)
    np.testing.assert_array_equal(table_of(host, one, two, keeper=keeper).maps.texels, both.maps.texels)


def test_tables_are_as_wide_as_the_material_with_most_terms(host):
    keeper = CoefficientTable(host)
    own = material("phong", {"diffuse": PICTURE}, {"diffuse": (1.0,) * 3, "specular": (0.5,) * 3}, name="a")
    four = material("ggx", {}, {"metallic": 0.3}, name="b")
    two = coefficients(resolve(own, host)).reshape(-1, 6)
    for looks, width in (((own,), 2), ((own, four), 4), ((own,), 2)):
        table = table_of(host, *looks, keeper=keeper)
        assert table.width == width
        assert table.maps.tables.shape[1] == table.plain.shape[1] == 3 * width
        start, count = table.maps.first[0, 0], int(np.prod(table.maps.size[0, 0]))
        rows = table.maps.tables[start : start + count]
        np.testing.assert_allclose(rows[:, :6], two, atol=2e-6)
        assert not rows[:, 6:].any()
        assert not table.typical[0, 6:].any()


def test_no_material_at_all(host):
    table = table_of(host)
    assert table.plain.shape == (1, 3)
    assert table.maps.kind.tolist() == [CONSTANT]


@pytest.mark.parametrize("texture", ["base_color", "metallic"])
def test_a_term_that_may_be_straightened_is_the_nearest_line(host, texture):
    """Metal: three terms are lines in the texel, and what bounces is the best line that is not below 0."""
    look = material("ggx", {texture: PICTURE}, {"metallic": 0.9, "base_color": (0.9, 0.6, 0.3)})
    table = table_of(host, look)
    assert table.maps.kind[0] == AFFINE
    resolved = resolve(look, host)
    expected = coefficients(resolved).reshape(-1, 4, 3)
    start, count = table.maps.first[0, 0], int(np.prod(table.maps.size[0, 0]))
    texels = table.maps.texels[start : start + count]
    made = (table.plain[0] + table.slope[0] * np.tile(texels, 4)).reshape(-1, 4, 3)
    np.testing.assert_allclose(made[:, :3], expected[:, :3], atol=2e-6)
    assert made[:, 3].min() >= -1e-6
    off = ((made[:, 3] - expected[:, 3]) ** 2).sum(axis=0)
    for channel in range(3):
        x, y = texels[:, channel], expected[:, 3, channel]
        free = ((np.polyval(np.polyfit(x, y, 1), x) - y) ** 2).sum()
        assert free * (1 - 1e-6) <= off[channel] <= 3 * free + 1e-9
        for bent in (0.98, 1.02):  # no line near it that stays above 0 comes closer
            low = x.min()
            line = table.plain[0, 9 + channel] + table.slope[0, 9 + channel] * (low + bent * (x - low))
            assert ((line - y) ** 2).sum() >= off[channel] * (1 - 1e-3)


def test_a_picture_of_one_colour_is_not_straightened_away(host):
    flat = Image(np.full((4, 4, 3), 0.7, np.float32))
    look = material("ggx", {"base_color": flat}, {"metallic": 1.0, "base_color": (1.0, 1.0, 1.0)})
    table, exact = table_of(host, look), coefficients(resolve(look, host)).reshape(-1, 12)[0]
    np.testing.assert_allclose(table.plain[0] + table.slope[0] * 0.7, exact, atol=1e-5)
