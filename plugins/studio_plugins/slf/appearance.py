"""What elements' materials come to in the paper's terms: matte and shiny albedo, and a gloss level.

Every term of a reflectance model is compared with the lobes of all levels, looked at from a few heights: the
level and the amounts that are nearest to it, by energy, stand for it. A material's terms together are one
lobe then, at the mean of their levels by how much they return.
"""

from __future__ import annotations

import functools
import math

import numpy as np
import numpy.typing as npt

from studio_core.brdfs.calls import evaluate_at
from studio_core.shading.artifacts import Shapes
from studio_plugins.slf.ladder import LEVELS
from studio_plugins.slf.lobes import exponents, lobe
from studio_plugins.slf.whole import Reflectances

F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]
I64 = npt.NDArray[np.int64]

HEIGHTS = (0.2, 0.6, 0.95, 1.2)
"""Angles from the normal, radians, that terms are looked at from."""
FINER = 3  # directions along a cell's side
LEAST = 1e-4  # albedo of a lobe that is none


def shape_of(address: int, terms: int, shape: F32) -> F64:
    """(terms, 3) of one shape (D,): at a coefficient of 1 the matte and the shiny albedo, and the real level.

    What is known is kept.
    """
    return _fitted(address, terms, np.ascontiguousarray(shape, np.float32).tobytes())


class Appearance:
    """Of rows of `Shapes`."""

    def rows(self, shapes: Shapes) -> F64:
        """(R, T, 3) by term, as `shape_of` has them."""
        made = np.zeros((len(shapes.address), shapes.width, 3))
        ends = np.append(shapes.offset, len(shapes.data))[1:]
        for row in range(len(made)):
            shape = shapes.data[shapes.offset[row] : ends[row]]
            terms = int(shapes.terms[row])
            made[row, :terms] = shape_of(int(shapes.address[row]), terms, shape)
        return made

    def of(self, shapes: Shapes, row: I64, coefficients: F32) -> Reflectances:
        """Of E places: row (E,) of the shapes, −1 none; coefficients (E, T, 3)."""
        found = self.rows(shapes)
        some = np.where((row >= 0)[:, None, None], found[np.maximum(row, 0)], 0)
        c = coefficients.astype(np.float64)[:, : some.shape[1]]
        some = some[:, : c.shape[1]]
        matte, shine = (np.maximum((some[..., k, None] * c).sum(axis=1), 0) for k in (0, 1))
        whole = np.maximum(matte + shine, 1)
        share = np.abs(some[..., 1] * c.mean(axis=2))
        level = (share * some[..., 2]).sum(axis=1) / np.maximum(share.sum(axis=1), 1e-12)
        return Reflectances(matte / whole, shine / whole, level)


@functools.lru_cache(maxsize=256)
def _fitted(address: int, terms: int, shape: bytes) -> F64:
    lights, w, lobes, albedo, cross, squares = _probes()
    given = np.frombuffer(shape, np.float32)
    heights = [[math.sin(t), 0.0, math.cos(t)] for t in HEIGHTS]
    values = np.stack([evaluate_at(address, terms, given, towards, lights) for towards in heights])
    values = np.nan_to_num(values.reshape(-1, terms).astype(np.float64))
    weighted = w[:, None] * values
    ones, sums, crosses = w.sum(), weighted.sum(axis=0), lobes @ weighted
    made = np.zeros((terms, 3))
    for term in range(terms):
        first, second, rest = sums[term], crosses[:, term], weighted[:, term] @ values[:, term]
        determinant = np.maximum(ones * squares - cross**2, 1e-12 * ones * squares)
        a = np.maximum((ones * second - cross * first) / determinant, 0)
        m = (first - a * cross) / ones
        a, m = np.where(m < 0, np.maximum(second / squares, 0), a), np.maximum(m, 0)
        left = rest - 2 * m * first - 2 * a * second
        left += m * m * ones + 2 * m * a * cross + a * a * squares
        best = int(left.argmin())
        level = float(best)
        if 0 < best < LEVELS - 1:
            below, here, above = left[best - 1 : best + 2]
            bend = below - 2 * here + above
            level += 0.5 * (below - above) / bend if bend > 0 else 0.0
        if a[best] * albedo[best] < LEAST:
            made[term] = math.pi * max(first / ones, 0), 0, 0
        else:
            made[term] = math.pi * m[best], a[best], level
    made.setflags(write=False)
    return made


@functools.cache
def _probes() -> tuple[F32, F64, F64, F64, F64, F64]:
    """Light's directions (P, 3), their measure (heights · P,) and the lobes (LEVELS, heights · P).

    Then (LEVELS,) their mean albedo, their sums and those of their squares.
    """
    theta = (np.arange(16 * FINER) + 0.5) * (math.pi / 32 / FINER)
    phi = (np.arange(64 * FINER) + 0.5) * (2 * math.pi / 64 / FINER)
    t, p = (one.ravel() for one in np.meshgrid(theta, phi, indexing="ij"))
    lights = np.stack([np.sin(t) * np.cos(p), np.sin(t) * np.sin(p), np.cos(t)], axis=1)
    weights = np.sin(t) * np.cos(t)
    weights *= math.pi / weights.sum()
    views = np.array([[math.sin(h), 0.0, math.cos(h)] for h in HEIGHTS])
    made = np.stack([lobe(n, lights, views[:, None]).ravel() for n in exponents()])
    albedo = (made.reshape(LEVELS, len(HEIGHTS), -1) @ weights).mean(axis=1)
    w = np.tile(weights, len(HEIGHTS))
    return lights.astype(np.float32), w, made, albedo, made @ w, (made**2) @ w


__all__ = ["Appearance", "shape_of"]
