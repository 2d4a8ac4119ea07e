"""How the simulated phone turns light into numbers, and the exact inverse as the truth.

Exposure is light × 2^EV, 1 where the sensor is full. Families: `sRGB`, `gamma`, `filmic` (an S-shaped curve
with toe and shoulder), `per channel` (each colour its own contrast; a middle grey stays grey, as white
balance sees to), `linear`.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

F64 = npt.NDArray[np.float64]
FAMILIES = ("sRGB", "gamma", "filmic", "per channel", "linear")
_DENSE = 1 << 14


@dataclass(frozen=True)
class Curve:
    """A response. `gamma` and `contrast` (0 … 1) shape it; `pedestal`: the number of no light, 0 … 1."""

    family: str = "sRGB"
    gamma: float = 2.2
    contrast: float = 0.5
    pedestal: float = 0.0

    def __post_init__(self) -> None:
        if self.family not in FAMILIES:
            raise ValueError(f"there is no response {self.family!r}")

    def encode(self, exposure: npt.NDArray[Any], channel: int) -> F64:
        """Numbers 0 … 1 of exposures, for a channel; what is below 0 or above 1 is clipped."""
        x = np.clip(np.asarray(exposure, np.float64) * self.gains[channel], 0.0, 1.0)
        return self.pedestal + (1 - self.pedestal) * self._shape(x, channel)

    def _shape(self, x: F64, channel: int) -> F64:
        match self.family:
            case "sRGB":
                return np.where(x <= 0.0031308, 12.92 * x, 1.055 * x ** (1 / 2.4) - 0.055)
            case "gamma":
                return _gamma(x, self.gamma)
            case "filmic":
                return _sigmoid(_gamma(x, self.gamma), self.contrast)
            case "per channel":
                gamma = self.gamma * (1.0, 0.93, 1.08)[channel]
                return _sigmoid(_gamma(x, gamma), self.contrast * (0.6, 0.35, 0.8)[channel])
            case _:
                return x

    @cached_property
    def gains(self) -> tuple[float, ...]:
        """Of red, green and blue before the curve, 1 at least: grey has three equal numbers in the middle."""
        if self.family != "per channel":
            return (1.0, 1.0, 1.0)
        at = np.linspace(0, 1, _DENSE) ** 3
        middle = [float(np.interp(0.5, self._shape(at, channel), at)) for channel in range(3)]
        return tuple(m / min(middle) for m in middle)

    def exposure(self, numbers: npt.ArrayLike, channel: int) -> F64:
        """The exposures 0 … 1 that give numbers 0 … 1 (what `encode` undoes)."""
        at = np.linspace(0, 1, _DENSE) ** 3 / self.gains[channel]  # dense where curves are steep
        return np.asarray(
            np.interp(np.asarray(numbers, np.float64), self.encode(at, channel), at), np.float64
        )

    def log_exposure(self, levels: int = 256) -> F64:
        """(3, levels) log2 exposure of evenly spaced numbers 0 … 1, 0 at the middle; −inf without light."""
        made = np.empty((3, levels))
        with np.errstate(divide="ignore"):
            for channel in range(3):
                made[channel] = np.log2(self.exposure(np.linspace(0, 1, levels), channel))
                made[channel] -= np.log2(self.exposure(0.5, channel))
        return made


def _gamma(x: F64, gamma: float) -> F64:
    """A power with a straight foot, as cameras have it: the slope stays finite."""
    foot = 0.004
    slope = foot ** (1 / gamma - 1) / gamma
    start = foot ** (1 / gamma) - slope * foot
    made = np.where(x < foot, slope * x, np.maximum(x, foot) ** (1 / gamma) - start)
    return np.asarray(made / (1 - start), np.float64)


def _sigmoid(x: F64, contrast: float) -> F64:
    """Part of an S over 0 … 1, strictly rising."""
    part = 0.8 * contrast
    return np.asarray((1 - part) * x + part * x * x * (3 - 2 * x), np.float64)
