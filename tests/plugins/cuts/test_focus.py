"""Nodes split for sharp lobes: towards the sum over leaves, and never worse than without."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scenes import little_scene

from studio_core.contract import Services
from studio_core.scene.diff import Changes, view_changed
from studio_core.scene.geometry import Image
from studio_core.scene.transform import Transform
from studio_core.shading.artifacts import Radiance
from studio_core.shading.frame import Frame
from studio_core.shading.job import Job
from studio_core.shading.offline import backend_params, scene_view, shade
from studio_core.shading.pipeline import Pipeline
from studio_plugins.cuts import focus_stage, light_stage
from studio_plugins.cuts.choose import MOST_NODES
from studio_plugins.cuts.focus import lobe_error
from studio_plugins.cuts.focus_stage import Focused, FocusStage, turned
from studio_plugins.cuts.quality import quality

VALUES = {"directions": "4096", "vertices": 500, "everywhere": True}
UNSPLIT = 1e9


@pytest.fixture(scope="module")
def services(host, workers):
    return Services(workers, host)


def spotted(seed: int) -> Image:
    """A sky with bright patches, none of them a sun."""
    rng = np.random.default_rng(seed)
    return Image((0.05 + np.kron(rng.gamma(0.4, 1.0, (8, 16, 3)), np.ones((4, 4, 1)))).astype(np.float32))


def scene_of(model, seed=0, **values):
    return little_scene(cube_model=model, cube_values=values, environment=spotted(seed))


def cuts(scene, host, services, monkeypatch, lobe, tolerance=2e-4) -> tuple[Radiance, Pipeline]:
    """By the cuts with these tolerances."""
    wanted = dataclasses.replace(quality(0.5), lobe=lobe, tolerance=tolerance)
    for module in (light_stage, focus_stage):
        monkeypatch.setattr(module, "quality", lambda control: wanted)
    backend = host.get("backend", "cuts")
    pipeline = Pipeline(backend.stages(services))
    params = backend_params(backend, {**VALUES, "refine": False})
    frame = Frame(scene, scene_view(scene, None, 32, 24), params, 1)
    return pipeline.update(frame, Changes(), Job("test")), pipeline


def leaves(scene, host, services) -> Radiance:
    reference = host.get("backend", "reference")
    params = backend_params(reference, {**VALUES, "quarters": False})
    return shade(scene, scene_view(scene, None, 32, 24), reference, params, services)


def wrong(made: Radiance, truth: Radiance) -> float:
    """Relative RMSE of the shiny object's terms."""
    own = made.surfaces.mesh.object == made.surfaces.nodes.index("cube")
    a, b = (one.layers["sky"].terms[own].sum(axis=1) for one in (made, truth))
    return float(np.sqrt(((a - b) ** 2).mean()) / b.mean())


@pytest.mark.parametrize(
    ("model", "values"),
    [
        ("ggx", {"roughness": 0.22, "metallic": 1.0}),
        ("ggx", {"roughness": 0.5, "metallic": 1.0}),
        ("phong", {"exponent": 300.0}),
        ("blinn-phong", {"exponent": 300.0}),
    ],
)
def test_sharp_lobes_converge_to_the_sum_over_leaves(host, services, monkeypatch, model, values):
    scene = scene_of(model, **values)
    truth = leaves(scene, host, services)
    steps = (UNSPLIT, 1e-2, 1e-3, 1e-4, 1e-7)
    errors = [wrong(cuts(scene, host, services, monkeypatch, lobe)[0], truth) for lobe in steps]
    assert all(error <= 1.05 * errors[0] + 1e-3 for error in errors)
    assert errors[-1] <= errors[2] + 1e-3
    assert errors[-1] < 5e-3
    finest = wrong(cuts(scene, host, services, monkeypatch, 1e-7, 1e-9)[0], truth)
    assert finest < 1e-3


@pytest.mark.parametrize("seed", range(3))
def test_splitting_is_never_worse(host, services, monkeypatch, seed):
    rng = np.random.default_rng(seed)
    scene = scene_of("ggx", seed, roughness=float(rng.uniform(0.15, 0.6)))
    truth = leaves(scene, host, services)
    plain = wrong(cuts(scene, host, services, monkeypatch, UNSPLIT)[0], truth)
    split = wrong(cuts(scene, host, services, monkeypatch, quality(0.5).lobe)[0], truth)
    assert split <= 1.02 * plain + 1e-4


