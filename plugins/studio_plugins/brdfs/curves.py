"""Smooth functions of a cosine as short polynomials, which a kernel evaluates without tables or branches.

What rough surfaces return varies on two scales: over the whole quarter turn, and within about α of grazing.
s = k / (μ + k) stretches the second, and its fourth root draws both together where they are far apart;
along these, thirteen coefficients are enough.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt

from studio_core.jit import kernel
from studio_core.kernels.brdf import ONE

F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]

DEGREE = 12
SIZE = 3 + DEGREE + 1
NODES = 96


def fit(values: Callable[[F64], F64], k: float, least: float = 0.0, power: int = 0, root: int = 1) -> F32:
    """(SIZE,) k, then what maps s^(1/root) to −1…1, then the polynomial's coefficients from the constant up.

    `values` of cosines (N,) is approximated as s^power times the polynomial between `least` and 1, at
    Chebyshev's nodes of s^(1/root).
    """
    high, low = (k / (least + k)) ** (1 / root), (k / (1 + k)) ** (1 / root)
    x = np.cos((np.arange(NODES) + 0.5) * np.pi / NODES)
    s = (low + (high - low) * (x + 1) / 2) ** root
    mu = np.clip(k / s - k, max(least, 1e-9), 1.0)
    v = values(mu) / s**power
    found = np.polynomial.chebyshev.chebfit(x, v, DEGREE, w=s**0.25)
    slope = 2 / (high - low)
    made = [k, slope, -1 - slope * low, *np.polynomial.chebyshev.cheb2poly(found)]
    return np.array(made + [0.0] * (SIZE - len(made)), np.float32)


@kernel
def place(cosine: np.float32, c: Any) -> np.float32:
    """s of a cosine; c is the tuple of a fit's numbers."""
    made: np.float32 = c[0] / (cosine + c[0])
    return made


@kernel
def curve(q: np.float32, c: Any) -> np.float32:
    """The polynomial at q = s^(1/root)."""
    x = min(c[1] * q + c[2], ONE)
    high = c[11] + x * (c[12] + x * (c[13] + x * (c[14] + x * c[15])))
    high = c[7] + x * (c[8] + x * (c[9] + x * (c[10] + x * high)))
    made: np.float32 = c[3] + x * (c[4] + x * (c[5] + x * (c[6] + x * high)))
    return made


@kernel
def taken(shape: Any, start: int) -> Any:
    """The numbers of a fit from an array, as the tuple that `curve` takes."""
    s = shape[start : start + 16]
    low = (s[0], s[1], s[2], s[3], s[4], s[5], s[6], s[7])
    return (*low, s[8], s[9], s[10], s[11], s[12], s[13], s[14], s[15])


def at(c: F32, mu: npt.ArrayLike, power: int = 0, root: int = 1) -> F64:
    """What kernels make of a fit, for cosines (N,)."""
    n = np.asarray(c, np.float64)
    s = n[0] / (np.asarray(mu, np.float64) + n[0])
    x = np.minimum(n[1] * s ** (1 / root) + n[2], 1.0)
    made: F64 = s**power * np.polynomial.polynomial.polyval(x, n[3:])
    return made
