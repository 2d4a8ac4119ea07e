"""Light over an element's cells as Fourier series around its normal, and back; lobes act on series.

Series (…, RINGS, WIDTH) are float32: real parts of L̂_m = Σ_k L_k e^(−2πi m k / PARTS) for m = 0 … PARTS / 2,
then imaginary ones. Kernels of our own, because a library's matrix products bring threads of their own.
"""

from __future__ import annotations

import functools
import math

import numpy as np
import numpy.typing as npt

from studio_core.jit import kernel
from studio_core.transport.cells import PARTS
from studio_plugins.slf.ladder import LEVELS
from studio_plugins.slf.lobes import FREQUENCIES, cell_weights, spectra

F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]
I64 = npt.NDArray[np.int64]

WIDTH = 2 * FREQUENCIES
HALF = PARTS // 2


@functools.cache
def waves() -> tuple[F32, F32]:
    """(FREQUENCIES, FREQUENCIES) cosines and sines of 2π m k / PARTS; the same read either way."""
    turn = 2 * math.pi / PARTS * np.outer(np.arange(FREQUENCIES), np.arange(FREQUENCIES))
    return np.cos(turn).astype(np.float32), np.sin(turn).astype(np.float32)


@functools.cache
def shares() -> F64:
    """(FREQUENCIES,) what squares of a series count in sums over parts (Parseval): twice, but at the ends."""
    made = np.full(FREQUENCIES, 2.0 / PARTS)
    made[0] = made[-1] = 1.0 / PARTS
    return made


def series_of(light: F32) -> F32:
    """(…, RINGS, WIDTH) of light (…, RINGS, PARTS)."""
    out = np.empty((*light.shape[:-1], WIDTH), np.float32)
    transform(np.ascontiguousarray(light).reshape(-1, PARTS), *waves(), out.reshape(-1, WIDTH))
    return out


def light_of(series: F32) -> F32:
    """The inverse of `series_of`."""
    out = np.empty((*series.shape[:-1], PARTS), np.float32)
    both = shares().astype(np.float32)
    transform_back(np.ascontiguousarray(series).reshape(-1, WIDTH), *waves(), both, out.reshape(-1, PARTS))
    return out


def matte_of(series: F32) -> F64:
    """(…,) what a white matte surface sends, of the series (…, RINGS, WIDTH) of the incident light."""
    return np.asarray(series[..., 0].astype(np.float64) @ cell_weights() / math.pi)


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


def sent_of(series: F32, diffuse: F64, specular: F64, row: I64) -> F32:
    """The series of what N reflectances (N, 3) send of incident light (N, 3, RINGS, WIDTH), by rows (N,) of
    `half_kernels`."""
    made = np.zeros_like(series)
    if specular.any():
        convolve(series, half_kernels(), row, made)
        made *= specular.astype(np.float32)[..., None, None]
    made[..., 0] += (PARTS * matte_of(series) * diffuse)[..., None]
    return made


# Lengths are read from the arrays: loops of a length that is known are unrolled, and are no vector code then.
# Four rows (rings) at a time take four terms each: what is between loops costs as much as they do.


@kernel
def transform(light: F32, cosines: F32, sines: F32, out: F32) -> None:
    """out (R, WIDTH) of light (R, PARTS), R a multiple of 4; parts alike on both sides go together."""
    count, half = len(cosines), light.shape[1] // 2
    even, odd = np.empty((4, half), np.float32), np.empty((4, half), np.float32)
    for r in range(0, len(light), 4):
        for row in range(4):
            even[row, 0], odd[row, 0] = light[r + row, 0], np.float32(0)
            middle = light[r + row, half]
            for k in range(1, half):
                even[row, k] = light[r + row, k] + light[r + row, 2 * half - k]
                odd[row, k] = light[r + row, 2 * half - k] - light[r + row, k]
            for m in range(count):
                out[r + row, m], out[r + row, count + m] = cosines[half, m] * middle, np.float32(0)
        for k in range(0, half, 4):
            a, b, c, d = even[0, k], even[0, k + 1], even[0, k + 2], even[0, k + 3]
            e, f, g, h = even[1, k], even[1, k + 1], even[1, k + 2], even[1, k + 3]
            i, j, n, o = even[2, k], even[2, k + 1], even[2, k + 2], even[2, k + 3]
            p, q, s, t = even[3, k], even[3, k + 1], even[3, k + 2], even[3, k + 3]
            for m in range(count):
                w, x, y, z = cosines[k, m], cosines[k + 1, m], cosines[k + 2, m], cosines[k + 3, m]
                out[r, m] += a * w + b * x + c * y + d * z
                out[r + 1, m] += e * w + f * x + g * y + h * z
                out[r + 2, m] += i * w + j * x + n * y + o * z
                out[r + 3, m] += p * w + q * x + s * y + t * z
            a, b, c, d = odd[0, k], odd[0, k + 1], odd[0, k + 2], odd[0, k + 3]
            e, f, g, h = odd[1, k], odd[1, k + 1], odd[1, k + 2], odd[1, k + 3]
            i, j, n, o = odd[2, k], odd[2, k + 1], odd[2, k + 2], odd[2, k + 3]
            p, q, s, t = odd[3, k], odd[3, k + 1], odd[3, k + 2], odd[3, k + 3]
            for m in range(count):
                w, x, y, z = sines[k, m], sines[k + 1, m], sines[k + 2, m], sines[k + 3, m]
                out[r, count + m] += a * w + b * x + c * y + d * z
                out[r + 1, count + m] += e * w + f * x + g * y + h * z
                out[r + 2, count + m] += i * w + j * x + n * y + o * z
                out[r + 3, count + m] += p * w + q * x + s * y + t * z


