"""Black bodies: luminance one, and the colours of published tables."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from studio_core.colour import kelvin, luminance


def planck(temperature: float) -> tuple[float, float]:
    """CIE 1931 chromaticity of a black body from Planck's law.

    Colour matching functions by Wyman, Sloan and Shirley 2013, equations 2 (multi-lobe fits).
    """
    nm = np.arange(360.0, 831.0, 1.0)

    def lobe(centre: float, left: float, right: float) -> np.ndarray:
        return np.exp(-0.5 * ((nm - centre) * np.where(nm < centre, left, right)) ** 2)

    x = 1.056 * lobe(599.8, 1 / 37.9, 1 / 31.0)
    x += 0.362 * lobe(442.0, 1 / 16.0, 1 / 26.7) - 0.065 * lobe(501.1, 1 / 20.4, 1 / 26.2)
    y = 0.821 * lobe(568.8, 1 / 46.9, 1 / 40.5) + 0.286 * lobe(530.9, 1 / 16.3, 1 / 31.1)
    z = 1.217 * lobe(437.0, 1 / 11.8, 1 / 36.0) + 0.681 * lobe(459.0, 1 / 26.0, 1 / 13.8)
    metres = nm * 1e-9
    power = metres**-5 / np.expm1(1.438776877e-2 / (metres * temperature))
    xyz = np.array([power @ x, power @ y, power @ z])
    return float(xyz[0] / xyz.sum()), float(xyz[1] / xyz.sum())


@given(st.floats(0, 1e5))
def test_every_temperature_has_luminance_one_and_no_negative_light(temperature: float) -> None:
    rgb = kelvin(temperature)
    assert luminance(rgb) == pytest.approx(1, abs=1e-12)
    assert min(rgb) >= 0
    assert np.isfinite(rgb).all()


@given(st.floats(1700, 25000), st.floats(1700, 25000))
def test_hotter_is_bluer(one: float, other: float) -> None:
    low, high = sorted((one, other))
    if high - low < 1:
        return
    cool, hot = kelvin(low), kelvin(high)
    assert cool[0] >= hot[0] - 1e-9
    assert cool[2] <= hot[2] + 1e-9


@pytest.mark.parametrize("temperature", [2500.0, 3000.0, 4000.0, 5000.0, 6500.0, 9300.0, 15000.0])
def test_chromaticity_is_that_of_plancks_law(temperature: float) -> None:
    to_xyz = np.array(
        [
            [0.4124564, 0.3575761, 0.1804375],
            [0.2126729, 0.7151522, 0.0721750],
            [0.0193339, 0.1191920, 0.9503041],
        ]
    )
    xyz = to_xyz @ np.array(kelvin(temperature))
    assert (xyz[0] / xyz.sum(), xyz[1] / xyz.sum()) == pytest.approx(planck(temperature), abs=4e-3)


def test_daylight_is_nearly_white() -> None:
    assert kelvin(6504.0) == pytest.approx((1, 1, 1), abs=0.06)
