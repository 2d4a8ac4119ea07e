"""Moments of equation 3 for many elements and all gloss levels at once, without making any column.

A column S_g is K_g diag(w) L around the normal's frequencies (`lobes`), so C_22 = Σ w S_g² is a sum of
products of two rings' series of the incident light L with a symmetric matrix of numbers that only the level
knows (Parseval); so is d_2 = Σ w S_g b, because lobes are reciprocal and sums go by projected angle, and with
the products of L's and b's series. Products are made once for all levels, and one matrix product is left.
C_12 and d_1 need only what does not turn, as the matte column D is the same in all directions.

Series (…, RINGS, 2 · FREQUENCIES) are float32: real parts, then imaginary ones, over the parts of each ring.
"""

from __future__ import annotations

import functools
import math

import numpy as np
import numpy.typing as npt

from studio_core.jit import kernel
from studio_core.transport.cells import PARTS, RINGS
from studio_plugins.slf.ladder import LEVELS
from studio_plugins.slf.lobes import FREQUENCIES, cell_weights, spectra
from studio_plugins.slf.paper import Systems

F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]
I64 = npt.NDArray[np.int64]

WIDTH = 2 * FREQUENCIES
PAIRS = RINGS * (RINGS + 1) // 2
PRODUCTS = PAIRS * FREQUENCIES


@functools.cache
def _to_series() -> F32:
    """(PARTS, WIDTH)."""
    angle = 2 * math.pi / PARTS * np.outer(np.arange(PARTS), np.arange(FREQUENCIES))
    return np.concatenate([np.cos(angle), -np.sin(angle)], axis=1).astype(np.float32)


@functools.cache
def _from_series() -> F32:
    """(WIDTH, PARTS)."""
    shares = np.tile(_shares(), 2)[:, None] * PARTS
    return np.asarray(_to_series().T * shares / PARTS, np.float32)


def _shares() -> F64:
    """(FREQUENCIES,) what squares of a series count in sums over parts (Parseval): twice, but at the ends."""
    made = np.full(FREQUENCIES, 2.0 / PARTS)
    made[0] = made[-1] = 1.0 / PARTS
    return made


def series_of(light: F32) -> F32:
    """(…, RINGS, WIDTH) of light (…, RINGS, PARTS)."""
    return np.asarray(light.reshape(-1, PARTS) @ _to_series()).reshape(*light.shape[:-1], WIDTH)


def light_of(series: F32) -> F32:
    """The inverse of `series_of`."""
    return np.asarray(series.reshape(-1, WIDTH) @ _from_series()).reshape(*series.shape[:-1], PARTS)


@functools.cache
def half_kernels() -> F32:
    """(2 LEVELS − 1, RINGS, RINGS, FREQUENCIES): K diag(w) of levels and of those halfway between two."""
    whole = np.moveaxis(spectra() * cell_weights(), 1, 3)
    made = np.empty((2 * LEVELS - 1, *whole.shape[1:]), np.float32)
    made[::2], made[1::2] = whole, (whole[1:] + whole[:-1]) / 2
    made.setflags(write=False)
    return made


def half_level(level: npt.ArrayLike) -> I64:
    """The row of `half_kernels` next to real levels."""
    return np.asarray(np.clip(np.rint(2 * np.asarray(level)), 0, 2 * LEVELS - 2), np.int64)


@kernel
def convolve(series: F32, kernels: F32, level: I64, out: F32) -> None:
    """out: the series of S_g for series (N, C, RINGS, WIDTH), each of the N at its row of the kernels."""
    count, channels, rings, width = series.shape
    half = width // 2
    for n in range(count):
        own = level[n]
        for c in range(channels):
            for i in range(rings):
                for m in range(width):
                    out[n, c, i, m] = np.float32(0)
                for j in range(rings):
                    for m in range(half):
                        out[n, c, i, m] += kernels[own, i, j, m] * series[n, c, j, m]
                    for m in range(half):
                        out[n, c, i, half + m] += kernels[own, i, j, m] * series[n, c, j, half + m]


@kernel
def multiply(first: F32, second: F32, squares: F32, crosses: F32) -> None:
    """Products of rings' series: (R, PRODUCTS) of first (R, RINGS, WIDTH) with itself and with second.

    Pairs of rings (i, j ≤ i) by row; each the real part of one times the other's conjugate, crosses the mean
    of both ways round.
    """
    count, rings, width = first.shape
    half = width // 2
    for n in range(count):
        at = 0
        for i in range(rings):
            for j in range(i + 1):
                for m in range(half):
                    a, b = first[n, i, m], first[n, i, half + m]
                    c, d = first[n, j, m], first[n, j, half + m]
                    squares[n, at + m] = a * c + b * d
                    crosses[n, at + m] = np.float32(0.5) * (
                        a * second[n, j, m]
                        + b * second[n, j, half + m]
                        + c * second[n, i, m]
                        + d * second[n, i, half + m]
                    )
                at += half


@functools.cache
def _tables() -> tuple[F32, F32, F64]:
    """(PRODUCTS, LEVELS) that lead to C_22 and to d_2; (RINGS, LEVELS) from what does not turn to Σ w S."""
    w = cell_weights()
    first = w[:, None] * spectra() * w
    second = np.einsum("lmik,k,lmkj->lmij", first, 1 / w, first)
    i, j = np.tril_indices(RINGS)
    twice = np.where(i == j, 1.0, 2.0) * _shares()[:, None]

    def flat(matrices: F64) -> F32:
        chosen = matrices[:, :, i, j] * twice
        return np.ascontiguousarray(chosen.transpose(2, 1, 0).reshape(PRODUCTS, LEVELS), np.float32)

    return flat(second), flat(first), first[:, 0].sum(axis=1).T


def moments(light: F32, matte: F64, target: F32, now: F64, level: I64) -> Systems:
    """Of N elements in C channels, one row a channel.

    light, target (N, C, RINGS, WIDTH) are series of the incident and of the wanted light; matte (N, C) what a
    white matte surface sends; now (N, C, 2) the reflectance, level (N,) the gloss.
    """
    rows, channels = light.shape[0] * light.shape[1], light.shape[1]
    first, second = light.reshape(rows, RINGS, WIDTH), target.reshape(rows, RINGS, WIDTH)
    squares, crosses = np.empty((rows, PRODUCTS), np.float32), np.empty((rows, PRODUCTS), np.float32)
    multiply(first, second, squares, crosses)
    to_squares, to_crosses, to_sums = _tables()
    d = matte.reshape(rows)
    weights = cell_weights()
    each = np.outer(weights, np.tile(_shares(), 2)).astype(np.float32).ravel()
    return Systems(
        c11=math.pi * d * d,
        c12=d[:, None] * (first[:, :, 0].astype(np.float64) @ to_sums),
        c22=np.asarray(squares @ to_squares, np.float64),
        d1=d * (second[:, :, 0].astype(np.float64) @ weights),
        d2=np.asarray(crosses @ to_crosses, np.float64),
        bb=np.asarray(np.square(second.reshape(rows, -1)) @ each, np.float64),
        now=now.reshape(rows, 2),
        level=np.asarray(level, np.int64),
        channels=channels,
    )


__all__ = ["PRODUCTS", "WIDTH", "convolve", "half_kernels", "half_level", "light_of", "moments", "series_of"]
