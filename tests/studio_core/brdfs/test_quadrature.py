from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from studio_core.brdfs.quadrature import MirrorFrame, grid, over_boxes, over_hemisphere


def seen_from(degrees: float, azimuth: float = 0.3) -> np.ndarray:
    theta = np.radians(degrees)
    return np.array([np.sin(theta) * np.cos(azimuth), np.sin(theta) * np.sin(azimuth), np.cos(theta)])


@pytest.mark.parametrize("degrees", [0, 1e-4, 30, 75, 89, 89.9])
def test_the_hemisphere_is_whole(degrees: float) -> None:
    made = over_hemisphere(lambda _, wi: np.stack([wi[:, 2] * 0 + 1, wi[:, 2]], 1), seen_from(degrees), 1e-5)
    np.testing.assert_allclose(made[0], [2 * np.pi, np.pi], rtol=1e-4)


def test_what_is_odd_or_never_settles_ends() -> None:
    """A relative tolerance is of |f|: what sums to nothing is not refined for ever."""
    asked = [0]

    def odd(_: int, wi: np.ndarray) -> np.ndarray:
        asked[0] += len(wi)
        return np.stack([wi[:, 1], np.abs(wi[:, 0])], axis=1)

    made = over_hemisphere(odd, [seen_from(40.0, 0.0)], 1e-4, 0.1)[0]
    np.testing.assert_allclose(made, [0, np.pi], atol=1e-3)
    assert asked[0] < 100_000
    rng = np.random.default_rng(0)
    rough = over_hemisphere(lambda _, wi: rng.random((len(wi), 1)), [seen_from(40.0)], 1e-9)[0, 0]
    assert rough == pytest.approx(np.pi, rel=0.05)


@pytest.mark.parametrize("degrees", [0, 40, 80])
@pytest.mark.parametrize("exponent", [1.0, 1e2, 1e4, 1e6])
def test_sharp_lobes_are_found(degrees: float, exponent: float) -> None:
    wo = seen_from(degrees)
    mirror = wo * [-1, -1, 1]

    def lobe(_: int, wi: np.ndarray) -> np.ndarray:
        away = ((wi - mirror) ** 2).sum(axis=1, keepdims=True)
        return np.exp(-exponent * away / 2)

    # Over the whole sphere: 2π/κ (1 − e^(−2κ)); seen from the side a wide one loses what is below.
    made = over_hemisphere(lobe, wo, 1e-6 / exponent)[0, 0]
    whole = 2 * np.pi / exponent * -np.expm1(-2 * exponent)
    if exponent >= 1e3 or degrees == 0:
        below = np.exp(-exponent) * 2 * np.pi / exponent * -np.expm1(-exponent) if degrees == 0 else 0.0
        assert made == pytest.approx(whole - below, rel=1e-3)
    else:
        assert 0 < made < whole * (1 + 1e-6)


@given(degrees=st.floats(0, 80), azimuth=st.floats(-7, 7), s=st.floats(0.4, 1), phi=st.floats(0, 6.28))
def test_places_lead_back(degrees: float, azimuth: float, s: float, phi: float) -> None:
    frame = MirrorFrame.of(seen_from(degrees, azimuth))
    row = np.zeros(1, np.int64)
    wi, measure = frame.directions(row, np.array([s]), np.array([phi]))
    assert measure[0] > 0
    assert wi[0, 2] > -1e-6
    assert np.linalg.norm(wi[0]) == pytest.approx(1)
    back, turn = frame.place(0, wi)
    assert back[0] == pytest.approx(s, abs=2e-3)  # directions are float32
    assert np.cos(turn[0] - phi) == pytest.approx(1, abs=1e-4)


def test_boxes_add_up() -> None:
    wo = seen_from(60)
    low, size = grid(10, 8)
    boxes = over_boxes(lambda _, wi: wi[:, 2:] ** 2, wo, np.zeros(80, np.int64), low, size, 1e-6)
    assert boxes.shape == (80, 1)
    assert (boxes > 0).all()
    assert boxes.sum() == pytest.approx(2 * np.pi / 3, rel=1e-4)
