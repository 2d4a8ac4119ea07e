"""What GGX facets return in one bounce, and what returns the rest (Kulla & Conty 2017).

E(μ, α) is the albedo of D G / (4 …) without Fresnel's term: what single scattering with perfect mirrors
returns. The rest, 1 − E, left the model with the light that bounces between facets; the reciprocal lobe
(1 − E(μ_i)) (1 − E(μ_o)) / (π (1 − Ē)) has the albedo 1 − E exactly, and F_ms = F̄² Ē / (1 − F̄ (1 − Ē)) of
it survives the bounces (Kulla & Conty, "Revisiting Physically Based Shading at Imageworks", 2017, with F̄
once more for the first bounce: Hill 2018). Ē = 2 ∫ E μ dμ, F̄ = 2 ∫ F μ dμ.

Everything is integrated here, for a few roughnesses when it is first asked for (30 ms), and is a polynomial
between them (`curves.Family`): nothing is stored.
"""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from studio_core.jit import kernel
from studio_core.kernels.brdf import ONE, ZERO
from studio_plugins.brdfs.curves import Family, at, curve, fit, place

F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]

LEAST_ALPHA = 1e-4
LEAST_MU = 1e-3  # below, what the sharpest facets let through is continued: at 89.94°
KEPT = 512
_LEAST_ROOT = math.sqrt(LEAST_ALPHA)
_NODES, _WEIGHTS = (np.asarray(a) for a in np.polynomial.legendre.leggauss(32))
_FINE_NODES, _FINE_WEIGHTS = (np.asarray(a) for a in np.polynomial.legendre.leggauss(96))
_HALF_NODES, _HALF_WEIGHTS = (np.asarray(a) for a in np.polynomial.legendre.leggauss(16))


def alpha_of(roughness: Any) -> float:
    """α = roughness², not below 1e-4."""
    return max(float(np.clip(roughness, 0.0, 1.0)) ** 2, LEAST_ALPHA)


def bounce(mu: npt.ArrayLike, alpha: float, index: float | None = None) -> tuple[F64, F64]:
    """(N,) E of mirrors, and (N,) the same with a dielectric's Fresnel term, for cosines (N,) > 0.

    Exact within 3e-5 for α ≥ 1e-4.
    """
    weight, seen = _returning(mu, alpha)
    mirrors = weight.sum(axis=(1, 2))
    if index is None:
        return mirrors, mirrors
    return mirrors, (weight * fresnel(seen, index)).sum(axis=(1, 2))


def rim_share(mu: npt.ArrayLike, alpha: float) -> F64:
    """(N,) (1 − ω·h)^5 averaged over the facets that one bounce returns: F90's part of Schlick's term."""
    weight, seen = _returning(mu, alpha)
    made: F64 = (weight * (1 - seen) ** 5).sum(axis=(1, 2)) / weight.sum(axis=(1, 2))
    return made


def _returning(mu: npt.ArrayLike, alpha: float) -> tuple[F64, F64]:
    """(N, A, T) what facets add to E for cosines (N,) > 0, and the cosine at which they are seen.

    Integrated over facets between upright and the slope where the reflection meets the horizon, which is
    known for every azimuth: x* = (sin cosφ + √(sin² cos²φ + μ²)) / μ. x = α tan ψ makes GGX's density of
    slopes sin 2ψ dψ.
    """
    m = np.asarray(mu, np.float64)[:, None, None]
    sine = np.sqrt(np.maximum(1 - m * m, 0.0))
    quarter = (_HALF_NODES + 1) * np.pi / 4
    cosine = np.cos(np.concatenate([quarter, quarter + np.pi / 2]))[None, :, None]
    around = np.concatenate([_HALF_WEIGHTS, _HALF_WEIGHTS])[None, :, None] / 4
    root = np.sqrt((sine * cosine) ** 2 + m * m)
    ahead = cosine > 0
    steepest = np.where(ahead, (sine * cosine + root) / m, m / np.where(ahead, 1.0, root - sine * cosine))
    end = np.arctan(steepest / alpha)
    psi = end * (_NODES + 1) / 2
    x = alpha * np.tan(psi)
    upright2 = 1 / (1 + x * x)
    facing = sine * x * cosine + m  # ω_o·h / n·h
    down = np.maximum(2 * facing * upright2 - m, 0.0)
    weight = np.sin(2 * psi) * end * _WEIGHTS / 2 * around
    weight = weight * facing / m * _masking(m, alpha) * _masking(down, alpha)
    return weight, np.clip(facing * np.sqrt(upright2), 0.0, 1.0)


