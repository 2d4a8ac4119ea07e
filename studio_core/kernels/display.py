"""The tone mapping of `tonemap` as a kernel, block by block in vector code."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from studio_core.jit import kernel

F32 = npt.NDArray[np.float32]
U8 = npt.NDArray[np.uint8]
I32 = npt.NDArray[np.int32]

BLOCK = 1024
_ZERO, _HALF = np.float32(0), np.float32(0.5)
_BRIGHTEST = np.float32(1e6)  # the film's curve is flat long before


@kernel
def film(x: np.float32) -> np.float32:
    """The rational curve of Hill's fit."""
    made: np.float32 = (x * (x + np.float32(0.0245786)) - np.float32(0.000090537)) / (
        x * (np.float32(0.983729) * x + np.float32(0.4329510)) + np.float32(0.238081)
    )
    return made


@kernel
def lit(x: np.float32) -> np.float32:
    """Light between none and the brightest; NaN is none."""
    return min(x, _BRIGHTEST) if x > _ZERO else _ZERO


@kernel
def entry(x: np.float32, last: np.float32) -> np.int32:
    """The nearest of a table's entries for 0 … 1; NaN gives the first."""
    return np.int32(min(x * last, last) + _HALF) if x > _ZERO else np.int32(0)


@kernel
def display(linear: F32, gain: np.float32, to_film: F32, from_film: F32, table: U8, out: U8) -> None:
    """Bytes out (N, 3) of light (N, 3): times gain, through the film, looked up in the table for 0 … 1.

    The film's matrices (3, 3) lead from Rec.709 to its curve and back; empty ones: there is no film.
    """
    last = np.float32(len(table) - 1)
    red, green, blue = np.empty(BLOCK, np.float32), np.empty(BLOCK, np.float32), np.empty(BLOCK, np.float32)
    places = np.empty(3 * BLOCK, np.int32)
    filmic = len(to_film) > 0
    if filmic:
        a, b, c = to_film[0, 0], to_film[0, 1], to_film[0, 2]
        d, e, f = to_film[1, 0], to_film[1, 1], to_film[1, 2]
        g, h, i = to_film[2, 0], to_film[2, 1], to_film[2, 2]
        p, q, r = from_film[0, 0], from_film[0, 1], from_film[0, 2]
        s, t, u = from_film[1, 0], from_film[1, 1], from_film[1, 2]
        v, w, x = from_film[2, 0], from_film[2, 1], from_film[2, 2]
    flat, bytes_ = linear.reshape(-1), out.reshape(-1)
    for start in range(0, len(linear), BLOCK):
        count = min(BLOCK, len(linear) - start)
        light, made = flat[3 * start : 3 * (start + count)], bytes_[3 * start : 3 * (start + count)]
        if filmic:
            for n in range(count):
                red[n] = lit(light[3 * n] * gain)
                green[n] = lit(light[3 * n + 1] * gain)
                blue[n] = lit(light[3 * n + 2] * gain)
            for n in range(count):
                x0 = film(a * red[n] + b * green[n] + c * blue[n])
                x1 = film(d * red[n] + e * green[n] + f * blue[n])
                x2 = film(g * red[n] + h * green[n] + i * blue[n])
                red[n] = p * x0 + q * x1 + r * x2
                green[n] = s * x0 + t * x1 + u * x2
                blue[n] = v * x0 + w * x1 + x * x2
            for n in range(count):
                places[3 * n] = entry(red[n], last)
                places[3 * n + 1] = entry(green[n], last)
                places[3 * n + 2] = entry(blue[n], last)
        else:
            for n in range(3 * count):
                places[n] = entry(light[n] * gain, last)
        for n in range(3 * count):
            made[n] = table[places[n]]
