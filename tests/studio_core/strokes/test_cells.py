"""Cells of pixels against the same in NumPy, and what every cut promises."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from studio_core.strokes.cells import ALIKE, PASSES, Pixels, cells_of, cut


def pixels(seed, count, groups, folded):
    rng = np.random.default_rng(seed)
    at = rng.permutation(30 * 40)[:count]
    x, y = at % 40, at // 40
    place = np.stack([x * 0.01, y * 0.01, 0 * x], axis=1).astype(np.float32)
    normal = np.tile(np.array([0, 0, 1], np.float32), (count, 1))
    if folded:
        some = rng.random(count) < 0.4
        normal[some] = (1, 0, 0)
        place[rng.random(count) < 0.3, 2] += 5
    share = rng.uniform(0.05, 1, count)
    wide = np.full(count, 0.01, np.float32)
    return Pixels(x, y, rng.integers(0, groups, count), share, place, normal, wide)


def slow_cut(p, size):
    """The same cells with arrays; sets of pixels by their middle."""
    row = (p.y / size).astype(int)
    column = (p.x / size + 0.5 * (row % 2)).astype(int)
    made, left = {}, np.arange(len(p))
    for turn in range(PASSES):
        rest = []
        for cell in sorted({(p.group[i], row[i], column[i]) for i in left}):
            own = np.array([i for i in left if (p.group[i], row[i], column[i]) == cell])
            mean = [np.average(axis[own], weights=p.share[own]) for axis in (p.x, p.y)]
            middle = own[np.argmin(np.round((p.x[own] - mean[0]) ** 2 + (p.y[own] - mean[1]) ** 2, 8))]
            alike = p.normal[own] @ p.normal[middle] > ALIKE
            height = np.abs((p.place[own] - p.place[middle]) @ p.normal[middle])
            close = (alike & (height <= size * p.wide[middle])) | (own == middle) | (turn == PASSES - 1)
            made[int(middle)] = set(own[close].tolist())
            rest += own[~close].tolist()
        left = np.array(sorted(rest), int)
    return made


@given(
    st.integers(0, 2**20),
    st.integers(1, 300),
    st.integers(1, 3),
    st.booleans(),
    st.sampled_from([1, 2.5, 7, 60]),
)
def test_cells_are_those_of_the_slow_way(seed, count, groups, folded, size):
    p = pixels(seed, count, groups, folded)
    label, chosen = np.empty(count, np.int64), np.empty(count, np.int64)
    held = (p.x, p.y, p.group, p.share, p.place, p.normal, p.wide)
    grid = (int(p.x.max() / size + 0.5) + 1, int(p.y.max() / size) + 1)
    found = cut(float(size), *grid, groups, count, *held, label, chosen)
    made = {int(chosen[n]): set(np.flatnonzero(label == n).tolist()) for n in range(found)}
    assert made == slow_cut(p, size)
    if found > 1:
        assert cut(float(size), *grid, groups, found - 1, *held, label, chosen) == -1


@given(st.integers(0, 2**20), st.integers(1, 900), st.integers(1, 9), st.booleans(), st.integers(1, 200))
def test_cells_are_no_more_than_asked_for_and_of_one_surface(seed, count, groups, folded, limit):
    p = pixels(seed, count, groups, folded)
    label, chosen = cells_of(p, limit)
    assert 1 <= len(chosen) <= limit
    assert len(np.unique(chosen)) == len(chosen)
    np.testing.assert_array_equal(label[chosen], np.arange(len(chosen)))
    kept = label >= 0
    assert (p.group[kept] == p.group[chosen[label[kept]]]).all()
    if limit >= PASSES * groups:
        assert kept.all()
    if limit >= count and not folded:
        assert len(chosen) == count
