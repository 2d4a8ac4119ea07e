"""Tables of hits: numbers as float16 has them, and means over rays."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from studio_core.transport.hits import BLACK, NOTHING, HitTable, gather_matte, half_bits, half_value


@given(st.floats(0, 1e6, width=32))
def test_distances_are_rounded_as_numpy_does(value: float) -> None:
    word = np.zeros(1, np.uint32)
    number = word.view(np.float32)
    with np.errstate(over="ignore"):
        expected = np.float32(value).astype(np.float16)
    bits = half_bits(np.float32(value), word, number)
    assert bits == expected.view(np.uint16)
    assert half_value(bits, word, number) == np.float32(expected)


def test_infinity_stays() -> None:
    word = np.zeros(1, np.uint32)
    number = word.view(np.float32)
    assert np.uint16(half_bits(np.float32(np.inf), word, number)).view(np.float16) == np.inf
    assert half_value(int(np.float16(np.inf).view(np.uint16)), word, number) == np.inf


def test_a_gather_is_the_mean_over_rays() -> None:
    rng = np.random.default_rng(2)
    radiance = rng.random((50, 3)).astype(np.float32)
    table = HitTable.empty(9, 32)
    table.vertex[:] = rng.integers(0, 50, (9, 32))
    table.vertex[rng.random((9, 32)) < 0.2] = NOTHING
    table.vertex[rng.random((9, 32)) < 0.1] = BLACK
    out = np.full((9, 3), 7.0, np.float32)
    rows = np.array([8, 1, 4, 0], np.int64)
    gather_matte(1, 4, rows, table.vertex, radiance, out)
    expected = np.full((9, 3), 7.0)
    for row in rows[1:]:
        total = np.zeros(3)
        for vertex in table.vertex[row]:
            if vertex < 50:
                total += radiance[vertex]
        expected[row] = total / 32
    np.testing.assert_allclose(out, expected, rtol=1e-5)
    assert table.nbytes == 9 * 32 * 8
