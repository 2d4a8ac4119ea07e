"""Tone mapping pixel by pixel in double precision."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt


def _srgb(x: float) -> float:
    return 12.92 * x if x <= 0.0031308 else 1.055 * x ** (1 / 2.4) - 0.055


def _hill(rgb: list[float]) -> list[float]:
    into = [[0.59719, 0.35458, 0.04823], [0.07600, 0.90834, 0.01566], [0.02840, 0.13383, 0.83777]]
    out = [[1.60475, -0.53108, -0.07367], [-0.10208, 1.10813, -0.00605], [-0.00327, -0.07276, 1.07602]]
    x = [sum(m * min(c, 1e6) for m, c in zip(row, rgb, strict=True)) for row in into]
    y = [(v * (v + 0.0245786) - 0.000090537) / (v * (0.983729 * v + 0.4329510) + 0.238081) for v in x]
    return [sum(m * c for m, c in zip(row, y, strict=True)) for row in out]


def tonemap(linear: npt.NDArray[np.floating], exposure: float, kind: str) -> npt.NDArray[np.float64]:
    """(H, W, 3) in units of 8-bit steps, not rounded."""
    made = np.zeros(linear.shape)
    for place in np.ndindex(linear.shape[:2]):
        rgb = [0.0 if math.isnan(c) else max(float(c) * 2.0**exposure, 0.0) for c in linear[place]]
        if kind == "filmic":
            rgb = _hill(rgb)
        rgb = [min(max(c, 0.0), 1.0) for c in rgb]
        made[place] = [255 * (c if kind == "raw" else _srgb(c)) for c in rgb]
    return made
