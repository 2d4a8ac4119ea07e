"""Merging one pixel at a time in double precision, and the classic hat weights (Debevec and Malik 1997)."""

from __future__ import annotations

import functools
from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from studio_core.capturing.artifacts import Response

F64 = npt.NDArray[np.float64]


@functools.lru_cache(maxsize=20000)
def exposure(response: Response, number: float, channel: int) -> float:
    """Linear exposure of a number of 8 bit, 1 at the middle level."""
    if number <= response.black[channel]:
        return 0.0
    levels = np.linspace(0, response.top, response.curve.shape[1])
    return float(np.interp(number, levels, 2.0 ** response.curve[channel]))


@functools.lru_cache(maxsize=20000)
def variance(response: Response, number: float, channel: int) -> float:
    low, high = max(number - 0.5, 0.0), min(number + 0.5, response.top)
    table = np.array([exposure(response, n, channel) for n in range(256)])
    rise = max(np.interp(high, np.arange(256), table) - np.interp(low, np.arange(256), table), 1e-9)
    slope = rise / ((high - low) / response.top)
    a, b, c = response.noise
    return float(max(a * slope**2, 1e-14) + b + c * exposure(response, number, channel))


def merged(
    frames: Sequence[npt.NDArray[Any]], evs: Sequence[float], response: Response
) -> tuple[F64, npt.NDArray[np.bool_]]:
    """Light and clipped mask of frames (H, W, 3) uint8, dark to bright, that do not move; no ghosts."""
    height, width = frames[0].shape[:2]
    light, clipped = np.zeros((height, width, 3)), np.zeros((height, width), np.bool_)

    def is_clipped(k: int, y: int, x: int) -> bool:
        return any(frames[k][y, x, c] >= response.white[c] for c in range(3))

    for y in range(height):
        for x in range(width):
            good = []
            for k in range(len(frames)):
                near = [(y, x)]
                if k:
                    near = [(v, u) for v in (y - 1, y, y + 1) for u in (x - 1, x, x + 1)]
                inside = [(v, u) for v, u in near if 0 <= v < height and 0 <= u < width]
                if not any(is_clipped(k, v, u) for v, u in inside):
                    good.append(k)
            if not good:
                clipped[y, x] = True
            for c in range(3):
                if not good:
                    light[y, x, c] = max(
                        exposure(response, frames[k][y, x, c], c) / 2.0 ** evs[k]
                        for k in range(len(frames))
                        if is_clipped(k, y, x)
                    )
                    continue
                top = bottom = 0.0
                for k in good:
                    around = []
                    for v in (y - 1, y, y + 1):
                        for u in (x - 1, x, x + 1):
                            v2 = abs(v) if v < height else 2 * height - 2 - v
                            u2 = abs(u) if u < width else 2 * width - 2 - u
                            around.append(float(frames[k][v2, u2, c]))
                    mean = np.floor(np.mean(around) + 0.5)
                    weight = 4.0 ** evs[k] / variance(response, mean, c)
                    top += weight * exposure(response, frames[k][y, x, c], c) / 2.0 ** evs[k]
                    bottom += weight
                light[y, x, c] = top / bottom
    return light, clipped


def hat_merged(frames: Sequence[npt.NDArray[Any]], evs: Sequence[float], response: Response) -> F64:
    """Mean of log light with a hat over 0 … 255 as weight, channel by channel (equation 6 of the paper)."""
    table = np.array([[exposure(response, n, c) for n in range(256)] for c in range(3)])
    log = np.log2(np.maximum(table, 1e-6))
    total, weights = np.zeros(frames[0].shape), np.zeros(frames[0].shape)
    for frame, ev in zip(frames, evs, strict=True):
        weight = np.minimum(frame, 255 - frame.astype(np.float64)) + 1e-6
        for c in range(3):
            total[..., c] += weight[..., c] * (log[c][frame[..., c]] - ev)
        weights += weight
    return np.asarray(2.0 ** (total / weights))
