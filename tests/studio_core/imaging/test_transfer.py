"""sRGB and primaries against published numbers."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from studio_core.imaging.transfer import REC709, linear_to_srgb, rgb_to_xyz, srgb_to_linear, to_rec709

ACES_AP0 = (0.7347, 0.2653, 0.0, 1.0, 0.0001, -0.0770, 0.32168, 0.33767)


def test_every_byte_survives_the_way_to_light_and_back() -> None:
    every = np.arange(256, dtype=np.uint8)
    light = srgb_to_linear(every)
    assert light[0] == 0
    assert light[255] == 1
    np.testing.assert_allclose(light[[10, 128]], [0.0030353, 0.2158605], rtol=1e-5)
    np.testing.assert_array_equal(linear_to_srgb(light), every)


def test_rec709_matrix_is_the_published_one() -> None:
    published = [[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]]
    np.testing.assert_allclose(rgb_to_xyz(REC709), published, atol=1e-4)
    np.testing.assert_allclose(to_rec709(REC709), np.eye(3), atol=1e-12)


def test_aces_primaries_give_the_published_matrix() -> None:
    published = [
        [2.52169, -1.13413, -0.38756],
        [-0.27648, 1.37272, -0.09624],
        [-0.01538, -0.15298, 1.16835],
    ]
    np.testing.assert_allclose(to_rec709(ACES_AP0), published, atol=1e-4)


@given(st.lists(st.floats(-1, 2), min_size=8, max_size=8))
def test_any_chromaticities_keep_white_or_are_refused(chromaticities: list[float]) -> None:
    try:
        matrix = to_rec709(chromaticities)
    except ValueError:
        return
    if np.linalg.cond(rgb_to_xyz(chromaticities)) < 1e4:
        np.testing.assert_allclose(matrix @ np.ones(3), np.ones(3), atol=1e-6)


def test_xyz_is_colorimetric() -> None:
    matrix = to_rec709((1, 0, 0, 1, 0, 0, 1 / 3, 1 / 3))
    np.testing.assert_allclose(matrix @ [0.9505, 1.0, 1.0890], np.ones(3), atol=1e-3)  # D65
    with pytest.raises(ValueError, match="line"):
        to_rec709((0.1, 0.1, 0.2, 0.2, 0.3, 0.3, 0.3, 0.3))
