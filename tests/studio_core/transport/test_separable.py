"""Reflectance as sums of products: what they return, where they point, and that nothing is made twice."""

from __future__ import annotations

import itertools
from typing import Any, cast

import numpy as np
import pytest
from brdf_models import BUNDLED, MODELS
from captured_fits import made_up
from hypothesis import given, settings
from hypothesis import strategies as st
from oracles.separable import cell_mean, dense_means, made, relative_error

from studio_core.brdfs.albedo import quadrature_albedo
from studio_core.brdfs.calls import evaluate
from studio_core.errors import Cancelled
from studio_core.params import defaults
from studio_core.registry import PluginHost
from studio_core.scene.geometry import Table
from studio_core.scene.nodes import Material, Scene
from studio_core.shading.artifacts import Shapes
from studio_core.shading.job import Job
from studio_core.shading.materials import shapes
from studio_core.transport.cell_means import Kernel, cell_means, traits
from studio_core.transport.cells import CELLS, PARTS, RINGS, cell_projected_angles
from studio_core.transport.factors import Directed
from studio_core.transport.separable import SPILL, Separator, fixed
from studio_core.transport.symmetries import symmetry
from studio_plugins.residual.material import scene_material

W = cell_projected_angles().astype(np.float64)
SEPARATOR = Separator()


def shape_of(name: str, **changes: Any) -> np.ndarray:
    brdf = MODELS[name]
    return np.atleast_1d(np.asarray(brdf.shape({**defaults(brdf.Params), **changes}), np.float32))


def rows(*kinds: tuple[str, dict[str, Any]]) -> Shapes:
    data = [shape_of(name, **changes) for name, changes in kinds]
    offset = np.cumsum([0, *(len(one) for one in data)])[:-1]
    return Shapes(
        np.array([MODELS[name].address for name, _ in kinds]),
        np.array([MODELS[name].terms for name, _ in kinds]),
        offset,
        np.concatenate([*data, np.zeros(1, np.float32)]),
    )


def reflected(dense: np.ndarray) -> np.ndarray:
    """(CELLS,) share of light from each cell."""
    return np.asarray(dense @ W)


def ring_albedo(name: str, changes: dict[str, Any], term: int, azimuth: float = 0.0) -> np.ndarray:
    """(RINGS,) means over the rings of the hemispherical reflectance."""
    theta = (np.arange(4 * RINGS) + 0.5) * np.pi / 2 / (4 * RINGS)
    wo = np.stack([np.sin(theta) * np.cos(azimuth), np.sin(theta) * np.sin(azimuth), np.cos(theta)], 1)
    found = quadrature_albedo(MODELS[name], shape_of(name, **changes), wo, 1e-4, 0.1)[:, term]
    weight = np.sin(theta) * np.cos(theta)
    return np.asarray((found * weight).reshape(RINGS, 4).sum(axis=1) / weight.reshape(RINGS, 4).sum(axis=1))


SHARPER = [
    ("phong", {"exponent": 5.0}, 1),
    ("phong", {"exponent": 64.0}, 1),
    ("phong", {"exponent": 2000.0}, 1),
    ("ggx", {"roughness": 0.5}, 1),
    ("ggx", {"roughness": 0.15}, 1),
    ("ggx", {"roughness": 0.5}, 2),
    ("cloth", {}, 1),
    ("oren-nayar", {}, 1),
]


@pytest.mark.parametrize(("name", "changes", "term"), SHARPER)
@pytest.mark.parametrize("most", [8, 36])
def test_light_from_everywhere_returns_as_much(
    name: str, changes: dict[str, Any], term: int, most: int
) -> None:
    found = SEPARATOR(rows((name, changes)), 0.05, most)
    true = ring_albedo(name, changes, term)
    scale = np.maximum(true, true @ W.reshape(RINGS, PARTS).sum(axis=1) / np.pi)
    plain = reflected(made(found, 0, term, clamped=False)).reshape(RINGS, PARTS)
    sharp = name == "ggx" and changes["roughness"] < 0.2
    close = 0.04 if sharp else 0.01  # grazing light on what is nearly a mirror
    assert (np.abs(plain - true[:, None]) <= close * scale[:, None]).all()
    kept = reflected(made(found, 0, term)).reshape(RINGS, PARTS)
    assert (kept <= plain + 1.01 * SPILL * scale[:, None]).all()
    assert (kept >= plain - 1e-5).all()


