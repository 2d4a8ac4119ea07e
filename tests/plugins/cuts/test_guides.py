"""What vertices tell of one between them."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from scenes import little_scene

from studio_core.contract import Services
from studio_core.kernels.directions import direction_set
from studio_core.scene.diff import Changes
from studio_core.shading.frame import Frame
from studio_core.shading.job import Job
from studio_core.shading.offline import backend_params, scene_view
from studio_core.shading.pipeline import Pipeline
from studio_plugins.cuts.guides import guess, packets_around
from studio_plugins.cuts.light_stage import LightStage
from studio_plugins.cuts.store import VisibilityStore
from studio_plugins.cuts.visibility_stage import VisibilityStage


@pytest.mark.parametrize("k", [10, 13, 15])
def test_packets_around_are_near_and_know_each_other(k):
    around = packets_around(k)
    middles = direction_set(k).directions.astype(np.float64).reshape(-1, 8, 3).mean(axis=1)
    middles /= np.linalg.norm(middles, axis=1, keepdims=True)
    angle = np.arccos(np.clip(np.einsum("nc,nmc->nm", middles, middles[around]), -1, 1))
    size = np.sqrt(4 * np.pi / len(around))
    assert angle.max() < 5 * size  # cells are up to 2:1, and more so at the horizon
    among = (around[:, :, None] == np.arange(len(around))[:, None, None]).any(axis=2)
    border = among.any(axis=1)  # over the horizon a corner is its own neighbour
    mutual = [
        (around[other] == packet).any() for packet in range(0, len(around), 37) for other in around[packet]
    ]
    assert np.mean(mutual) > 0.97
    assert border.mean() < 0.2


def test_a_guess_holds_only_where_both_agree_and_all_around_too():
    k, rng = 12, np.random.default_rng(2)
    around = packets_around(k)
    packets = (1 << k) // 8
    state_a = np.where(rng.random(packets) < 0.02, 7, np.repeat(rng.integers(0, 2, packets // 64) * 255, 64))
    state_b = np.where(rng.random(packets) < 0.02, 255 - state_a, state_a)
    a, b = (state.astype(np.uint8).view(np.uint64).copy() for state in (state_a, state_b))
    before, sure = a.copy(), np.empty_like(a)
    guess(a, b, around, np.empty_like(a), sure)
    byte = sure.view(np.uint8)
    open_ = (state_a != state_b) | ~np.isin(state_a, (0, 255))
    touched = open_.copy()
    touched[around[open_].ravel()] = True
    np.testing.assert_array_equal(byte == 255, ~touched)
    np.testing.assert_array_equal(byte == 0, touched)
    np.testing.assert_array_equal(a, before & sure)
    assert 0 < touched.mean() < 1


def test_refined_vertices_see_what_they_would_see_without_help(host, workers):
    scene = little_scene()
    backend, services = host.get("backend", "cuts"), Services(workers, host)
    values = {"directions": "4096", "vertices": 500, "quality": 1.0}
    params = backend_params(backend, values)
    view = dataclasses.replace(scene_view(scene, None, 96, 72), antialias=1)
    pipeline = Pipeline(backend.stages(services))
    made = pipeline.update(Frame(scene, view, params, 1), Changes(), Job("test"))
    assert pipeline.rounds > 0
    stage = next(stage for stage in pipeline.stages if isinstance(stage, VisibilityStage))
    light = next(stage for stage in pipeline.stages if isinstance(stage, LightStage))
    surfaces, occluders = stage._asked
    assert surfaces.base is not None
    points = np.flatnonzero(made.valid)
    alone = VisibilityStore(12, workers)
    alone._guides = lambda points: np.full((len(points), 2), -1, np.int64)  # type: ignore[method-assign]
    alone.follow(surfaces, occluders)
    alone.trace(points, Job("test"))
    helped = stage._store.summary()
    assert helped["skipped_packets_as_neighbours"] > 0
    assert helped["rays"] < 0.8 * alone.summary()["rays"]
    shown = light._environment.table.irradiance[points].copy()
    light._environment.follow(alone, light._environment._tree, 1e-4)
    light._environment.gather(
        alone, surfaces.mesh, points, np.zeros(len(surfaces.mesh), np.bool_), Job("test")
    )
    true = light._environment.table.irradiance[points]
    error = np.sqrt(((shown.astype(np.float64) - true) ** 2).mean()) / true.mean()
    assert error < 0.005
