"""Figures of what every reflectance model promises: energy, reciprocity, bounded weights."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import numpy.typing as npt

from studio_core.brdfs.albedo import flat_coefficients, quadrature_albedo, term_albedo
from studio_core.brdfs.calls import density, evaluate, sample
from studio_core.brdfs.ranges import colour_corners
from studio_core.contract import Brdf, SampledBrdf
from studio_core.params import Value

F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]

EXACT = 1e-5  # of the integral over one box of some dozens


def seen_from(angles: npt.ArrayLike, azimuth: npt.ArrayLike = 0.0) -> F32:
    """(A, 3) directions at angles (A,) from the normal, radians."""
    theta, phi = np.broadcast_arrays(np.asarray(angles, np.float64), np.asarray(azimuth, np.float64))
    made = np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], -1)
    return np.asarray(made, np.float32)


def hard_directions(count: int, seed: int = 5) -> F32:
    """(2 · count, 3) above the surface: all over, grazing, and near one another's mirror images."""
    rng = np.random.default_rng(seed)
    w = rng.normal(size=(count, 3))
    w[:, 2] = np.abs(w[:, 2])
    w /= np.linalg.norm(w, axis=1, keepdims=True)
    w[: count // 8, 2] *= 1e-3
    near = w * [-1, -1, 1] + 10.0 ** rng.uniform(-5, -0.5, (count, 1)) * rng.normal(size=(count, 3))
    near[:, 2] = np.abs(near[:, 2])
    both = np.concatenate([w, near])
    return np.asarray(both / np.linalg.norm(both, axis=1, keepdims=True), np.float32)


def furnace(
    brdf: Brdf, materials: Sequence[Mapping[str, Value]], angles: npt.ArrayLike, azimuths: npt.ArrayLike = 0.0
) -> tuple[F64, F64]:
    """(M, A) least and largest albedo over all channels and every corner of what is not shape.

    For the shapes of some materials (`ranges.shapes`), by adaptive quadrature.
    """
    wo = seen_from(angles, azimuths)
    low, high = np.full((len(materials), len(wo)), np.inf), np.full((len(materials), len(wo)), -np.inf)
    for row, values in enumerate(materials):
        terms = quadrature_albedo(brdf, brdf.shape(values), wo, EXACT)
        for corner in colour_corners(brdf):
            albedo = terms @ flat_coefficients(brdf, {**values, **corner})
            low[row] = np.minimum(low[row], albedo.min(axis=1))
            high[row] = np.maximum(high[row], albedo.max(axis=1))
    return low, high


def reciprocity(brdf: Brdf, shape: F32, directions: F32) -> float:
    """Largest |f(a, b) − f(b, a)| over pairs of directions (N, 3), relative to f(b, a) + max f / 100."""
    there = np.stack([evaluate(brdf, shape, o, directions) for o in directions]).astype(np.float64)
    back = there.transpose(1, 0, 2)
    scale = back + there.max() / 100
    off = np.abs(there - back)
    return float(np.divide(off, scale, out=np.zeros_like(off), where=scale > 0).max())


def weight_bound(brdf: SampledBrdf, shape: F32, wo: F32, term: int, u: F32, others: F32) -> float:
    """Largest b_k cos / density, for directions drawn with u (N, 2) and for `others` (M, 3); inf without one.

    Relative to the term's largest albedo up to 89.9°, so 1 is a perfect draw of what loses nothing.
    """
    wi = np.concatenate([sample(brdf, shape, wo, term, u), others])
    wi = wi[wi[:, 2] > 0]
    drawn = density(brdf, shape, wo, wi)[:, term].astype(np.float64)
    value = evaluate(brdf, shape, wo, wi)[:, term] * wi[:, 2].astype(np.float64)
    largest = float(term_albedo(brdf, shape, np.radians([0, 30, 60, 80, 89, 89.9])).max(axis=0)[term])
    if not value.any():
        return 0.0
    weight = np.divide(value, drawn, out=np.full_like(drawn, np.inf), where=drawn > 0)
    return float(weight[value > 1e-30].max(initial=0.0)) / largest


__all__ = ["furnace", "hard_directions", "reciprocity", "seen_from", "weight_bound"]
