"""What standing fibres return: the sheen of cloth, and what it takes away from the ground below.

Fibres are facets whose normals lie along the surface, D(h) = (2 + n) sin^n θ_h / 2π (Estevez & Kulla,
"Production Friendly Microfacet Sheen BRDF", 2017). Hidden behind one another by Smith's uncorrelated heights,

f = D(h) / (4 (A(μ_i) μ_o + A(μ_o) μ_i − μ_i μ_o)), A(μ) = ∫ D(m) max(ω·m, 0) dm,

which is D G / (4 μ_i μ_o) with G = 1 / (1 + Λ_i + Λ_o) and Λ = A / μ − 1 (Heitz 2014, eqs. 78 and 99): its
albedo E is 1 at grazing angles and below 1 elsewhere. A = 1 is the shortcut of Neubelt & Pettineo (2013),
which returns up to four times what arrives where the fibres are smooth.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from studio_plugins.brdfs.curves import Family, at
from studio_plugins.brdfs.facets import hemispherical

F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]

LEAST_ROUGHNESS = 0.07
_NODES, _WEIGHTS = (np.asarray(a) for a in np.polynomial.legendre.leggauss(48))
_PHI, _AROUND = (_NODES + 1) * np.pi / 2, _WEIGHTS * np.pi  # half a turn stands for both
_FINE_NODES, _FINE_WEIGHTS = (np.asarray(a) for a in np.polynomial.legendre.leggauss(128))
_LEAST_LOG = float(np.log(LEAST_ROUGHNESS))
_KEPT = 512


def power_of(roughness: float) -> float:
    """n = 1 / α, α = roughness²; the roughness not below LEAST_ROUGHNESS."""
    held = min(max(roughness, LEAST_ROUGHNESS), 1.0)
    return 1 / (held * held)


def seen(mu: npt.ArrayLike, n: float) -> F64:
    """(N,) A: the area of fibres that face a direction, hidden ones too; for cosines (N,)."""
    m = np.asarray(mu, np.float64)[:, None]
    theta = (_FINE_NODES + 1) * np.pi / 4
    across = np.sqrt(np.maximum(1 - m * m, 0.0)) * np.sin(theta)
    up = m * np.cos(theta)
    edge = np.arccos(np.clip(-up / np.maximum(across, 1e-300), -1.0, 1.0))  # of what faces, in azimuth
    facing = 2 * (across * np.sin(edge) + up * edge)
    density = (2 + n) / (2 * np.pi) * np.sin(theta) ** (n + 1)
    made: F64 = (density * facing * _FINE_WEIGHTS * np.pi / 4).sum(axis=1)
    return made


def returned(mu: npt.ArrayLike, n: float, area: F32) -> F64:
    """(N,) E of the fibres, whose A is the curve `area`, for cosines (N,) > 0."""
    t = (_NODES + 1) / 2
    down = (t * t)[:, None]  # denser towards the horizon
    share = (t * _WEIGHTS)[:, None] * _AROUND
    flat = np.sqrt(1 - down * down)
    facing = at(area, 1 - t * t, 0, 2)[:, None]
    made = np.empty(len(np.atleast_1d(mu)))
    for k, m in enumerate(np.atleast_1d(mu)):
        hx, hy = np.sqrt(1 - m * m) + flat * np.cos(_PHI), flat * np.sin(_PHI)
        level = hx * hx + hy * hy
        density = (2 + n) / (2 * np.pi) * (level / (level + (m + down) ** 2)) ** (n / 2)
        hidden = 4 * (facing * m + at(area, [1 - m], 0, 2)[0] * down - m * down)
        made[k] = (share * density * down / hidden).sum()
    return made


@dataclass(frozen=True)
class Pile:
    """n, A as a curve of √place(1 − μ), 1 − E as a curve of place(μ), and its mean over a white sky."""

    power: float
    area: F32
    through: F32
    average: float


def let_through(through: F32, mu: npt.ArrayLike) -> F64:
    """(N,) 1 − E as kernels have it."""
    return np.clip(at(through, mu), 0.0, 1.0)


@functools.cache
def _areas() -> Family:
    """A by the logarithm of the roughness."""

    def area(log: float, rise: F64) -> F64:
        return seen(1 - rise, power_of(np.exp(log)))

    return Family.of(area, np.exp, _LEAST_LOG, 0.0, root=2)


@functools.cache
def _passages() -> Family:
    """1 − E, likewise."""

    def passing(log: float, mu: F64) -> F64:
        return 1 - returned(mu, power_of(np.exp(log)), _areas().at(log))

    return Family.of(passing, lambda log: 0.3 * np.exp(log), _LEAST_LOG, 0.0)


@functools.lru_cache(_KEPT)
def pile(roughness: float) -> Pile:
    """All that kernels need of a roughness: some 30 ms for the first, 0.1 ms for others."""
    log = float(np.log(max(roughness, LEAST_ROUGHNESS)))
    area, through = _areas().at(log), _passages().at(log)
    average = hemispherical(lambda mu: let_through(through, mu), 0.01)
    area.flags.writeable = through.flags.writeable = False
    return Pile(power_of(roughness), area, through, average)


__all__ = ["LEAST_ROUGHNESS", "Pile", "let_through", "pile", "power_of", "returned", "seen"]