def test_splitting_keeps_irradiance_and_counts(host, services, monkeypatch):
    scene = scene_of("ggx", roughness=0.2)
    made, pipeline = cuts(scene, host, services, monkeypatch, 1e-4)
    table, split = dict(pipeline.artifact(Focused).layers)["sky"][0]
    owned = np.flatnonzero(split.owned)
    assert len(owned) > 20
    assert (made.surfaces.mesh.object[owned] == made.surfaces.nodes.index("cube")).all()
    for p in owned[::7]:
        block = split.blocks[int(split.owner[p])]
        number = int(np.flatnonzero(block.points == p)[0])
        first, last = block.first[number : number + 2]
        nodes = block.data[6 * first : 6 * last].reshape(6, -1).T
        assert 0 < len(nodes) <= MOST_NODES
        np.testing.assert_allclose(np.linalg.norm(nodes[:, :3], axis=1), 1, atol=1e-3)
        np.testing.assert_allclose(nodes[:, 3:].sum(axis=0), table.irradiance[p], rtol=1e-3)


def test_matt_materials_are_left_alone(host, services, monkeypatch):
    _, pipeline = cuts(little_scene(), host, services, monkeypatch, 1e-4)
    split = dict(pipeline.artifact(Focused).layers)["sky"][0][1]
    assert not split.owned.any()
    assert any(isinstance(stage, FocusStage) for stage in pipeline.stages)


angles = st.floats(0.0, 1.57)


@given(angles, angles, st.floats(0, 6.3), st.sampled_from([0.0, 1e-6, 1e-3, 0.1, 2.0]), st.floats(1e-4, 1.5))
def test_estimates_are_finite_and_grow_with_the_spread(light, view, around, spread, alpha):
    def unit(theta, phi):
        return np.array([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], np.float32)

    wi, wo = unit(light, around), unit(view, 0.0)

    def estimate(spread, contribution=1.0):
        numbers = (*wi, *wo, spread, contribution, alpha)
        return float(lobe_error(*(np.float32(number) for number in numbers)))

    assert np.isfinite(estimate(spread))
    assert estimate(spread) >= 0
    assert estimate(spread, 0.0) == 0
    assert estimate(spread) <= 1.001 * estimate(2 * spread) + 1e-12
    assert estimate(0.0) <= 1e-6


def test_what_was_split_outlasts_small_turns_of_the_eye(host, services, monkeypatch):
    """While somebody looks around; at rest it is split for the eye that looks."""
    split = []
    own = FocusStage._split

    def counted(self, base, prefix, inputs, stale, *rest):
        split.append(int(stale.sum()))
        own(self, base, prefix, inputs, stale, *rest)

    monkeypatch.setattr(FocusStage, "_split", counted)
    scene = scene_of("ggx", base_color=(0.9, 0.9, 0.9), roughness=0.5)
    backend = host.get("backend", "cuts")
    pipeline = Pipeline(backend.stages(services))
    params = backend_params(backend, {**VALUES, "refine": False})
    view = scene_view(scene, None, 32, 24)

    def look(aside, moving):
        split.clear()
        placed = Transform((aside, 0.0, 0.0)) @ view.transform
        seen = dataclasses.replace(view, transform=placed)
        changes = Changes() if not aside and not moving else view_changed()
        made = pipeline.update(Frame(scene, seen, params, 1, moving), changes, Job("test"))
        return made, sum(split)

    _, everything = look(0.0, False)
    assert everything > 0
    assert look(1e-3, True)[1] == 0
    near, count = look(1.5, True)
    assert 0 < count <= everything
    exact, count = look(1.5, False)
    assert count == everything
    assert 0 < wrong(near, exact) < 0.05


def test_turns_are_angles():
    rng = np.random.default_rng(3)
    positions, before, eye = rng.normal(size=(3, 50, 3)).astype(np.float32)
    was, now = before - positions, eye - positions
    cosine = (was * now).sum(axis=1) / np.linalg.norm(was, axis=1) / np.linalg.norm(now, axis=1)
    expected = 2 * np.sin(np.arccos(np.clip(cosine, -1, 1)) / 2)  # of the chord
    np.testing.assert_allclose(turned(positions, before, eye), expected, atol=1e-5)
    assert turned(positions, eye, eye).max() == 0
