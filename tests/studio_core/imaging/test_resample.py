"""Area filtering against block means."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from studio_core.imaging.resample import known_means, resize_area, thumbnail_size
from studio_core.imaging.transfer import linear_to_srgb, srgb_to_linear


@given(st.integers(1, 6), st.integers(1, 6), st.integers(1, 5), st.integers(1, 5), st.sampled_from([1, 3, 4]))
def test_whole_factors_are_block_means(rows: int, columns: int, fy: int, fx: int, channels: int) -> None:
    pixels = np.random.default_rng(rows).random((rows * fy, columns * fx, channels)).astype(np.float32)
    blocks = pixels.reshape(rows, fy, columns, fx, channels).mean(axis=(1, 3))
    np.testing.assert_allclose(resize_area(pixels, rows, columns), blocks, rtol=1e-5)


def test_any_shrinking_keeps_the_mean() -> None:
    pixels = np.random.default_rng(1).random((31, 45, 3)).astype(np.float32)
    np.testing.assert_allclose(resize_area(pixels, 7, 11).mean(), pixels.mean(), rtol=1e-4)


def test_means_over_what_is_known() -> None:
    pixels = np.random.default_rng(2).random((12, 20, 3)).astype(np.float32)
    known = np.random.default_rng(3).random((12, 20)) > 0.6
    known[:4, :5] = False
    pixels[~known] = np.nan
    means, share = known_means(pixels, known, 3, 4)
    for row in range(3):
        for column in range(4):
            block = np.s_[4 * row : 4 * row + 4, 5 * column : 5 * column + 5]
            there = pixels[block][known[block]]
            np.testing.assert_allclose(share[row, column], len(there) / 20, rtol=1e-5)
            np.testing.assert_allclose(means[row, column], there.mean(axis=0) if len(there) else 0, rtol=1e-4)


def test_bytes_are_averaged_as_light() -> None:
    board = np.zeros((2, 2, 4), np.uint8)
    board[0, 0] = board[1, 1] = 255
    made = resize_area(board, 1, 1)
    assert made.dtype == np.uint8
    half = linear_to_srgb(np.array([0.5]))[0]
    np.testing.assert_array_equal(made[0, 0, :3], half)
    assert made[0, 0, 3] in (127, 128)
    assert srgb_to_linear(np.array([half]))[0] > 0.49


def test_thumbnails_fit_and_are_never_enlarged() -> None:
    assert thumbnail_size(400, 800, 200) == (100, 200)
    assert thumbnail_size(40, 80, 200) == (40, 80)
    assert thumbnail_size(1, 5000, 100) == (1, 100)
