"""How much light a material returns, by the angle it is seen from: directional and mean albedo.

E(ω_o) = ∫ f_r cos θ_i dω_i. Integrals are of the scalar terms, which depend on the shape alone; so a change
of colour costs nothing.
"""

from __future__ import annotations

import hashlib
import threading
from collections import OrderedDict
from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from studio_core.brdfs.calls import evaluate
from studio_core.brdfs.quadrature import over_hemisphere
from studio_core.contract import Brdf
from studio_core.params import Value

F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]

TOLERANCE = 1e-4  # of a term's albedo there, or of a tenth of its largest, a box
LEAST = 0.1
STEEPEST = np.radians(89.9)
KEPT = 256


def albedo_table(brdf: Brdf, values: Mapping[str, Value], angles: npt.ArrayLike, azimuth: float = 0.0) -> F64:
    """(A, 3) directional albedo at angles (A,) from the normal, in radians, within 0.2 % up to 89°.

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


def term_albedo(brdf: Brdf, shape: F32, angles: npt.ArrayLike, azimuth: float = 0.0) -> F64:
    """(A, terms) ∫ b_k cos θ dω, kept while shape and angles stay."""
    theta = np.minimum(np.atleast_1d(np.asarray(angles, np.float64)), STEEPEST)
    digest = hashlib.blake2b(np.ascontiguousarray(shape, np.float32).data, digest_size=16).digest()
    key = (brdf.address, brdf.terms, digest, theta.tobytes(), float(azimuth))
    found = _KNOWN.get(key)
    if found is None:
        sine = np.sin(theta)
        wo = np.stack([sine * np.cos(azimuth), sine * np.sin(azimuth), np.cos(theta)], 1)
        found = quadrature_albedo(brdf, shape, wo, TOLERANCE, LEAST)
        found.flags.writeable = False
        _KNOWN.put(key, found)
    return found


def quadrature_albedo(
    brdf: Brdf, shape: F32, wo: npt.ArrayLike, tolerance: float, floor: float | None = None
) -> F64:
    """(R, terms) ∫ b_k cos θ dω for wo (R, 3); tolerance and floor as in `over_hemisphere`."""
    directions = np.atleast_2d(np.asarray(wo, np.float32))

    def integrand(row: int, wi: F32) -> F32:
        return evaluate(brdf, shape, directions[row], wi) * wi[:, 2:]

    return over_hemisphere(integrand, directions, tolerance, floor)


def forget() -> None:
    """Drop what was kept, so that the next table is integrated."""
    _KNOWN.clear()


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

    def clear(self) -> None:
        with self._lock:
            self._kept.clear()

    def put(self, key: object, value: F64) -> None:
        with self._lock:
            self._kept[key] = value
            if len(self._kept) > KEPT:
                self._kept.popitem(last=False)


_KNOWN = _Known()


__all__ = ["albedo_table", "flat_coefficients", "forget", "mean_albedo", "quadrature_albedo", "term_albedo"]
