"""Harmonics: orthonormal, turned as the functions are, and the lobes that irradiance is made with."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.special import sph_harm_y

from studio_core.scene.transform import axis_angle, rotation_matrix
from studio_plugins.interreflection.fields.harmonics import (
    MOST_BANDS,
    cosine_lobe,
    harmonics_of,
    rotations,
)


def directions(count, seed=0):
    made = np.random.default_rng(seed).normal(size=(count, 3))
    return made / np.linalg.norm(made, axis=1, keepdims=True)


def test_they_are_those_of_scipy():
    towards = directions(50)
    made = harmonics_of(towards, MOST_BANDS)
    theta, phi = np.arccos(towards[:, 2]), np.arctan2(towards[:, 1], towards[:, 0])
    for band in range(MOST_BANDS):
        for m in range(-band, band + 1):
            known = sph_harm_y(band, abs(m), theta, phi) * (-1) ** m
            part = known.real if m >= 0 else known.imag
            expected = part * (np.sqrt(2) if m else 1)
            np.testing.assert_allclose(made[:, band * band + band + m], expected, atol=1e-12)


@given(st.integers(1, 6), st.integers(0, 2**31), st.floats(0, 360))
def test_turned_coefficients_are_those_of_the_turned_function(bands, seed, degrees):
    rng = np.random.default_rng(seed)
    turn = rotation_matrix(axis_angle(rng.normal(size=3) + 1e-3, degrees))
    coefficients = rng.normal(size=bands * bands)
    towards = directions(20, seed % 1000)
    moved = rotations([turn], bands)[0] @ coefficients
    np.testing.assert_allclose(
        harmonics_of(towards, bands) @ moved, harmonics_of(towards @ turn, bands) @ coefficients, atol=1e-9
    )


def test_irradiance_of_a_band_is_its_factor():
    """Even light gives π; a lobe along the normal what integrating it gives."""
    z, weight = np.polynomial.legendre.leggauss(40)
    z, weight = (z + 1) / 2, weight / 2
    for band in range(MOST_BANDS):
        along = harmonics_of(np.stack([np.sqrt(1 - z * z), 0 * z, z], axis=1), MOST_BANDS)
        middle = band * band + band
        integral = 2 * np.pi * (weight * along[:, middle] * z).sum()
        top = harmonics_of([(0, 0, 1)], MOST_BANDS)[0, middle]
        assert integral == pytest.approx(cosine_lobe(MOST_BANDS)[middle] * top, abs=1e-9)


def test_so_many_bands_are_refused():
    with pytest.raises(ValueError, match="bands"):
        harmonics_of([(0, 0, 1)], MOST_BANDS + 1)
