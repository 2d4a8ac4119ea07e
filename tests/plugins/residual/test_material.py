"""A fit and the material made of it say the same, and its maps lie on a flat surface as on the ball."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, cast

import numpy as np
import pytest
from captured_fits import made_up

from studio_core.brdfs.albedo import albedo_table
from studio_core.brdfs.bound import bound
from studio_core.errors import InputError
from studio_core.params import defaults
from studio_core.shading.materials import resolve
from studio_plugins.residual.bases import BASES
from studio_plugins.residual.frames import tangent_frames
from studio_plugins.residual.material import SHOWN, scene_material
from studio_plugins.residual.model import MODEL, RESIDUAL
from studio_plugins.residual.reflectance_map import slopes

MODELS = ("lambert", "rough-lambert", "phong", "blinn", "rough-ggx", "rough-two-blinn", "two-ggx")


@pytest.mark.parametrize("table", [False, True])
@pytest.mark.parametrize("basis", SHOWN)
@pytest.mark.parametrize("model", MODELS)
def test_the_scenes_kernel_says_what_the_fit_says(model: str, basis: str, table: bool) -> None:
    made = scene_material(made_up(model, basis, table))
    assert made.off < 1e-9
    assert set(made.material.textures) == {
        *(["albedo"] if basis.startswith("albedo") else []),
        *(["shine"] if basis == "albedo-gloss" else []),
        *(RESIDUAL if basis in ("half", "albedo-half", "albedo-light") else []),
    }


def test_terms_are_as_few_as_the_material_needs() -> None:
    def terms(model: str, basis: str) -> int:
        return bound(cast(Any, MODEL), scene_material(made_up(model, basis)).material.tables).terms

    assert terms("rough-lambert", "albedo") == 1
    assert terms("blinn", "albedo-gloss") == 2
    assert terms("lambert", "half") == 5


def test_a_difference_in_hue_is_told() -> None:
    fit = made_up("blinn", "albedo")
    own = fit.shared.parametric
    mixed = replace(own, colours=own.colours * [[1, 1, 1], [0.2, 1, 4]])
    made = scene_material(replace(fit, shared=replace(fit.shared, parametric=mixed)))
    assert made.off < 1e-9  # a highlight may have a hue of its own
    two = made_up("two-blinn", "albedo")
    colours = two.shared.parametric.colours * [[1, 1, 1], [0.2, 1, 4], [4, 1, 0.2]]
    other = replace(two.shared.parametric, colours=colours)
    assert scene_material(replace(two, shared=replace(two.shared, parametric=other))).off > 1e-6


@pytest.mark.parametrize("basis", ["ptm", "harmonics", "constant-half"])
def test_what_a_scene_cannot_show_is_refused(basis: str) -> None:
    assert basis in BASES
    with pytest.raises(InputError, match=basis):
        scene_material(made_up("lambert", basis))
    with pytest.raises(InputError, match="paper"):
        fit = made_up("lambert", "none")
        own = replace(fit.shared.parametric, model="paper", shapes=(9.0,), colours=np.full((2, 3), 0.2))
        scene_material(replace(fit, shared=replace(fit.shared, parametric=own)))


def test_lamps_that_were_brighter_than_thought_make_no_material_that_glows() -> None:
    fit = made_up("blinn", "albedo")
    own = fit.shared.parametric
    bright = replace(own, colours=own.colours * 5)
    made = scene_material(replace(fit, shared=replace(fit.shared, parametric=bright)))
    assert made.notes
    assert made.off < 1e-6
    bare = scene_material(fit)
    assert not bare.notes
    model = cast(Any, bound(cast(Any, MODEL), made.material.tables))
    mean = {"albedo": made.material.textures["albedo"].image.pixels.mean(axis=(0, 1))}
    colour = tuple(float(v) for v in mean["albedo"])
    values = {**defaults(MODEL.Params), **made.material.values, "albedo": colour}
    assert albedo_table(model, values, np.radians([0, 30, 60])).max() <= 1.001


def test_vectors_turn_with_the_map() -> None:
    """s(P) of one direction in space, everywhere on the ball, is that direction in the map's axes."""
    size = 33
    fit = made_up("lambert", "half", size=size)
    way = np.array([0.3, -0.2, 0.4], np.float32)
    normals = slopes(size)
    own = (tangent_frames(normals) @ way)[:, :, :, None] * np.ones(3, np.float32)
    made = scene_material(replace(fit, coefficients=own.astype(np.float32)))
    maps = np.stack([made.material.textures[axis].image.pixels[..., 0] for axis in RESIDUAL], axis=-1)
    assert made.width == pytest.approx(2 * np.arctan(np.sqrt(2)) / np.sqrt(2))
    at = ((np.arange(size) + 0.5) / size * 2 - 1) * made.width / 2
    x, y = np.meshgrid(at, -at)
    away = np.hypot(x, y)
    normal = np.stack([x * np.sinc(away / np.pi), y * np.sinc(away / np.pi), np.cos(away)], axis=-1)
    np.testing.assert_allclose(maps[..., 2], normal @ way, atol=2e-3)
    # Near the middle, along the map's axes: one is cos x across, the other leans back by sin x.
    middle = size // 2
    np.testing.assert_allclose(maps[middle, :, 0], np.cos(at) * way[0] - np.sin(at) * way[2], atol=2e-3)
    np.testing.assert_allclose(maps[middle, :, 1], way[1], atol=2e-3)
    np.testing.assert_allclose(np.linalg.norm(maps, axis=-1), np.linalg.norm(way), atol=2e-3)


def test_a_flat_sample_stays_as_it_is() -> None:
    fit = made_up("lambert", "albedo-half")
    flat = np.zeros_like(fit.normals)
    flat[..., 2] = 1
    made = scene_material(replace(fit, normals=flat))
    assert made.width == 0
    for k, axis in enumerate(RESIDUAL):
        np.testing.assert_array_equal(
            made.material.textures[axis].image.pixels, fit.coefficients[:, :, 1 + k]
        )


def test_turning_the_pictures_turns_the_light_on_bumps(host: Any) -> None:
    material = scene_material(made_up("lambert", "half")).material
    turned = {name: replace(texture, rotation=200.0) for name, texture in material.textures.items()}
    found = resolve(replace(material, textures=turned), host)
    assert not found.problem
    assert found.values["direction"] == pytest.approx(-160)
    straight = resolve(material, host)
    assert straight.values["direction"] == 0
