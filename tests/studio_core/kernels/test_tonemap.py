from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from oracles import tonemap as oracle

from studio_core.kernels.tonemap import KINDS, LABELS, THUMBNAIL, tonemap

light = hnp.arrays(
    np.float32, (2, 3, 3), elements=st.floats(0, 2.0**17, width=32) | st.floats(0, 1, width=32)
)


@given(light, st.integers(-8, 8), st.sampled_from(KINDS))
def test_tonemap_agrees_with_the_oracle(linear: np.ndarray, exposure: int, kind: str) -> None:
    made = tonemap(linear, exposure, kind)
    assert made.dtype == np.uint8
    assert made.shape == linear.shape
    assert np.abs(made - oracle.tonemap(linear, exposure, kind)).max() <= 0.6


@given(light, st.sampled_from(KINDS))
def test_more_exposure_is_never_darker_for_greys(linear: np.ndarray, kind: str) -> None:
    grey = np.repeat(linear[..., :1], 3, axis=-1)
    assert (tonemap(grey, 1.0, kind) >= tonemap(grey, 0.0, kind)).all()


@pytest.mark.parametrize("kind", KINDS)
def test_what_is_no_light_is_black_and_what_has_no_bound_is_white(kind: str) -> None:
    odd = np.array([[[np.nan] * 3, [-1.0] * 3, [np.inf] * 3]], np.float32)
    assert tonemap(odd, 0.0, kind)[0].tolist() == [[0] * 3, [0] * 3, [255] * 3]


def test_colour_true_is_the_display_standard() -> None:
    half = np.full((1, 1, 3), 0.21404114, np.float32)
    assert tonemap(half)[0, 0].tolist() == [128, 128, 128] or tonemap(half)[0, 0].tolist() == [127, 127, 127]
    assert tonemap(half, kind="raw")[0, 0].tolist() == [55, 55, 55]


def test_large_pictures_are_done_block_by_block() -> None:
    linear = np.random.default_rng(1).random((150, 151, 3), np.float32)
    whole = tonemap(linear, 0.5, "filmic")
    rows = np.concatenate([tonemap(row[None], 0.5, "filmic") for row in linear])
    assert np.abs(whole.astype(int) - rows).max() <= 1
    assert set(LABELS) == set(KINDS)


@pytest.mark.parametrize("kind", KINDS)
def test_pictures_of_a_screen_look_like_thumbnails(kind: str) -> None:
    rng = np.random.default_rng(2)
    linear = (2.0 ** rng.uniform(-20, 8, (300, 301, 3))).astype(np.float32)
    odd = [[np.nan] * 3, [-1.0] * 3, [np.inf] * 3, [1e30] * 3, [0.0] * 3, [np.nan, 0.5, np.inf], [1.0] * 3]
    linear[7, 50 : 50 + len(odd)] = odd
    assert linear.size // 3 > THUMBNAIL
    whole = tonemap(linear, 0.5, kind)
    rows = np.concatenate([tonemap(row[None], 0.5, kind) for row in linear])
    difference = np.abs(whole.astype(int) - rows)
    assert difference.max() <= 1
    assert (difference > 0).mean() < 1e-3
    np.testing.assert_array_equal(whole[7, 50 : 50 + len(odd)], rows[7, 50 : 50 + len(odd)])


def test_unknown_views_are_refused() -> None:
    with pytest.raises(ValueError, match="there is no view 'x'"):
        tonemap(np.zeros((1, 1, 3), np.float32), 0.0, "x")
