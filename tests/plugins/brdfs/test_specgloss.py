"""Colour and shine: between matte paint, plastic and metal nothing jumps and no light is made."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from studio_core.brdfs.albedo import quadrature_albedo
from studio_core.brdfs.promises import seen_from
from studio_core.params import defaults
from studio_plugins.brdfs.specgloss import MODEL, Params

ANGLES = seen_from(np.radians([0, 40, 70, 85, 89]))
share = st.one_of(st.sampled_from([0.0, 0.01, 0.02, 1.0]), st.floats(0, 1))
colour = st.tuples(share, share, share)
KERNELS = {
    rough: quadrature_albedo(MODEL, MODEL.shape({"roughness": rough}), ANGLES, 1e-5)
    for rough in (0.1, 0.5, 1.0)
}


def coefficients(**values: object) -> Any:
    return MODEL.coefficients({k: np.asarray(v, np.float32) for k, v in values.items()})


@settings(max_examples=300, deadline=None)
@given(rough=st.sampled_from(list(KERNELS)), diffuse=colour, specular=colour)
def test_any_two_colours_return_no_more_than_arrives(rough, diffuse, specular) -> None:
    made = KERNELS[rough] @ coefficients(diffuse=diffuse, specular=specular)
    assert made.max() <= 1.001
    assert made.min() >= 0


@pytest.mark.parametrize("rough", KERNELS)
@pytest.mark.parametrize("f0", [0.0, 0.02, 0.04, 0.3, 1.0])
def test_white_returns_all(rough, f0) -> None:
    made = KERNELS[rough] @ coefficients(diffuse=(1.0, 1.0, 1.0), specular=(f0, f0, f0))
    np.testing.assert_allclose(made, 1.0, atol=1e-3)


@pytest.mark.parametrize("f0", [0.001, 0.01, 0.019])
def test_white_that_hardly_shines_returns_nearly_all(f0) -> None:
    made = KERNELS[0.5] @ coefficients(diffuse=(1.0, 1.0, 1.0), specular=(f0, f0, f0))
    assert made.min() > 0.994


def test_the_shine_comes_without_a_jump() -> None:
    f0 = np.linspace(0, 0.05, 501)[:, None] * np.ones(3)
    made = coefficients(diffuse=np.full((501, 3), 0.6), specular=f0)
    assert np.abs(np.diff(made, axis=0)).max() < 0.01
    np.testing.assert_allclose(made[0, 4], 0.6 / np.pi, rtol=1e-6)
    assert not made[0, :4].any()


def test_colours_do_not_depend_on_the_roughness() -> None:
    look = {k: v for k, v in defaults(Params).items() if k != "keep_energy"}
    np.testing.assert_array_equal(
        coefficients(**{**look, "roughness": 0.1}), coefficients(**{**look, "roughness": 0.9})
    )
