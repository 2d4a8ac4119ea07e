"""The matte and shiny reflectance that explain samples best among those that return no more than arrives.

Per channel c and gloss level, the weighted squared difference from what is wanted is

    DD d² + 2 DS d s + SS s² − 2 DR d − 2 SR s + RR,   s = a t_c,

with one amount a of shine in a given tint t for all channels. Under d ≥ 0, a ≥ 0 and d + s ≤ 1 the minimum
over d, for a given a, is the parabola's own or at one of its bounds; which of them, changes at two values of
a a channel. So the minimum over a lies in one of seven intervals, each with a parabola of its own: it is
found exactly, all levels at once. (The paper rescales the unconstrained minimum; its equations 5 and 6 are
those of the normal equations' residual, see `paper`.)
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from studio_plugins.slf.samples import F64, Reflectance, Samples

PIVOT = 1e-6
"""Columns whose angle has a smaller squared sine are one column."""
TINY = 1e-300


@dataclass(frozen=True, eq=False)
class Moments:
    """Weighted sums over samples: dd, dr (3,), ds, ss, sr (M, 3) at M levels; r = wanted − rest."""

    dd: F64
    dr: F64
    ds: F64
    ss: F64
    sr: F64

    @classmethod
    def of(cls, samples: Samples, levels: F64) -> Moments:
        """Of the columns at some levels (M,)."""
        weight, wanted = samples.importance, samples.wanted - samples.rest
        shine = np.stack([samples.column(level) for level in levels])
        weighted = weight * samples.diffuse
        dd, dr = (weighted * samples.diffuse).sum(axis=0), (weighted * wanted).sum(axis=0)
        ds = np.einsum("mnc,nc->mc", shine, weighted)
        sr = np.einsum("mnc,nc->mc", shine, weight * wanted)
        ss = np.einsum("mnc,mnc,nc->mc", shine, shine, weight, optimize=True)
        return cls(dd, dr, ds, ss, sr)

    @property
    def apart(self) -> npt.NDArray[np.bool_]:
        """(M, 3) where both columns are there and differ: the Schur pivot SS − DS² / DD against SS."""
        pivot = self.ss - self.ds**2 / np.maximum(self.dd, TINY)
        return np.asarray((self.dd > TINY) & (self.ss > TINY) & (pivot > PIVOT * self.ss))


@dataclass(frozen=True, eq=False)
class Found:
    """For M levels: diffuse and specular reflectance (M, 3)."""

    diffuse: F64
    specular: F64


def fit_diffuse(moments: Moments, now: Reflectance) -> Found:
    """The best matte part while the shine stays: clip((DR − DS s) / DD) to 0 … 1 − s, exact."""
    room = np.maximum(1 - now.specular, 0)
    best = (moments.dr - moments.ds * now.specular) / np.maximum(moments.dd, TINY)
    made = np.where(moments.dd > TINY, np.clip(best, 0, room), np.minimum(now.diffuse, room))
    return Found(made, np.broadcast_to(now.specular, made.shape))


def fit_specular(moments: Moments, now: Reflectance, tint: F64) -> Found:
    """The best amount of shine of a tint while the matte part stays; exact."""
    square = (tint**2 * moments.ss).sum(axis=1)
    linear = (tint * (moments.sr - moments.ds * now.diffuse)).sum(axis=1)
    most = np.min(np.maximum(1 - now.diffuse, 0) / np.maximum(tint, 1e-9))
    amount = np.where(square > TINY, np.clip(linear / np.maximum(square, TINY), 0, most), 0.0)
    return Found(np.broadcast_to(now.diffuse, moments.ds.shape), amount[:, None] * tint)


def fit_both(moments: Moments, now: Reflectance, tint: F64) -> Found:
    """The best of both; exact. Where columns are one, the matte part alone changes."""
    given = (np.broadcast_to(one, moments.ds.shape) for one in (moments.dd, moments.dr))
    dd, dr = (np.ascontiguousarray(one) for one in given)
    ds, ss, sr, t = moments.ds, moments.ss, moments.sr, tint
    lit = dd > TINY
    safe = np.where(lit, dd, 1.0)
    # Where the parabola's own minimum over d leaves 0 … 1 − a t, for rising a.
    with np.errstate(divide="ignore", invalid="ignore"):
        at_zero = dr / (t * ds)
        at_most = (1 - dr / safe) / (t * (1 - ds / safe))
    ends = np.concatenate([at_zero, at_most], axis=1)
    ends = np.where(np.isfinite(ends), np.clip(ends, 0, 1), 0.0)
    ends = np.sort(np.concatenate([np.zeros((len(ds), 1)), ends, np.ones((len(ds), 1))], axis=1), axis=1)
    low, high = ends[:, :-1, None], ends[:, 1:, None]
    middle = (low + high) / 2

    def matte(a: F64) -> F64:
        own = (dr[:, None] - a * t * ds[:, None]) / safe[:, None]
        kept = np.broadcast_to(now.diffuse, own.shape)
        return np.clip(np.where(lit[:, None], own, kept), 0, np.maximum(1 - a * t, 0))

    own = (dr[:, None] - middle * t * ds[:, None]) / safe[:, None]
    bound = np.where(own <= 0, 0, np.where(own >= 1 - middle * t, 2, 1))
    bound = np.where(lit[:, None], bound, 0)
    # minus half the slope at 0, and the curvature, of each channel's minimum over d
    square = np.choose(
        bound, [t**2 * ss[:, None], t**2 * (ss - ds**2 / safe)[:, None], t**2 * (dd - 2 * ds + ss)[:, None]]
    )
    linear = np.choose(
        bound,
        [t * sr[:, None], t * (sr - ds * dr / safe)[:, None], t * (dd - ds - dr + sr)[:, None]],
    )
    square, linear = square.sum(axis=2, keepdims=True), linear.sum(axis=2, keepdims=True)
    with np.errstate(divide="ignore", invalid="ignore"):
        inner = np.where(square > TINY, linear / square, low)
    a = np.clip(np.where(np.isfinite(inner), inner, low), low, high)
    d = matte(a)
    s = a * t
    sums = [one[:, None] for one in (dd, ds, ss, dr, sr)]
    cost = (sums[0] * d * d + 2 * sums[1] * d * s + sums[2] * s * s - 2 * sums[3] * d - 2 * sums[4] * s).sum(
        axis=2
    )
    best = np.argmin(cost, axis=1)
    rows = np.arange(len(best))
    one_column = ~moments.apart.any(axis=1, keepdims=True)
    specular = np.where(one_column, now.specular, s[rows, best])
    return Found(np.where(one_column, fit_diffuse(moments, now).diffuse, d[rows, best]), specular)
