"""Mitsuba's `direct` integrator on an exported folder: the same picture as ours of depth 2, well sampled."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from scenes import little_scene

from studio_core.registry import PluginHost
from studio_core.scene.nodes import Environment
from studio_plugins.export import mitsuba_run
from studio_plugins.export.mitsuba import EXPORTER

pytest.importorskip("mitsuba", reason="the extra `peers` (Mitsuba 3) is not installed")

SIZE = (48, 27)


@pytest.mark.parametrize("seen", [True, False])
def test_it_agrees_with_paths_of_depth_two(seen: bool, host: PluginHost, tmp_path: Path) -> None:
    scene = little_scene()
    sky = next(scene.of(Environment))
    EXPORTER.save(scene.with_nodes(dataclasses.replace(sky, background=seen)), tmp_path, host)
    renderer = mitsuba_run.DirectRenderer(tmp_path, SIZE)
    direct, seconds = renderer.timed(256, seed=3)
    assert direct.shape == (SIZE[1], SIZE[0], 3)
    assert seconds > 0
    paths = mitsuba_run.render(tmp_path, 1024, SIZE, seed=4)
    assert np.sqrt(np.mean((direct - paths) ** 2)) < 0.04 * paths.mean()
    corner = direct[0, 0]
    assert (corner > 0.1).all() if seen else (corner == 0).all()


def test_multijittered_samples_are_less_noisy(host: PluginHost, tmp_path: Path) -> None:
    EXPORTER.save(little_scene(), tmp_path, host)
    truth = mitsuba_run.render(tmp_path, 4096, SIZE, seed=9)
    errors = {}
    for sampler in ("independent", "multijitter"):
        renderer = mitsuba_run.DirectRenderer(tmp_path, SIZE, sampler)
        first, again, other = renderer(64, seed=1), renderer(64, seed=1), renderer(64, seed=2)
        np.testing.assert_allclose(first, again, rtol=1e-5)
        assert (first != other).any()
        errors[sampler] = np.sqrt(np.mean((first - truth) ** 2))
    assert errors["multijitter"] < 0.8 * errors["independent"]