@pytest.mark.parametrize("name", [name for name in BUNDLED if name != "measured"])
def test_the_error_is_what_it_says(name: str) -> None:
    """At the defaults of every model, against means of the same cells made with a tolerance of nothing."""
    shape = rows((name, {}))
    found, fine = SEPARATOR(shape, 0.1, 30), fixed(shape, CELLS)
    assert found.count[0] <= 30
    weights = []
    errors = []
    for term in range(MODELS[name].terms):
        if found.matte[0, term]:
            assert not (found.functions(0)[2] == term).any()
            continue
        true = made(fine, 0, term, clamped=False)
        if not true.any():
            continue
        weights.append(min(float(W @ true @ W) / np.pi, 1.0))
        errors.append(relative_error(made(found, 0, term), true))
    if errors:
        expected = np.max(np.sqrt(np.array(weights) / max(weights)) * errors)
        assert found.error[0] == pytest.approx(expected, abs=0.03)


def test_means_over_cells_are_those_of_brute_force() -> None:
    """Against regular subdivision of both cells, where the lobe is much wider than a cell, and near it."""
    brdf, shape = MODELS["phong"], shape_of("phong", exponent=8.0)
    fine = made(fixed(rows(("phong", {"exponent": 8.0})), CELLS), 0, 1, clamped=False)
    rng = np.random.default_rng(4)
    light, view = rng.integers(0, CELLS, (2, 60))
    view[:30] = light[:30] // PARTS * PARTS + (light[:30] + PARTS // 2 + rng.integers(-3, 4, 30)) % PARTS
    true = np.array([cell_mean(brdf, shape, i, o, 6)[1] for i, o in zip(light, view, strict=True)])
    np.testing.assert_allclose(fine[light, view], true, atol=0.015 * fine.max())