@kernel
def transform_back(series: F32, cosines: F32, sines: F32, share: F32, out: F32) -> None:
    """out (R, PARTS) of series (R, WIDTH), R a multiple of 4."""
    count, half = len(cosines), out.shape[1] // 2
    even, odd = np.empty((4, count), np.float32), np.empty((4, count), np.float32)
    real, imaginary = np.empty((4, count), np.float32), np.empty((4, count), np.float32)
    for r in range(0, len(series), 4):
        for row in range(4):
            for m in range(count):
                real[row, m] = share[m] * series[r + row, m]
                imaginary[row, m] = share[m] * series[r + row, count + m]
            fastest = real[row, half]
            for k in range(count):
                even[row, k], odd[row, k] = fastest * cosines[half, k], np.float32(0)
        for m in range(0, half, 4):
            a, b, c, d = real[0, m], real[0, m + 1], real[0, m + 2], real[0, m + 3]
            e, f, g, h = real[1, m], real[1, m + 1], real[1, m + 2], real[1, m + 3]
            i, j, n, o = real[2, m], real[2, m + 1], real[2, m + 2], real[2, m + 3]
            p, q, s, t = real[3, m], real[3, m + 1], real[3, m + 2], real[3, m + 3]
            for k in range(count):
                w, x, y, z = cosines[m, k], cosines[m + 1, k], cosines[m + 2, k], cosines[m + 3, k]
                even[0, k] += a * w + b * x + c * y + d * z
                even[1, k] += e * w + f * x + g * y + h * z
                even[2, k] += i * w + j * x + n * y + o * z
                even[3, k] += p * w + q * x + s * y + t * z
            a, b, c, d = imaginary[0, m], imaginary[0, m + 1], imaginary[0, m + 2], imaginary[0, m + 3]
            e, f, g, h = imaginary[1, m], imaginary[1, m + 1], imaginary[1, m + 2], imaginary[1, m + 3]
            i, j, n, o = imaginary[2, m], imaginary[2, m + 1], imaginary[2, m + 2], imaginary[2, m + 3]
            p, q, s, t = imaginary[3, m], imaginary[3, m + 1], imaginary[3, m + 2], imaginary[3, m + 3]
            for k in range(count):
                w, x, y, z = sines[m, k], sines[m + 1, k], sines[m + 2, k], sines[m + 3, k]
                odd[0, k] += a * w + b * x + c * y + d * z
                odd[1, k] += e * w + f * x + g * y + h * z
                odd[2, k] += i * w + j * x + n * y + o * z
                odd[3, k] += p * w + q * x + s * y + t * z
        for row in range(4):
            out[r + row, 0], out[r + row, half] = even[row, 0], even[row, half]
            for k in range(1, half):
                out[r + row, k] = even[row, k] - odd[row, k]
                out[r + row, 2 * half - k] = even[row, k] + odd[row, k]


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
                for j in range(0, rings, 4):
                    for m in range(half):
                        out[n, c, i, m] += (
                            kernels[own, i, j, m] * series[n, c, j, m]
                            + kernels[own, i, j + 1, m] * series[n, c, j + 1, m]
                            + kernels[own, i, j + 2, m] * series[n, c, j + 2, m]
                            + kernels[own, i, j + 3, m] * series[n, c, j + 3, m]
                        )
                    for m in range(half):
                        out[n, c, i, half + m] += (
                            kernels[own, i, j, m] * series[n, c, j, half + m]
                            + kernels[own, i, j + 1, m] * series[n, c, j + 1, half + m]
                            + kernels[own, i, j + 2, m] * series[n, c, j + 2, half + m]
                            + kernels[own, i, j + 3, m] * series[n, c, j + 3, half + m]
                        )


__all__ = [
    "WIDTH", "convolve", "half_kernels", "half_level", "light_of", "matte_of", "sent_of", "series_of",
    "shares", "waves",
]  # fmt: skip
