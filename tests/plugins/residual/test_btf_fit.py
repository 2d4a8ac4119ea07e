"""The fit of a BTF: what is known comes back, and lights that were held back are foretold."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from studio.bench.lab_btf import ClothBtf, Weave
from studio_core.errors import Cancelled, InputError
from studio_core.shading.job import Job
from studio_plugins.residual.btf import directions
from studio_plugins.residual.btf_fit import fit_btf, lights_held
from studio_plugins.residual.result import Settings

RINGS = [(0.0, 1), (25.0, 6), (50.0, 10), (70.0, 12)]
SOME = np.concatenate([directions(np.radians(t), 2 * np.pi * np.arange(n) / n) for t, n in RINGS])
QUICK = Settings(models=("lambert", "rough-blinn"))


def cloth(height: float = 0.02, shine: float = 0.05, parallax: bool = True) -> ClothBtf:
    weave = Weave(texels=24, yarns=2, height=height, shine=(shine, 30.0))
    return ClothBtf(weave, SOME, parallax=parallax)


def test_flat_matte_cloth_is_its_albedo() -> None:
    btf = cloth(height=0.0, shine=0.0)
    made, errors = fit_btf(btf, replace(QUICK, basis="albedo"), lights_held(btf, 0.3))
    assert errors is not None
    assert errors.alone.whole > 0.05
    assert errors.made.whole < 1e-4  # 8 bits
    truth = btf.weave._colours[2]
    found = made.shared.parametric.colours[0] + made.coefficients[:, :, 0]
    assert np.abs(found / truth - 1).max() < 0.01


@pytest.mark.parametrize(("parallax", "most"), [(False, 0.02), (True, 0.06)])
def test_lights_held_back_are_foretold(parallax: bool, most: float) -> None:
    btf = cloth(parallax=parallax)
    made, errors = fit_btf(btf, QUICK, lights_held(btf, 0.25))
    assert errors is not None
    assert errors.pictures == 7 * 29
    assert errors.made.whole < most < 0.5 * errors.alone.whole
    assert made.basis.name == "albedo-light"  # a tilted normal is what yarns have
    assert made.coefficients.shape == (24, 24, 4, 3)
    assert (made.rank[:, :] == 4).all()
    plain = next(c for c in made.tried if c.basis == "none")
    assert min(c.nmse for c in made.tried) < 0.3 * plain.nmse
    shown = made.predict(made.lights)
    assert shown.shape == (29, 24, 24, 3)


def test_the_longer_side_may_be_made_smaller() -> None:
    btf = cloth()
    made, _ = fit_btf(btf, replace(QUICK, basis="albedo"), size=8)
    whole, _ = fit_btf(btf, replace(QUICK, basis="albedo"))
    assert made.coefficients.shape == (8, 8, 1, 3)
    mean = whole.coefficients.reshape(8, 3, 8, 3, 1, 3).mean(axis=(1, 3))
    base = whole.shared.parametric.colours[0], made.shared.parametric.colours[0]
    assert np.allclose(made.coefficients + base[1], mean + base[0], atol=0.02)


def test_it_tells_how_far_it_is_and_can_be_stopped() -> None:
    btf = cloth()
    steps: list[tuple[int, int]] = []
    fit_btf(
        btf, replace(QUICK, basis="half"), job=Job("fit", lambda job: steps.append((job.done, job.total)))
    )
    assert steps == sorted(steps)
    assert steps[-1][0] < steps[-1][1]
    with pytest.raises(Cancelled):
        fit_btf(btf, QUICK, job=Job("fit", lambda job: job.cancel()))


def test_what_cannot_be_fitted_is_said() -> None:
    btf = cloth()
    with pytest.raises(InputError, match="no basis 'spline'"):
        fit_btf(btf, Settings(basis="spline"))
    with pytest.raises(InputError, match="no reflectance model 'felt'"):
        fit_btf(btf, Settings(models=("felt",)))
    with pytest.raises(InputError, match="hardly any light"):
        fit_btf(btf, QUICK, np.ones(len(btf.lights), np.bool_))
    with pytest.raises(InputError, match="cannot be held back"):
        lights_held(btf, 1.5)
