"""The measured model: its table as the kernel reads it, energy, and what happens without a table."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from oracles.brdf import albedo, ggx, unit

from studio_core.arrays import frozen_map
from studio_core.brdfs.calls import evaluate as call
from studio_core.brdfs.half_difference import grid, to_angles
from studio_core.kernels.tables import REFERENCE
from studio_core.params import defaults
from studio_core.registry import PluginHost
from studio_core.scene.geometry import Table
from studio_core.scene.nodes import Material, Scene
from studio_core.shading.materials import resolve, same_shapes, shapes
from studio_plugins.brdfs import plugin
from studio_plugins.brdfs.measured import CURVE, MODEL, SLOT

F64 = npt.NDArray[np.float64]
DEFAULTS = defaults(MODEL.Params)
HOST = PluginHost([plugin])


def evaluate(shape: Any, wo: Any, wi: Any) -> F64:
    """(N, 3) of the kernel for one wo (3,) and wi (N, 3)."""
    return call(MODEL, shape, wo, wi).astype(np.float64)


def rough(seed: int = 0, shape: tuple[int, ...] = (7, 6, 8)) -> Table:
    return Table(np.random.default_rng(seed).uniform(0, 0.3, (*shape, 3)).astype(np.float32))


def mirrored(factor: float, seed: int = 2) -> Table:
    """The same to the left and to the right, as the adaptive quadrature takes for granted."""
    values = rough(seed).values
    return Table(factor * (values + values[:, :, ::-1]) / 2)


def oracle(table: F64, wo: F64, wi: F64) -> F64:
    """Trilinear interpolation between the middles of cells, one corner after the other."""
    h, d, p = table.shape[:3]
    theta_h, theta_d, phi_d = to_angles(wi, np.broadcast_to(wo, wi.shape))
    at = np.stack(
        [h * np.sqrt(theta_h / (np.pi / 2)) - 0.5, d * theta_d / (np.pi / 2) - 0.5, p * phi_d / np.pi - 0.5],
        -1,
    )
    at[:, 0], at[:, 1] = np.clip(at[:, 0], 0, h - 1), np.clip(at[:, 1], 0, d - 1)
    made = np.zeros((len(wi), 3))
    for n, place in enumerate(at):
        base = np.floor(place).astype(int)
        for corner in np.ndindex(2, 2, 2):
            weight = np.prod(np.where(corner, place - base, 1 - place + base))
            i, j, k = base + corner
            made[n] += weight * table[min(i, h - 1), min(j, d - 1), k % p]
    return made


def above(rng: np.random.Generator, count: int) -> F64:
    made = unit(rng.normal(size=(count, 3)))
    made[:, 2] = np.abs(made[:, 2])
    return made


@given(seed=st.integers(0, 2**32))
@settings(max_examples=30, deadline=None)
def test_kernel_is_trilinear_interpolation(seed: int) -> None:
    rng = np.random.default_rng(seed)
    table = rough(seed, tuple(rng.integers(1, 9, 3)))
    shape = MODEL.shape_of({**DEFAULTS, "keep_energy": False}, {SLOT: table})
    wo, wi = above(rng, 1)[0], above(rng, 30)
    wi[:3] = unit(wo * [-1, -1, 1] + rng.normal(size=(3, 3)) * 1e-2)
    found, truth = evaluate(shape, wo, wi), oracle(table.values.astype(np.float64), wo, wi)
    sure = wi[:, 2] > 1e-3
    np.testing.assert_allclose(found[sure], truth[sure], atol=2e-3)
    np.testing.assert_allclose(found[sure].mean(), truth[sure].mean(), rtol=1e-4)


def test_a_table_of_ggx_gives_ggx() -> None:
    values = {"base_color": (0.7, 0.3, 0.1), "metallic": 1.0, "roughness": 0.5, "specular": 0.5}
    wi, wo = grid((90, 60, 60))
    known = (wi[..., 2] > 0) & (wo[..., 2] > 0)
    made = np.zeros((90, 60, 60, 3))
    made[known] = ggx(values, wo[known], wi[known])
    table = Table(made.astype(np.float32))
    shape = MODEL.shape_of(DEFAULTS, {SLOT: table})
    rng = np.random.default_rng(4)
    lit = above(rng, 400)
    seen = unit(np.array([0.5, 0.1, 0.8]))
    lit = lit[lit[:, 2] > 0.2]
    truth = ggx(values, np.broadcast_to(seen, lit.shape), lit)
    np.testing.assert_allclose(evaluate(shape, seen, lit), truth, rtol=0.02, atol=1e-3)


@given(seed=st.integers(0, 2**32))
@settings(max_examples=30, deadline=None)
def test_is_reciprocal_and_finite(seed: int) -> None:
    rng = np.random.default_rng(seed)
    table = Table(rough(seed).values * 8)  # must outlive its shape
    shape = MODEL.shape_of(DEFAULTS, {SLOT: table})
    w = above(rng, 24)
    w[:4, 2] *= 1e-4
    w[4] = (0, 0, 1)
    w[5:9] = unit(w[9:13] * [-1, -1, 1] + 1e-6 * rng.normal(size=(4, 3)))
    w[:, 2] = np.abs(w[:, 2])
    w = unit(w).astype(np.float32)
    there = np.stack([evaluate(shape, o, w) for o in w])
    assert np.isfinite(there).all()
    np.testing.assert_allclose(there, there.transpose(1, 0, 2), rtol=1e-4, atol=1e-6)


def furnace(shape: Any) -> F64:
    theta = np.radians(np.linspace(0, 89, 12))
    wo = np.stack([np.sin(theta), 0 * theta, np.cos(theta)], -1)

    def f(row: Any, wi: Any) -> F64:
        made = np.empty((len(row), 3))
        for r in np.unique(row):
            made[row == r] = evaluate(shape, wo[r], wi[row == r])
        return made

    return albedo(f, wo, tolerance=1e-4, rounds=6)


def test_no_more_light_than_arrives_unless_asked() -> None:
    bright = mirrored(4).values.copy()  # up to 1.2 / sr
    bright[:, 4:] *= 6  # grazing
    table = Table(bright)
    kept = furnace(MODEL.shape_of(DEFAULTS, {SLOT: table}))
    raw = furnace(MODEL.shape_of({**DEFAULTS, "keep_energy": False}, {SLOT: table}))
    assert raw.max() > 1.5
    assert kept.max() <= 1.001
    dim = mirrored(0.5)
    sound = MODEL.shape_of(DEFAULTS, {SLOT: dim})
    np.testing.assert_array_equal(sound[REFERENCE : REFERENCE + CURVE], 1)


def test_its_own_albedo_is_that_of_adaptive_quadrature() -> None:
    table = mirrored(0.5, 5)
    theta = np.radians(np.linspace(0, 89, 12))
    own = MODEL.albedo(table)
    at = theta / (np.pi / 2) * (CURVE - 1)
    expected = furnace(MODEL.shape_of(DEFAULTS, {SLOT: table}))
    found = np.stack([np.interp(at, np.arange(CURVE), own[:, c]) for c in range(3)], -1)
    np.testing.assert_allclose(found, expected, rtol=0.02)


def scene(**changes: Any) -> tuple[Scene, Material]:
    material = Material(id="m", name="Cloth", model="measured", tables=frozen_map({SLOT: rough()}), **changes)
    return Scene().with_materials(material), material


def test_a_tint_leaves_the_shapes_as_they_are() -> None:
    before, material = scene()
    after = dataclasses.replace(material, values=frozen_map({"tint": (1.0, 0.5, 0.5)}))
    one, two = (shapes(s, ["m"], HOST) for s in (before, before.with_materials(after)))
    assert same_shapes(one, two)
    assert one.tables == (material.tables[SLOT],)
    assert not one.problems
    other = dataclasses.replace(material, tables=frozen_map({SLOT: rough(9)}))
    assert not same_shapes(one, shapes(before.with_materials(other), ["m"], HOST))
    assert len(one.data) < 200


@pytest.mark.parametrize(
    ("tables", "words"),
    [
        ({}, "no measurement"),
        ({SLOT: Table(np.full((2, 2, 2, 1), 0.1, np.float32))}, "no table of reflectances"),
        ({SLOT: Table(np.full((2, 2, 2, 3), -0.1, np.float32))}, "no table of reflectances"),
    ],
)
def test_without_a_table_it_is_matte_grey_and_says_so(tables: dict[str, Table], words: str) -> None:
    whole, material = scene()
    bare = dataclasses.replace(material, tables=frozen_map(tables))
    found = resolve(bare, HOST)
    assert found.brdf.id == "lambert"
    assert words in found.problem
    assert found.problem.startswith("Cloth: ")
    assert found.problem in shapes(whole.with_materials(bare), ["m"], HOST).problems
