"""How much light a material returns, by the angle it is seen from: directional and mean albedo.

E(ω_o) = ∫ f_r cos θ_i dω_i. Integrals are of the scalar terms, which depend on the shape alone; so a change
of colour costs nothing. Models that draw directions are summed over a lattice of their own samples until four
lattices agree; the others, and whatever does not settle, by adaptive quadrature.
"""

from __future__ import annotations

import hashlib
import threading
from collections import OrderedDict
from collections.abc import Mapping
from typing import Any, cast

import numpy as np
import numpy.typing as npt

from studio_core.brdfs.calls import density, evaluate, is_sampled, sample
from studio_core.brdfs.quadrature import over_hemisphere
from studio_core.contract import Brdf, SampledBrdf
from studio_core.params import Value

F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]

TOLERANCE = 1e-3  # of a term's albedo there, or of a tenth of its largest
LEAST = 0.1
STEEPEST = np.radians(89.9)
LATTICES = ((377, 233), (1597, 987), (6765, 4181), (28657, 17711))  # Fibonacci numbers
SHIFTS = ((0.125, 0.25), (0.375, 0.0), (0.625, 0.75), (0.875, 0.5))
BOX = 0.1  # a box's part of the tolerance
KEPT = 256
_DOWN = np.array([0, 0, -1], np.float32)
_BELOW_ONE = np.nextafter(np.float32(1), np.float32(0))


def albedo_table(brdf: Brdf, values: Mapping[str, Value], angles: npt.ArrayLike, azimuth: float = 0.0) -> F64:
    """(A, 3) directional albedo at angles (A,) from the normal, in radians, within 0.1 %.

    Angles beyond 89.9° are taken as that: at 90° nothing is seen. `azimuth` in radians from the tangent
    tells for anisotropic models.
    """
    terms = term_albedo(brdf, brdf.shape(values), angles, azimuth)
    return np.asarray(np.einsum("ak,kc->ac", terms, flat_coefficients(brdf, values)))


def mean_albedo(brdf: Brdf, values: Mapping[str, Value]) -> F64:
    """(3,) share of the light that a white sky all around brings back: 2 ∫ E(μ) μ dμ, over azimuths too."""
    nodes, weights = np.polynomial.legendre.leggauss(16)
    mu, weights = (nodes + 1) / 2, weights / 2
    turns = np.array([0.0, 0.25, 0.5, 0.75]) * np.pi
    tables = [albedo_table(brdf, values, np.arccos(mu), turn) for turn in turns]
    return np.asarray(2 * np.einsum("a,ac->c", weights * mu, np.mean(tables, axis=0)))


def flat_coefficients(brdf: Brdf, values: Mapping[str, Value]) -> F64:
    """(terms, 3) of a material without textures."""
    numbers: dict[str, Any] = {
        name: np.asarray(value, np.float32)
        for name, value in values.items()
        if not isinstance(value, str | bool)
    }
    return np.asarray(brdf.coefficients(numbers), np.float64).reshape(brdf.terms, 3)


def term_albedo(
    brdf: Brdf, shape: F32, angles: npt.ArrayLike, azimuth: float = 0.0, tolerance: float = TOLERANCE
) -> F64:
    """(A, terms) ∫ b_k cos θ dω, kept while shape and angles stay."""
    theta = np.minimum(np.atleast_1d(np.asarray(angles, np.float64)), STEEPEST)
    digest = hashlib.blake2b(np.ascontiguousarray(shape, np.float32).data, digest_size=16).digest()
    key = (brdf.address, brdf.terms, digest, theta.tobytes(), float(azimuth), tolerance)
    found = _KNOWN.get(key)
    if found is None:
        found = _term_albedo(brdf, shape, theta, azimuth, tolerance)
        found.flags.writeable = False
        _KNOWN.put(key, found)
    return found


def quadrature_albedo(brdf: Brdf, shape: F32, wo: npt.ArrayLike, tolerance: npt.ArrayLike) -> F64:
    """(R, terms) ∫ b_k cos θ dω by adaptive quadrature alone, for wo (R, 3); see `over_hemisphere`."""
    directions = np.atleast_2d(np.asarray(wo, np.float32))

    def integrand(row: int, wi: F32) -> F32:
        return evaluate(brdf, shape, directions[row], wi) * wi[:, 2:]

    return over_hemisphere(integrand, directions, tolerance)


class _Known:
    """What was integrated last."""

    def __init__(self) -> None:
        self._kept: OrderedDict[object, F64] = OrderedDict()
        self._lock = threading.Lock()

    def get(self, key: object) -> F64 | None:
        with self._lock:
            found = self._kept.get(key)
            if found is not None:
                self._kept.move_to_end(key)
            return found

    def put(self, key: object, value: F64) -> None:
        with self._lock:
            self._kept[key] = value
            if len(self._kept) > KEPT:
                self._kept.popitem(last=False)


_KNOWN = _Known()


def _term_albedo(brdf: Brdf, shape: F32, theta: F64, azimuth: float, tolerance: float) -> F64:
    sine = np.sin(theta)
    wo = np.stack([sine * np.cos(azimuth), sine * np.sin(azimuth), np.cos(theta)], 1).astype(np.float32)
    made = np.zeros((len(wo), brdf.terms))
    left = np.arange(len(wo))
    if is_sampled(brdf):
        for points in (_lattice(*lattice) for lattice in LATTICES):
            each = np.array([_by_samples(cast(SampledBrdf, brdf), shape, wo[row], points) for row in left])
            made[left] = each.mean(axis=1)
            scale = np.maximum(made[left], LEAST * made.max(axis=0))
            left = left[(np.ptp(each, axis=1) > 2 * tolerance * scale).any(axis=1)]
            if not len(left):
                return made
    else:
        rough = quadrature_albedo(brdf, shape, wo, np.inf)
        made[:] = rough
    scale = np.maximum(made[left], LEAST * made.max(axis=0))
    made[left] = quadrature_albedo(brdf, shape, wo[left], BOX * tolerance * scale)
    return made


def _lattice(count: int, step: int) -> F32:
    """(4 · count, 2): a lattice under each shift; folded along u0, where maps are not periodic."""
    i = np.arange(count)
    every = []
    for a, b in SHIFTS:
        u0, u1 = (i + a) / count % 1.0, (i * step / count + b) % 1.0
        every.append(np.stack([1 - np.abs(2 * u0 - 1), u1], 1))
    return np.minimum(np.concatenate(every).astype(np.float32), _BELOW_ONE)


def _by_samples(brdf: SampledBrdf, shape: F32, wo: F32, u: F32) -> F64:
    """(shifts, terms) from each lattice."""
    made = np.zeros((len(SHIFTS), brdf.terms))
    left = list(range(brdf.terms))
    while left:
        wi = sample(brdf, shape, wo, left[0], u)
        wi = np.where(wi[:, 2:] > 0, wi, _DOWN)
        drawn = density(brdf, shape, wo, wi)
        own = drawn[:, left[0]]
        alike = [k for k in left if np.array_equal(drawn[:, k], own)]  # most terms share a lobe
        weight = np.divide(wi[:, 2], own, out=np.zeros_like(own), where=own > 0)[:, None]
        values = evaluate(brdf, shape, wo, wi)[:, alike] * weight
        made[:, alike] = values.reshape(len(SHIFTS), -1, len(alike)).mean(axis=1, dtype=np.float64)
        left = [k for k in left if k not in alike]
    return made


__all__ = ["albedo_table", "flat_coefficients", "mean_albedo", "quadrature_albedo", "term_albedo"]
