"""The surface of other programs' kinds that comes nearest to any reflectance: fitted to samples of it.

Minimised is the metric of `brdfs.fitting` over colour, roughness, index and weight of the reflection, once
for what is no metal and once for metal: mixtures of the two would come nearer at times, but mean nothing.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from studio_core.brdfs.samples import Samples, compressed
from studio_core.exchange.reflectance import reflectance
from studio_core.exchange.surface import Surface, ior_of, stretched

F64 = npt.NDArray[np.float64]
MOST_SAMPLES = 800
HIGHEST_F0 = 0.25  # an index of 3: more is not known everywhere
_ROUGH = (0.15, 0.4, 0.8)
_STEPS = 20


def fitted(samples: Samples) -> Surface:
    """The nearest dielectric or metal."""
    some = samples.some(MOST_SAMPLES)
    matte = np.clip(np.pi * np.median(some.values, axis=0), 0.02, 0.98)
    hue = some.values.max(axis=0) / max(float(some.values.max()), 1e-9)
    found = [_solve(some, _dielectric, np.array([*matte, r, 0.2, w])) for r in _ROUGH for w in (0.05, 0.9)]
    found += [_solve(some, _metal, np.array([*np.clip(0.9 * hue, 0.02, 0.98), r])) for r in _ROUGH]
    return min(found, key=lambda one: one[0])[1]


def rescaled(made: Surface, samples: Samples, flattest: float = 0.0) -> Surface:
    """With the width of the highlight at which it comes nearest, all else as it is.

    `flattest`: cosine of the flattest directions that count.
    """
    from scipy.optimize import minimize_scalar

    rows = (samples.wi[:, 2] > flattest) & (samples.wo[:, 2] > flattest)
    kept = Samples(samples.wi[rows], samples.wo[rows], samples.values[rows], samples.weight[rows])
    some = kept.some(2 * MOST_SAMPLES)

    def scaled(power: float) -> Surface:
        along, across = made.alphas
        roughness, strength = stretched(along * np.exp(power), across * np.exp(power))
        return replace(made, roughness=roughness, anisotropy=strength)

    def metric(power: float) -> float:
        return float(np.square(_residual(scaled(power), some)).sum())

    found = minimize_scalar(metric, bounds=(-1.5, 1.5), method="bounded", options={"xatol": 0.01})
    return scaled(float(found.x))


def _dielectric(x: F64) -> Surface:
    base = (float(x[0]), float(x[1]), float(x[2]))
    return Surface(
        base_color=base, roughness=float(x[3]), ior=ior_of(HIGHEST_F0 * x[4]), specular=float(x[5])
    )


def _metal(x: F64) -> Surface:
    base = (float(x[0]), float(x[1]), float(x[2]))
    return Surface(base_color=base, metallic=1.0, roughness=float(x[3]))


def _residual(surface: Surface, samples: Samples) -> F64:
    made = reflectance(surface, samples.wi, samples.wo)
    off = compressed(made, samples.cosine) - compressed(samples.values, samples.cosine)
    root = np.sqrt(samples.weight / samples.weight.sum() / 3)[:, None]
    return np.asarray((off * root).ravel())


def _solve(samples: Samples, make: Callable[[F64], Surface], start: F64) -> tuple[float, Surface]:
    from scipy.optimize import least_squares

    done = least_squares(
        lambda x: _residual(make(x), samples), start, bounds=(0.0, 1.0), max_nfev=_STEPS, diff_step=1e-5
    )
    return float(done.cost), make(np.asarray(done.x))
