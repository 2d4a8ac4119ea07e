"""What strokes say about one material: at places seen from somewhere, the light that is wanted.

A surface sends L = Σ_k c_k(d, s) b_k(g), channel by channel: b_k is the light that term k of its reflectance
model sends there with gloss level g and coefficient 1, and the coefficients follow from the matte and shiny
reflectance. (Equation 3's two columns are the case of two terms with c = (d, s).)
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Protocol

import numpy as np
import numpy.typing as npt

F64 = npt.NDArray[np.float64]
Bools = npt.NDArray[np.bool_]
DARK = 0.1
"""Of the mean: so much is added to a place's light before errors are taken relative to it."""


@dataclass(frozen=True, eq=False)
class Reflectance:
    """Matte (3,) and shiny (3,) reflectance, and the gloss level, a real number from 0 to L − 1."""

    diffuse: F64
    specular: F64
    level: float

    @property
    def tint(self) -> F64:
        """(3,) the colour of the shine, its largest channel 1; white where there is none."""
        most = self.specular.max()
        return np.ones(3) if most <= 0 else np.asarray(self.specular / most)


class Model(Protocol):
    """How reflectance becomes coefficients, which are affine in the matte part."""

    def coefficients(self, diffuse: F64, specular: F64) -> F64:
        """(…, T, 3) of reflectances (…, 3)."""
        ...

    def room(self, specular: F64) -> F64:
        """(…, 3) the largest matte part beside that shine, so that no more light returns than arrives."""
        ...


@dataclass(frozen=True, eq=False)
class Samples:
    """N places, as many as strokes cover and what else is to stay as it is.

    wanted, before (N, 3): light that was painted, and that was there. terms (L, N, T, 3): the b_k at each
    level, own (N, T, 3) with the gloss that there is now. weight (N,): how much a place counts.
    """

    wanted: F64
    before: F64
    terms: F64
    own: F64
    weight: F64

    def __post_init__(self) -> None:
        for field in dataclasses.fields(self):
            made = np.asarray(getattr(self, field.name), np.float64)
            object.__setattr__(self, field.name, made)

    def __len__(self) -> int:
        return len(self.weight)

    @property
    def levels(self) -> int:
        """L."""
        return len(self.terms)

    @property
    def finite(self) -> Bools:
        """(N,) places at which all numbers are numbers."""
        good: Bools = np.isfinite(self.weight) & np.isfinite(self.terms).all(axis=(0, 2, 3))
        good &= np.isfinite(self.own).all(axis=(1, 2))
        return good & np.isfinite(self.wanted).all(axis=1) & np.isfinite(self.before).all(axis=1)

    def some(self, which: npt.NDArray[np.generic]) -> Samples:
        """These of them."""
        wanted, before, own = self.wanted[which], self.before[which], self.own[which]
        return Samples(wanted, before, self.terms[:, which], own, self.weight[which])

    def that_count(self) -> Samples:
        """Those with numbers that are some, and a weight."""
        return self.some(np.flatnonzero(self.finite & (self.weight > 0)))

    def __add__(self, other: Samples) -> Samples:
        """Both, of the same material."""
        return Samples(
            np.concatenate([self.wanted, other.wanted]),
            np.concatenate([self.before, other.before]),
            np.concatenate([self.terms, other.terms], axis=1),
            np.concatenate([self.own, other.own]),
            np.concatenate([self.weight, other.weight]),
        )

    def mean(self) -> Samples:
        """All as one place, which counts as much as they do together: what one flat colour can mean."""
        total = self.weight.sum()
        share = self.weight / total if total > 0 else self.weight
        wanted, before = share @ self.wanted, share @ self.before
        terms = np.einsum("n,lntc->ltc", share, self.terms)
        own = np.einsum("n,ntc->tc", share, self.own)
        return Samples(wanted[None], before[None], terms[:, None], own[None], np.array([total]))

    @property
    def importance(self) -> F64:
        """(N, 3) weights of squared differences, relative: w / (max(wanted, before) + 0.1 mean)²."""
        light = np.maximum(np.maximum(self.wanted, self.before), 0)
        floor = DARK * light.mean() if light.size else 0.0
        scale = np.maximum(light + floor, 1e-30)
        return np.asarray(self.weight[:, None] / scale**2)

    def at(self, levels: F64) -> F64:
        """(M, N, T, 3) terms at real levels (M,), between two by interpolation."""
        low = np.clip(np.floor(levels), 0, self.levels - 1).astype(np.int64)
        high = np.minimum(low + 1, self.levels - 1)
        share = np.clip(levels - low, 0, 1)[:, None, None, None]
        return np.asarray((1 - share) * self.terms[low] + share * self.terms[high])

    def made(self, model: Model, of: Reflectance, own: bool = False) -> F64:
        """(N, 3) the light that a reflectance sends, at its level or with the gloss that there is now."""
        terms = self.own if own else self.at(np.array([of.level]))[0]
        return np.asarray(np.einsum("ntc,tc->nc", terms, model.coefficients(of.diffuse, of.specular)))