def test_a_lobe_with_a_direction_has_its_means_too() -> None:
    own = {"roughness": 0.8, "anisotropy": 0.6}
    brdf, shape = MODELS["ward"], shape_of("ward", **own)
    found = SEPARATOR(rows(("ward", own)), 0.02, 150)
    dense = made(found, 0, 1)
    rng = np.random.default_rng(5)
    light, view = rng.integers(0, CELLS * 7 // 8, (2, 40))
    view[:25] = light[:25] // PARTS * PARTS + (light[:25] + PARTS // 2 + rng.integers(-3, 4, 25)) % PARTS
    true = np.array([cell_mean(brdf, shape, i, o, 5)[1] for i, o in zip(light, view, strict=True)])
    assert np.sqrt(np.mean((dense[light, view] - true) ** 2)) < 0.08 * np.sqrt(np.mean(true**2))


@pytest.mark.parametrize(
    "known", [(True, False, False), (False, True, False), (False, False, True), (False,) * 3]
)
def test_symmetries_save_work_and_change_nothing(known: tuple[bool, bool, bool]) -> None:
    """Made with all of its symmetries, with one, and with none, brushed metal is the same kernel."""
    shape = shape_of("ward", roughness=0.7)
    kernel = Kernel(MODELS["ward"].address, MODELS["ward"].terms, shape)
    found = traits(kernel)
    assert len(found.alike.images) == 4
    assert found.reciprocal.all()
    assert not found.turns[1]
    dense = []
    for alike in (found.alike, symmetry(*known)):
        means = cell_means(kernel, [1], alike)[0]
        spectrum = Directed(means, alike, True, False, 60)
        incoming, outgoing = spectrum.products(
            np.where(spectrum.values > np.sort(spectrum.values)[-40], spectrum.values, 0)
        )
        dense.append(incoming @ outgoing.T)
    assert relative_error(dense[1], dense[0]) < 0.02


@settings(max_examples=8, deadline=None)
@given(st.floats(0.2, 1.0), st.integers(6, 40), st.sampled_from([0.05, 0.15, 0.3]))
def test_products_know_no_order_of_directions(roughness: float, most: int, tolerance: float) -> None:
    """As the kernel: exchanging light and view changes nothing."""
    found = SEPARATOR(rows(("ggx", {"roughness": roughness})), tolerance, most)
    assert found.count[0] <= most
    dense = made(found, 0, 1, clamped=False)
    np.testing.assert_allclose(dense, dense.T, atol=1e-4 * dense.max())


def test_more_products_err_less_and_a_tolerance_finds_how_many() -> None:
    lobe = rows(("phong", {"exponent": 10.0}))
    errors = [float(SEPARATOR(lobe, 0.0, most).error[0]) for most in (4, 9, 16, 25, 36, 64)]
    assert all(b < a for a, b in itertools.pairwise(errors))
    for tolerance in (0.3, 0.15, 0.05):
        found = SEPARATOR(lobe, tolerance, 200)
        assert found.error[0] <= tolerance
        fewer = SEPARATOR(lobe, tolerance, int(found.count[0]) - 2)
        assert fewer.error[0] > tolerance


def test_the_papers_mode_is_the_plain_decomposition() -> None:
    """n = 10: four functions leave 57 %, sixteen 16 % (docs/interreflection.md); exact for all."""
    lobe = rows(("phong", {"exponent": 10.0}))
    assert fixed(lobe, 4).error[0] == pytest.approx(0.57, abs=0.01)
    assert fixed(lobe, 16).error[0] == pytest.approx(0.155, abs=0.01)
    assert fixed(lobe, 4).count[0] == 4
    true = made(fixed(lobe, CELLS), 0, 1, clamped=False)
    assert relative_error(made(fixed(lobe, 4), 0, 1, clamped=False), true) == pytest.approx(0.57, abs=0.01)


def test_the_oracle_of_whole_kernels_agrees() -> None:
    """A wide lobe, all million pairs: two directions a cell and side suffice."""
    shape = shape_of("phong", exponent=3.0)
    true = dense_means(MODELS["phong"], shape, 1, 2)
    found = SEPARATOR(rows(("phong", {"exponent": 3.0})), 0.05, 60)
    assert relative_error(made(found, 0, 1), true) < 0.06


def test_constants_have_no_functions_and_equal_shapes_share() -> None:
    every = rows(("lambert", {}), ("phong", {"exponent": 20.0}), ("ggx", {}), ("phong", {"exponent": 20.0}))
    found = Separator()(every, 0.2, 20)
    assert found.count[0] == 0
    assert found.matte[0, 0] == 1
    assert found.matte[1, 0] == 1
    assert found.matte[1, 1] == 0
    assert found.base[1] == found.base[3]
    assert found.first[1] == found.first[3]
    assert found.incoming.size == CELLS * (found.count[1] + found.count[2])
    assert found.matte.shape == (4, every.width)
    assert found.incoming.dtype == found.outgoing.dtype == np.float32


@pytest.mark.parametrize("name", [name for name in BUNDLED if name != "measured"])
def test_the_sharpest_lobe_is_not_lost(name: str) -> None:
    """At roughness 0, or the largest exponent, a blurred lobe returns about what a mirror does."""
    sharp = {"roughness": 0.0, "exponent": 1e5, "sharpness_along": 1e5, "sharpness_across": 1e5}
    own = {key: value for key, value in sharp.items() if key in defaults(MODELS[name].Params)}
    found = SEPARATOR(rows((name, own)), 0.15, 12)
    assert found.count[0] <= 12
    assert np.isfinite(found.incoming).all()
    assert np.isfinite(found.outgoing).all()
    ring = 8
    theta = (ring + 0.5) * np.pi / 2 / RINGS
    wo = np.array([[np.sin(theta), 0, np.cos(theta)]], np.float32)
    true = quadrature_albedo(MODELS[name], shape_of(name, **own), wo, 1e-4, 0.1)[0]
    for term in range(MODELS[name].terms):
        back = reflected(made(found, 0, term, clamped=False))[ring * PARTS]
        assert back == pytest.approx(true[term], rel=0.05, abs=0.01)


def test_only_what_changed_is_made_anew() -> None:
    separator = Separator()
    first = separator(rows(("phong", {"exponent": 20.0}), ("ggx", {})), 0.2, 20)
    assert separator.made == 2
    assert separator(rows(("phong", {"exponent": 20.0}), ("ggx", {})), 0.2, 20) is first
    separator(rows(("phong", {"exponent": 21.0}), ("ggx", {})), 0.2, 20)
    assert separator.made == 3
    separator(rows(("ggx", {}), ("phong", {"exponent": 20.0})), 0.2, 20)
    assert separator.made == 3


def test_each_tolerance_has_its_last_result_at_hand() -> None:
    separator, shape = Separator(), rows(("ggx", {}))
    coarse, fine = separator(shape, 0.5, 8), separator(shape, 0.1, 36)
    assert separator(shape, 0.5, 8) is coarse
    assert separator(shape, 0.1, 36) is fine
    assert separator.made == 2


def test_what_a_cancelled_job_made_is_kept() -> None:
    """The second of two shapes is never reached; asked again, the first is there."""

    def stop(job: Job) -> None:
        if job.done == 1:
            job.cancel()

    separator = Separator()
    both = rows(("phong", {"exponent": 20.0}), ("ggx", {}), ("plastic", {}))
    with pytest.raises(Cancelled):
        separator(both, 0.2, 20, Job("apart", stop))
    assert separator.made == 2
    whole = separator(both, 0.2, 20, Job("apart"))
    assert separator.made == 3
    fresh = Separator()(both, 0.2, 20)
    np.testing.assert_array_equal(whole.incoming, fresh.incoming)
    np.testing.assert_array_equal(whole.outgoing, fresh.outgoing)


def test_a_picture_of_roughness_makes_few_kinds() -> None:
    base = rows(*[("ggx", {"roughness": float(r)}) for r in [0.5, *np.linspace(0.2, 0.9, 120)]])
    varying = Shapes(
        base.address,
        base.terms,
        base.offset,
        base.data,
        owner=np.zeros(121, np.int64),
        row=np.zeros(9, np.int32),
    )
    separator = Separator()
    found = separator(varying, 0.3, 12)
    assert separator.made <= 17
    assert len(found.count) == 121
    width = [int(found.count[r]) for r in range(1, 121)]
    assert len(set(found.base.tolist())) <= 17
    assert max(width) <= 12


def test_measured_tables_turn_with_the_normal_though_left_and_right_differ() -> None:
    """As noisy measurements do: one ring of blocks, and the energy of both sides."""
    table = Table(np.random.default_rng(3).uniform(0, 0.3, (12, 8, 16, 3)).astype(np.float32))
    model = cast(Any, MODELS["measured"])
    shape = model.shape_of(defaults(model.Params), {model.tables[0]: table})
    where = np.array([model.address]), np.array([model.terms]), np.zeros(1, np.int64)
    kept = Shapes(*where, np.append(shape, np.float32(0)), tables=(table,))
    found = Separator()(kept, 0.1, 40)
    known = traits(Kernel(model.address, model.terms, shape))
    assert known.turns.all()
    assert not known.even.any()
    theta = (np.arange(RINGS) + 0.5) * np.pi / 2 / RINGS
    for term in range(model.terms):
        plain = reflected(made(found, 0, term, clamped=False)).reshape(RINGS, PARTS)
        assert np.ptp(plain, axis=1).max() < 1e-5
        for ring in (1, 8, 12):
            wo = np.array([np.sin(theta[ring]), 0, np.cos(theta[ring])], np.float32)
            true = cell_sum(model, shape, wo, term)
            assert plain[ring, 0] == pytest.approx(true, rel=0.02)


def cell_sum(brdf: Any, shape: np.ndarray, wo: np.ndarray, term: int) -> float:
    """∫ b cos over the hemisphere by a fine regular grid."""
    t, p = np.meshgrid(
        (np.arange(180) + 0.5) * np.pi / 360, (np.arange(720) + 0.5) * np.pi / 360, indexing="ij"
    )
    wi = np.stack([np.sin(t) * np.cos(p), np.sin(t) * np.sin(p), np.cos(t)], -1).reshape(-1, 3)
    weights = (np.sin(t) * np.cos(t)).ravel() * (np.pi / 360) ** 2
    return float(weights @ evaluate(brdf, shape, wo, wi)[:, term].astype(np.float64))


def test_captured_differences_may_be_below_nothing(host: PluginHost) -> None:
    """A photographed material's rows s(P)·H are odd in direction: no clamping, and no even part to keep."""
    material = scene_material(made_up("blinn", "albedo-half")).material
    kept = shapes(Scene().with_materials(material), [material.id], host)
    found = SEPARATOR(kept, 0.1, 80)
    signed = np.flatnonzero(found.signed[0])
    assert len(signed)
    fine = fixed(kept, 400)
    for term in signed:
        true = made(fine, 0, int(term))
        assert true.min() < 0
        # the residual has no cosine of its own, so light at grazing weighs much: compared below 80°
        low = slice(0, CELLS * 7 // 8)
        error = relative_error_of(made(found, 0, int(term))[low], true[low])
        assert error < 0.3


def relative_error_of(found: np.ndarray, true: np.ndarray) -> float:
    w = W[: len(found)]
    return float(np.sqrt((w @ (found - true) ** 2 @ W) / (w @ true**2 @ W)))


def test_nothing_at_all_is_fine() -> None:
    none = Shapes(
        np.zeros(0, np.int64), np.zeros(0, np.int64), np.zeros(0, np.int64), np.zeros(1, np.float32)
    )
    found = Separator()(none, 0.1, 10)
    assert len(found.count) == 0
    assert found.nbytes == 0 or found.incoming.size == 0


def test_materials_of_a_scene(host: PluginHost) -> None:
    scene = Scene().with_materials(Material(id="m", name="M", model="ggx"), Material(id="n", name="N"))
    found = SEPARATOR(shapes(scene, ["m", "n"], host), 0.15, 36)
    assert len(found.error) == 2
    assert found.functions(0)[0].shape == (CELLS, found.count[0])