def _masking(cosine: F64, alpha: float) -> F64:
    made: F64 = 2 * cosine / (cosine + np.sqrt(alpha * alpha + (1 - alpha * alpha) * cosine * cosine))
    return made


def fresnel(cosine: F64, index: float) -> F64:
    """Reflected share of unpolarised light at a dielectric (Walter et al. 2007, eq. 22)."""
    g = np.sqrt(index * index - 1 + cosine * cosine)
    ratio = (cosine * (g + cosine) - 1) / (cosine * (g - cosine) + 1)
    made: F64 = 0.5 * ((g - cosine) / np.maximum(g + cosine, 1e-12)) ** 2 * (1 + ratio * ratio)
    return made


def mean_fresnel(index: npt.ArrayLike) -> F64:
    """F̄ of a dielectric, closed form (Duntley 1942, in d'Eon's "Hitchhiker's Guide", 2021); index > 1."""
    n = np.maximum(np.asarray(index, np.float64), 1.001)
    made: F64 = 0.5 + (n - 1) * (3 * n + 1) / (6 * (n + 1) ** 2)
    made = made + n**2 * (n**2 - 1) ** 2 / (n**2 + 1) ** 3 * np.log((n - 1) / (n + 1))
    made = made - 2 * n**3 * (n**2 + 2 * n - 1) / ((n**2 + 1) * (n**4 - 1))
    made += 8 * n**4 * (n**4 + 1) / ((n**2 + 1) * (n**4 - 1) ** 2) * np.log(n)
    return made


def surviving(mean: Any, average: Any) -> Any:
    """F_ms of F̄ and Ē."""
    return mean * mean * average / (1 - mean * (1 - average))


def hemispherical(values: Any, alpha: float) -> float:
    """2 ∫ f(μ) μ dμ of a function of cosines (N,) that may change within α of grazing."""
    grade = np.log(1 / alpha) + 4
    mu = np.expm1(grade * (_FINE_NODES + 1) / 2) / np.expm1(grade)
    stretch = grade * np.exp(grade * (_FINE_NODES + 1) / 2) / np.expm1(grade)
    return float((_FINE_WEIGHTS * stretch * mu * values(mu)).sum())


@dataclass(frozen=True)
class Missing:
    """1 − E of an α as a `curves.fit` of power 2, and 1 − Ē of that fit."""

    curve: F32
    average: float

    @property
    def share(self) -> float:
        """What the product of two 1 − E is multiplied with."""
        return 1 / (np.pi * self.average)


def left_out(found: F32, mu: npt.ArrayLike) -> F64:
    """(N,) 1 − E as kernels have it: `lost` for many cosines."""
    return np.clip(at(found, mu, 2), 0.0, 1.0)


@functools.cache
def _missing() -> Family:
    """1 − E by the roughness √α."""
    return Family.of(
        lambda root, mu: 1 - bounce(mu, root * root)[0], lambda root: 5 * root * root, _LEAST_ROOT, 1.0, 2
    )


@functools.cache
def _rims() -> Family:
    """`rim_share` by the roughness √α."""
    return Family.of(
        lambda root, mu: rim_share(mu, root * root), lambda root: 0.07 + 0.7 * root, _LEAST_ROOT, 1.0
    )


