"""Flat samples: RTI sets without a ball."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from studio.bench.lab import Rig, scattered, shoot
from studio.bench.lab_files import write_shots
from studio.bench.lab_surfaces import Surface, Waves, rough_matte
from studio_core.errors import InputError
from studio_plugins.residual.errors import errors
from studio_plugins.residual.fit import fit
from studio_plugins.residual.flat import flat_samples
from studio_plugins.residual.lights import read_lights
from studio_plugins.residual.masks import lit, outside_highlight
from studio_plugins.residual.pictures import Pictures, read_folder
from studio_plugins.residual.result import Settings
from studio_plugins.residual.samples import Lights

CLOTH = Surface(
    (0.5, 0.4, 0.3),
    (0.15, 0.2, 0.3),
    Waves.random(3, 0.3),
    1.0,
    Waves.random(2, 0.16),
    0.006,
    rough_matte(0.3),
)


def test_an_rti_set_is_fitted_without_a_ball(tmp_path: Path) -> None:
    shots = shoot(CLOTH, scattered(20, 4), Rig(size=(40, 32), flat=True))
    listed = write_shots(shots, tmp_path, lights="lp")
    assert listed is not None
    samples = flat_samples(read_folder(tmp_path, read_lights(listed)), 20)
    assert samples.size == (16, 20)
    assert np.allclose(samples.values[3, 2, 5], shots.pictures[3, 4:6, 10:12].mean(axis=(0, 1)), atol=1e-6)
    held = np.arange(20) % 3 == 0
    found = fit(samples.some(~held), Settings(models=("lambert", "rough-lambert"), refine=0))
    test = samples.some(held)
    use = test.usable & lit(test)
    made = errors(found.predict(test.lights), test.values, use, outside_highlight(test))
    alone = errors(found.alone(test.lights), test.values, use, outside_highlight(test))
    assert alone.whole > 0.05
    assert made.whole < 0.02


def test_mask_and_perspective() -> None:
    light = np.ones((1, 40, 60, 3), np.float32)
    pictures = Pictures(light, np.zeros((1, 40, 60), np.bool_), Lights.of([[0, 0, 1]]))
    mask = np.zeros((40, 60), np.bool_)
    mask[10:30, 40:60] = True
    mask[10:14, 40:44] = False
    made = flat_samples(pictures, 10, mask, 2.0)
    assert made.size == (10, 10)
    assert not made.usable[0, :2, :2].any()
    assert made.usable[0, 2:, 2:].all()
    # the right edge is half a width from the middle, the camera two widths away
    right = made.views[4:6, -1].mean(axis=0)
    assert right[0] / right[2] == pytest.approx(-(0.5 - 1 / 60) / 2, rel=1e-3)
    assert abs(right[1]) < 1e-3
    assert made.views[0, 0, 1] < 0 < made.views[-1, 0, 1]
    with pytest.raises(InputError, match="at least 8 × 8"):
        flat_samples(pictures, 10, mask & (np.arange(60) > 55))
