"""What a stroke says about one material: at places seen from a direction, the light that is wanted.

A surface sends L = d D + s S_g + rest, channel by channel: d and s are its matte and shiny reflectance,
D and S_g the light that a white one would send at gloss level g (equation 3's two columns), and rest is all
that neither changes.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

F64 = npt.NDArray[np.float64]
Bools = npt.NDArray[np.bool_]
DARK = 0.1
"""Of the mean: so much is added to a place's light before errors are taken relative to it."""


@dataclass(frozen=True, eq=False)
class Reflectance:
    """Matte (3,) and shiny (3,) albedo, and the gloss level, a real number from 0 to L − 1."""

    diffuse: F64
    specular: F64
    level: float

    @property
    def tint(self) -> F64:
        """(3,) the colour of the shine, its largest channel 1; white where there is none."""
        most = self.specular.max()
        return np.ones(3) if most <= 0 else np.asarray(self.specular / most)


@dataclass(frozen=True, eq=False)
class Samples:
    """N places, as many as a stroke covers and what else is to stay as it is.

    wanted, before (N, 3): light that was painted, and that was there. diffuse (N, 3), specular (L, N, 3): the
    columns D and S_g, rest (N, 3) what is besides. weight (N,): how much a place counts.
    """

    wanted: F64
    before: F64
    diffuse: F64
    specular: F64
    rest: F64
    weight: F64

    def __post_init__(self) -> None:
        for field in dataclasses.fields(self):
            made = np.asarray(getattr(self, field.name), np.float64)
            object.__setattr__(self, field.name, made)

    def __len__(self) -> int:
        return len(self.weight)

    @property
    def levels(self) -> int:
        """How many columns of shine there are."""
        return len(self.specular)

    @property
    def finite(self) -> Bools:
        """(N,) places at which all numbers are numbers."""
        good: Bools = np.isfinite(self.weight) & np.isfinite(self.specular).all(axis=(0, 2))
        for one in (self.wanted, self.before, self.diffuse, self.rest):
            good &= np.isfinite(one).all(axis=1)
        return good

    def some(self, which: npt.NDArray[Any]) -> Samples:
        """These of them."""
        wanted, before, diffuse = self.wanted[which], self.before[which], self.diffuse[which]
        return Samples(wanted, before, diffuse, self.specular[:, which], self.rest[which], self.weight[which])

    def __add__(self, other: Samples) -> Samples:
        """Both, of the same material."""

        def joined(name: str, axis: int = 0) -> F64:
            return np.concatenate([getattr(self, name), getattr(other, name)], axis=axis)

        plain = {name: joined(name) for name in ("wanted", "before", "diffuse", "rest", "weight")}
        return Samples(**plain, specular=joined("specular", 1))

    @property
    def importance(self) -> F64:
        """(N, 3) weights of squared differences, relative: w / (max(wanted, before) + 0.1 mean)²."""
        light = np.maximum(np.maximum(self.wanted, self.before), 0)
        floor = DARK * light.mean() if light.size else 0.0
        scale = np.maximum(light + floor, 1e-30)
        return np.asarray(self.weight[:, None] / scale**2)

    def column(self, level: float) -> F64:
        """(N, 3) S at a level, between two by interpolation."""
        low = int(np.clip(np.floor(level), 0, self.levels - 1))
        high, share = min(low + 1, self.levels - 1), level - low
        return np.asarray((1 - share) * self.specular[low] + share * self.specular[high])

    def made(self, of: Reflectance) -> F64:
        """(N, 3) the light that a reflectance sends."""
        return np.asarray(of.diffuse * self.diffuse + of.specular * self.column(of.level) + self.rest)