@functools.lru_cache(KEPT)
def missing(alpha: float) -> Missing:
    """What one bounce leaves out."""
    found = _missing().at(math.sqrt(alpha))
    found.flags.writeable = False
    return Missing(found, hemispherical(lambda mu: left_out(found, mu), alpha))


@dataclass(frozen=True)
class Rim:
    """`rim_share` of an α as a `curves.fit`, and 1 − Ȳ, the mean of what it leaves below."""

    curve: F32
    below: float


@functools.lru_cache(KEPT)
def rim(alpha: float) -> Rim:
    """What the edge's part of Schlick's term takes: Y(μ) = E(μ) · rim_share(μ)."""
    found, gap = _rims().at(math.sqrt(alpha)), missing(alpha).curve
    found.flags.writeable = False

    def below(mu: F64) -> F64:
        return 1 - (1 - left_out(gap, mu)) * np.clip(at(found, mu), 0.0, 1.0)

    return Rim(found, hemispherical(below, alpha))


@functools.lru_cache(KEPT)
def mean_passage(alpha: float, index: float) -> F32:
    """A `curves.fit` of 1 − Fresnel's term, averaged over the facets that one bounce returns."""
    found = fit(lambda mu: _passage(mu, alpha, index), 0.15 + alpha, min(LEAST_MU, 1e-6 / alpha))
    found.flags.writeable = False
    return found


@functools.lru_cache(8)
def mean_passages(index: float) -> Family:
    """`mean_passage` by the roughness √α, within 1e-3 of it (in the mean 1e-4): for many roughnesses."""

    def values(root: float, mu: F64) -> F64:
        alpha = root * root
        return _passage(np.maximum(mu, min(LEAST_MU, 1e-6 / alpha)), alpha, index)

    return Family.of(values, lambda root: 0.1 + root, _LEAST_ROOT, 1.0)


def _passage(mu: F64, alpha: float, index: float) -> F64:
    mirrors, reflected = bounce(mu, alpha, index)
    return np.asarray(1 - reflected / mirrors)


@kernel
def lost(cosine: np.float32, c: Any) -> np.float32:
    """1 − E(cosine); c is the tuple of `Missing.curve`."""
    s = place(cosine, c)
    made: np.float32 = min(max(s * s * curve(s, c), ZERO), ONE)
    return made


@kernel
def below_rim(cosine: np.float32, missed: np.float32, c: Any) -> np.float32:
    """1 − Y(cosine), given 1 − E there; c is the tuple of `Rim.curve`."""
    share = min(max(curve(place(cosine, c), c), ZERO), ONE)
    made: np.float32 = ONE - (ONE - missed) * share
    return made


AVERAGE: F64 = np.array(
    [
        *(0.8794570335, -0.357335352, -0.2871309249, 0.053618633, 0.1243212107, -0.0051732239, -0.0368036189),
        *(-0.0045121381, 0.0131128288, 0.0009737382, -0.0057391502, 0.0007465328, 0.001099679),
    ]
)
"""Ē as a polynomial of the roughness from the constant up; `fitted_average` makes it again."""


def _missed(alpha: float, mu: F64) -> F64:
    return 1 - bounce(mu, alpha)[0]


def fitted_average() -> F64:
    """(13,) the polynomial through Ē at 33 roughnesses, in powers of 2 · roughness − 1."""
    x = np.cos((np.arange(33) + 0.5) * np.pi / 33)
    values = [1 - hemispherical(functools.partial(_missed, a), a) for a in map(alpha_of, (x + 1) / 2)]
    return np.asarray(np.polynomial.chebyshev.cheb2poly(np.polynomial.chebyshev.chebfit(x, values, 12)))


def average_bounce(roughness: npt.ArrayLike) -> F32:
    """Ē for roughnesses of any shape, within 1e-5."""
    x = 2 * np.clip(np.asarray(roughness, np.float32), 0, 1) - 1
    return np.asarray(np.polynomial.polynomial.polyval(x, AVERAGE.astype(np.float32)), np.float32)
