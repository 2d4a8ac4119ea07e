"""Moments of equation 3 for many elements and all gloss levels at once, without making any column.

A column S_g is K_g diag(w) L around the normal's frequencies (`lobes`), so C_22 = Σ w S_g² is a sum of
products of two rings' series of the incident light L with a symmetric matrix of numbers that only the level
knows (Parseval); so is d_2 = Σ w S_g b, because lobes are reciprocal and sums go by projected angle, and with
the products of L's and b's series. Products are made once for all levels. C_12 and d_1 need only what does
not turn, as the matte column D is the same in all directions.
"""

from __future__ import annotations

import functools
import math
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from studio_core.jit import kernel
from studio_core.transport.cells import RINGS
from studio_plugins.slf.ladder import LEVELS
from studio_plugins.slf.lobes import FREQUENCIES, cell_weights, spectra
from studio_plugins.slf.paper import Systems
from studio_plugins.slf.series import WIDTH, matte_of, shares

F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]
I64 = npt.NDArray[np.int64]

COLOURS = 3
RANK = 16
"""Sums of products that all levels are made of, within 1e-6: neighbouring levels are alike."""
BLOCKS = (0, 8, 12, 14, 16)
"""Rings whose products are made together: few enough for the first cache."""
MOST = 42  # pairs of rings in a block


def moments(light: F32, target: F32, now: F64, level: I64) -> Systems:
    """Of N elements, one row a colour.

    light, target (N, COLOURS, RINGS, WIDTH) are series of the incident and of the wanted light; now (N,
    COLOURS, 2) the reflectance, level (N,) the gloss.
    """
    rows = len(light) * COLOURS
    squares, crosses = np.zeros((rows, RANK)), np.zeros((rows, RANK))
    first, second = light.reshape(rows, RINGS, WIDTH), target.reshape(rows, RINGS, WIDTH)
    to_squares, to_crosses, levels, others, to_sums, each = _tables()
    multiply(first, second, to_squares, to_crosses, squares, crosses)
    d = matte_of(first)
    return Systems(
        c11=math.pi * d * d,
        c12=d[:, None] * (first[:, :, 0].astype(np.float64) @ to_sums),
        c22=np.maximum(squares @ levels, 0),
        d1=d * (second[:, :, 0].astype(np.float64) @ cell_weights()),
        d2=crosses @ others,
        bb=np.einsum("nim,nim,im->n", second, second, each),
        now=now.reshape(rows, 2),
        level=np.asarray(level, np.int64),
        channels=COLOURS,
    )


@functools.cache
def _tables() -> tuple[F32, F32, F64, F64, F64, F32]:
    """Factors of products that lead to C_22 and to d_2 (see `multiply`), (RANK, LEVELS) from sums to levels.

    Then (RINGS, LEVELS) from what does not turn to Σ w S, and (RINGS, WIDTH) what squares of series count.
    """
    w = cell_weights()
    first = w[:, None] * spectra() * w
    second = np.einsum("lmik,k,lmkj->lmij", first, 1 / w, first)
    each = np.outer(w, np.tile(shares(), 2)).astype(np.float32)
    (to_squares, levels), (to_crosses, others) = _factors(second), _factors(first)
    return to_squares, to_crosses, levels, others, first[:, 0].sum(axis=1).T, each


def _factors(matrices: F64) -> tuple[F32, F64]:
    """Of symmetric (LEVELS, FREQUENCIES, RINGS, RINGS): factors (blocks, RANK, MOST · FREQUENCIES)."""
    i, j = np.tril_indices(RINGS)
    whole = (matrices[:, :, i, j] * shares()[:, None] * np.where(i == j, 1, 2)).swapaxes(1, 2)
    scale = np.sqrt((whole**2).sum(axis=(1, 2)))
    u, s, v = np.linalg.svd((whole / scale[:, None, None]).reshape(LEVELS, -1), full_matrices=False)
    kept = v[:RANK].reshape(RANK, len(i), FREQUENCIES)
    made = np.zeros((len(BLOCKS) - 1, RANK, MOST, FREQUENCIES), np.float32)
    for block, (low, high) in enumerate(pairwise(BLOCKS)):
        own = kept[:, (i >= low) & (i < high)]
        made[block, :, : own.shape[1]] = own
    return made.reshape(*made.shape[:2], -1), (u[:, :RANK] * s[:RANK] * scale[:, None]).T


@kernel
def multiply(first: F32, second: F32, to_squares: F32, to_crosses: F32, squares: F64, crosses: F64) -> None:
    """squares, crosses (R, RANK): sums of products of series first, second (R, RINGS, WIDTH), R by COLOURS.

    Products are those of the rings of a block with all up to themselves, real parts of one times the other's
    conjugate, crosses the mean of both ways round. (Indices that might be negative are no vector code.)
    """
    count = first.shape[2] // 2
    own, mixed = (
        np.empty((COLOURS, MOST, count), np.float32),
        np.empty((COLOURS, MOST, count), np.float32),
    )
    flat, flat_mixed = own.reshape(COLOURS, -1), mixed.reshape(COLOURS, -1)
    for start in range(0, len(first), COLOURS):
        for block in range(len(BLOCKS) - 1):
            pair = 0
            for i in range(BLOCKS[block], BLOCKS[block + 1]):
                for j in range(i + 1):
                    for k in range(COLOURS):
                        n = start + k
                        for m in range(count):
                            a, b = first[n, i, m], first[n, i, count + m]
                            c, d = first[n, j, m], first[n, j, count + m]
                            own[k, pair, m] = a * c + b * d
                            mixed[k, pair, m] = np.float32(0.5) * (
                                a * second[n, j, m]
                                + b * second[n, j, count + m]
                                + c * second[n, i, m]
                                + d * second[n, i, count + m]
                            )
                    pair += 1
            for at in range(0, RANK, 4):
                _add_sums(flat, to_squares, block, pair * count, start, at, squares)
                _add_sums(flat_mixed, to_crosses, block, pair * count, start, at, crosses)


@kernel(inline="always")
def _add_sums(products: F32, factors: F32, block: int, length: int, row: int, at: int, out: F64) -> None:
    """Four sums of three colours at a time, which stay in registers."""
    a, b, c, d = np.float32(0), np.float32(0), np.float32(0), np.float32(0)
    e, f, g, h = np.float32(0), np.float32(0), np.float32(0), np.float32(0)
    i, j, k, m = np.float32(0), np.float32(0), np.float32(0), np.float32(0)
    for q in range(length):
        x, y, z = products[0, q], products[1, q], products[2, q]
        s, t = factors[block, at, q], factors[block, at + 1, q]
        u, v = factors[block, at + 2, q], factors[block, at + 3, q]
        a, b, c, d = a + s * x, b + t * x, c + u * x, d + v * x
        e, f, g, h = e + s * y, f + t * y, g + u * y, h + v * y
        i, j, k, m = i + s * z, j + t * z, k + u * z, m + v * z
    out[row, at] += a
    out[row, at + 1] += b
    out[row, at + 2] += c
    out[row, at + 3] += d
    out[row + 1, at] += e
    out[row + 1, at + 1] += f
    out[row + 1, at + 2] += g
    out[row + 1, at + 3] += h
    out[row + 2, at] += i
    out[row + 2, at + 1] += j
    out[row + 2, at + 2] += k
    out[row + 2, at + 3] += m


__all__ = ["COLOURS", "moments"]
