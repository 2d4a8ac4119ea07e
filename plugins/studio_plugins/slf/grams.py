"""The best matte and shiny reflectance for samples, by the exact weighted error of the material's own model.

Of coefficients c the weighted squared error is cᵀAc − 2 c·b + yy, channel by channel, A and b sums over
samples of a level's terms: it costs the same whether a stroke has ten places or a thousand. Coefficients are
affine in the matte part, so its best value beside a given shine is a quotient, clipped to what leaves no more
light than arrives. The amount of shine and the level are searched: all amounts and levels of a grid at once,
then finer about the best. (The paper rescales an unconstrained minimum; its equations 5 and 6 are those of
the normal equations' residual, see `paper`.)
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from studio_plugins.slf.samples import F64, Model, Reflectance, Samples

TINY = 1e-300
FLAT = 1e-9
"""Curvature relative to the largest level's, below which a matte part shows nothing and stays."""
AMOUNTS = np.concatenate([[0.0], np.geomspace(1e-3, 1.0, 31)])
ZOOMS, AROUND = 4, 7


@dataclass(frozen=True, eq=False)
class Grams:
    """Of M levels: aa (M, 3, T, T), ab (M, 3, T), and yy (3,), weighted with a sample's importance."""

    levels: F64
    aa: F64
    ab: F64
    yy: F64

    @classmethod
    def of(cls, samples: Samples, levels: F64, importance: F64, terms: F64 | None = None) -> Grams:
        """At real levels (M,), or of the terms (M, N, T, 3) there."""
        terms = (samples.at(levels) if terms is None else terms).transpose(0, 3, 1, 2)  # M, 3, N, T
        weighted = terms * importance.T[None, :, :, None]
        aa = weighted.swapaxes(2, 3) @ terms
        ab = np.einsum("mcnt,nc->mct", weighted, samples.wanted)
        return cls(levels, aa, ab, (importance * samples.wanted**2).sum(axis=0))

    def some(self, which: npt.NDArray[np.generic]) -> Grams:
        """These levels."""
        return dataclasses.replace(self, levels=self.levels[which], aa=self.aa[which], ab=self.ab[which])


@dataclass(frozen=True, eq=False)
class Found:
    """A reflectance and the weighted squared error that it leaves."""

    reflectance: Reflectance
    left: float


def best(grams: Grams, model: Model, now: Reflectance, diffuse: bool, tint: F64 | None) -> Found:
    """The best at one of the levels; the matte part stays unless `diffuse`, and the shine without a `tint`.

    A shine is an amount of the tint (3,), whose largest channel is 1.
    """
    if tint is None:
        shine = now.specular[None]
        error, matte = _errors(grams, model, now, shine, diffuse)
        level = int(np.argmin(error[:, 0]))
        return Found(
            Reflectance(matte[level, 0], now.specular, float(grams.levels[level])), float(error[level, 0])
        )
    amounts = np.unique(np.append(AMOUNTS, now.specular.max()))
    low, high = 0.0, 1.0
    for zoom in range(ZOOMS):
        error, matte = _errors(grams, model, now, amounts[:, None] * tint, diffuse)
        level, at = (int(i) for i in np.unravel_index(np.argmin(error), error.shape))
        made = Found(
            Reflectance(matte[level, at], amounts[at] * tint, float(grams.levels[level])),
            float(error[level, at]),
        )
        if zoom == ZOOMS - 1:
            break
        low, high = amounts[max(at - 1, 0)], amounts[min(at + 1, len(amounts) - 1)]
        amounts = np.unique(np.append(np.linspace(low, high, AROUND), amounts[at]))
        near = np.arange(max(level - 1, 0), min(level + 2, len(grams.levels)))
        grams = grams.some(near)
    return made


def _errors(grams: Grams, model: Model, now: Reflectance, shine: F64, diffuse: bool) -> tuple[F64, F64]:
    """(M, K) weighted squared errors at all levels for shines (K, 3), and the matte parts (M, K, 3)."""
    room = model.room(shine)
    plain = model.coefficients(np.zeros_like(shine), shine).swapaxes(-1, -2)  # K, 3, T
    rise = model.coefficients(room, shine).swapaxes(-1, -2) - plain
    rise = rise / np.maximum(room, 1e-9)[..., None]
    rise_a = np.einsum("kct,mctu->mkcu", rise, grams.aa, optimize=True)
    curve = np.einsum("mkcu,kcu->mkc", rise_a, rise)
    if diffuse:
        slope = np.einsum("mct,kct->mkc", grams.ab, rise) - np.einsum("mkcu,kcu->mkc", rise_a, plain)
        seen = curve > FLAT * max(float(curve.max(initial=0)), TINY)
        matte = np.where(seen, slope / np.where(seen, curve, 1), now.diffuse)
        matte = np.clip(matte, 0, room)
    else:
        matte = np.broadcast_to(np.minimum(now.diffuse, room), curve.shape)
    made = plain + matte[..., None] * rise  # M, K, 3, T
    square = np.einsum("mkct,mctu,mkcu->mk", made, grams.aa, made, optimize=True)
    error = square - 2 * np.einsum("mkct,mct->mk", made, grams.ab) + grams.yy.sum()
    return np.asarray(np.maximum(error, 0)), matte
