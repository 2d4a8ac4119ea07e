"""Pixels as a display wants them: photographs as they are, light through the exposure."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import numpy.typing as npt

from studio_core.kernels.tonemap import tonemap

Rgb = tuple[int, int, int]
_FEW = 40_000  # pixels that are looked at to find an exposure
_MIDDLE = 0.18
_FRAME = 2.0**-8  # of the bright light: what is darker is mostly the frame around a lens' circle


def displayed(pixels: npt.NDArray[Any], exposure: float) -> npt.NDArray[np.uint8]:
    """8-bit (H, W, 3) of a photograph's numbers or of linear float32 light, 2^exposure times brighter."""
    if pixels.dtype == np.uint8 and exposure == 0:
        return np.ascontiguousarray(pixels)
    return tonemap(linear(pixels), exposure)


def linear(pixels: npt.NDArray[Any]) -> npt.NDArray[np.float32]:
    """Light of encoded numbers, as if they were sRGB; float32 is light already."""
    if pixels.dtype in (np.uint8, np.uint16):
        return _decoded(pixels.dtype.itemsize)[pixels]
    return np.asarray(pixels, np.float32)


def numbers(values: npt.NDArray[Any]) -> str:
    """A pixel's three numbers in words."""
    if values.dtype in (np.uint8, np.uint16):
        return " ".join(str(int(v)) for v in values)
    return " ".join(f"{float(v):.3g}" for v in values)


def natural_exposure(pixels: npt.NDArray[Any]) -> float:
    """EV that shows most of the light well: its logarithm's mean at a middle grey, in thirds of a stop."""
    if pixels.dtype != np.float32:
        return 0.0
    skip = max(1, int((pixels.shape[0] * pixels.shape[1] / _FEW) ** 0.5))
    luminance = pixels[::skip, ::skip, :3].mean(axis=-1)
    lit = luminance[np.isfinite(luminance) & (luminance > 0)]
    if not lit.size:
        return 0.0
    lit = lit[lit >= np.percentile(lit, 99) * _FRAME]
    found = np.log2(_MIDDLE) - float(np.log2(lit).mean())
    return float(round(3 * found)) / 3


def tinted(mask: npt.NDArray[np.bool_], colour: Rgb, opacity: float = 0.6) -> npt.NDArray[np.uint8]:
    """(H, W, 4) premultiplied BGRA of a mask."""
    made = np.zeros((*mask.shape, 4), np.uint8)
    red, green, blue = (round(c * opacity) for c in colour)
    made[mask] = (blue, green, red, round(255 * opacity))
    return made


@cache
def _decoded(size: int) -> npt.NDArray[np.float32]:
    """Light of every number of 8 or 16 bits by the sRGB curve (IEC 61966-2-1)."""
    x = np.linspace(0, 1, 1 << (8 * size))
    made = np.where(x <= 0.04045, x / 12.92, ((x + 0.055) / 1.055) ** 2.4)
    return np.asarray(made, np.float32)
