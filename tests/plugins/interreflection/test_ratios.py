"""Ratios that are carried keep sums finite and not negative."""

from __future__ import annotations

from typing import Any

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from studio_plugins.interreflection.gather.ratios import alike, multiply, ratio_of, share_of

SUMS = hnp.arrays(np.float32, (6, 3), elements=st.floats(0, 100, width=32))
SHARES = hnp.arrays(np.float32, 6, elements=st.floats(0, 1, width=32))


@given(SUMS, SUMS, SUMS, SHARES)
def test_sums_stay_finite_and_none_becomes_negative(rough: Any, fine: Any, now: Any, share: Any) -> None:
    made, ratio = now.copy(), ratio_of(fine, rough)
    every = np.arange(6)
    multiply(every, every.astype(np.int32), share, ratio[:, None], made[:, None])
    np.testing.assert_allclose(made, now * (1 + share[:, None] * (ratio - 1)), rtol=1e-5)
    assert np.isfinite(made).all()
    assert (made >= 0).all()
    assert (made <= 2.001 * now).all()


@given(SHARES, SHARES)
def test_the_share_that_is_carried_grows_with_both_likenesses(likeness: Any, alike: Any) -> None:
    made = share_of(likeness, alike)
    assert (made >= 0).all()
    assert (made <= likeness**2 + 1e-6).all()
    np.testing.assert_allclose(share_of(likeness, np.ones(6, np.float32)), likeness**2, rtol=1e-5)
    more = share_of(likeness, np.minimum(alike + np.float32(0.1), 1))
    assert (more >= made - 1e-6).all()
    lit = alike > 1e-3
    np.testing.assert_allclose(share_of(np.ones(6, np.float32), alike)[lit], 1, rtol=1e-4)


def test_levels_are_alike_by_their_ratio() -> None:
    one, other = np.array([1, 2, 0, 0, 4], np.float32), np.array([2, 1, 0, 3, 4], np.float32)
    np.testing.assert_allclose(alike(one, other), [0.5, 0.5, 0, 0, 1])


def test_nothing_found_roughly_is_left_alone() -> None:
    made = ratio_of(np.array([1, 0, 5, 1], np.float32), np.array([0, 0, 1, 2], np.float32))
    np.testing.assert_allclose(made, [1, 1, 2, 0.5])
