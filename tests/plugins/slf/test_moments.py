"""Moments by products of series against columns that are made; series there and back."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from studio_core.transport.cells import PARTS, RINGS
from studio_plugins.slf.ladder import LEVELS
from studio_plugins.slf.lobes import cell_weights, spectra
from studio_plugins.slf.mixed import choose_all
from studio_plugins.slf.moments import moments
from studio_plugins.slf.series import convolve, half_kernels, half_level, light_of, series_of

W = np.repeat(cell_weights()[:, None], PARTS, 1)


def column(level, light):
    """(…, RINGS, PARTS) S of a whole level, in float64."""
    series = np.fft.rfft(light.astype(np.float64), axis=-1) * cell_weights()[:, None]
    return np.fft.irfft(np.einsum("mij,...jm->...im", spectra()[level], series), PARTS, axis=-1)


def matte(light):
    return (light * W).sum(axis=(2, 3), dtype=np.float64) / math.pi


def lit(rng, count, power=4):
    return (rng.uniform(0, 1, (count, 3, RINGS, PARTS)) ** power).astype(np.float32)


def test_series_lead_back_to_the_light():
    light = lit(np.random.default_rng(0), 3)
    assert np.allclose(light_of(series_of(light)), light, atol=2e-6)


def test_moments_are_those_of_the_columns():
    rng = np.random.default_rng(1)
    light, wanted = lit(rng, 4), lit(rng, 4, 2)
    one = moments(series_of(light), series_of(wanted), np.zeros((4, 3, 2)), np.zeros(4, np.int64))
    d = matte(light).ravel()
    assert np.allclose(one.c11, (W * np.ones_like(light)).sum(axis=(2, 3)).ravel() * d**2, rtol=1e-6)
    assert np.allclose(one.d1, d * (W * wanted).sum(axis=(2, 3)).ravel(), rtol=1e-5)
    assert np.allclose(one.bb, (W * wanted**2).sum(axis=(2, 3)).ravel(), rtol=1e-5)
    for level in range(LEVELS):
        s = column(level, light)
        assert np.allclose(one.c12[:, level], d * (W * s).sum(axis=(2, 3)).ravel(), rtol=1e-5)
        assert np.allclose(one.c22[:, level], (W * s**2).sum(axis=(2, 3)).ravel(), rtol=1e-5)
        assert np.allclose(one.d2[:, level], (W * s * wanted).sum(axis=(2, 3)).ravel(), rtol=1e-5)


@pytest.mark.parametrize("level", [0, 7, 19])
def test_convolution_makes_the_column(level):
    light = lit(np.random.default_rng(2), 2)
    series = series_of(light)
    out = np.empty_like(series)
    convolve(series, half_kernels(), half_level(np.full(2, level)), out)
    assert np.allclose(light_of(out), column(level, light), atol=1e-5)


@settings(max_examples=20, deadline=None)
@given(st.integers(0, LEVELS - 1), st.floats(0, 0.6), st.floats(0.05, 0.4), st.integers(0, 2**31))
def test_what_a_reflectance_sends_is_explained_by_it(level, d, s, seed):
    light = lit(np.random.default_rng(seed), 1, 6)
    wanted = d * matte(light)[..., None, None] + s * column(level, light)
    now = np.broadcast_to([0.1, 0.02], (1, 3, 2))
    one = moments(series_of(light), series_of(wanted.astype(np.float32)), now, np.array([3]))
    made = choose_all(one, "l2")
    assert abs(made.level[0] - level) <= 1
    assert made.residual[0] <= 1e-5 * one.bb.sum()
