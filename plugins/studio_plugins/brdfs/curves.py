"""Smooth functions of a cosine as short polynomials, which a kernel evaluates without tables or branches.

What rough surfaces return varies on two scales: over the whole quarter turn, and within about α of grazing.
s = k / (μ + k) stretches the second, and a root of it draws both together where they are far apart; along
these, thirteen coefficients are enough. A `Family` has such curves for every roughness.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
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
FEW_NODES = 32
KNOTS = 16


def fit(values: Callable[[F64], F64], k: float, least: float = 0.0, power: int = 0, root: int = 1) -> F32:
    """(SIZE,) k, then what maps s^(1/root) to −1…1, then the polynomial's coefficients from the constant up.

    `values` of cosines (N,) is approximated as s^power times the polynomial between `least` and 1, at
    Chebyshev's nodes of s^(1/root).
    """
    return _packed(k, least, root, _polynomial(values, k, least, power, root, NODES))


def _ends(k: float, least: float, root: int) -> tuple[float, float]:
    """s^(1/root) at 1 and at `least`."""
    return (k / (1 + k)) ** (1 / root), (k / (least + k)) ** (1 / root)


def _polynomial(
    values: Callable[[F64], F64], k: float, least: float, power: int, root: int, nodes: int
) -> F64:
    low, high = _ends(k, least, root)
    x = np.cos((np.arange(nodes) + 0.5) * np.pi / nodes)
    s = (low + (high - low) * (x + 1) / 2) ** root
    mu = np.clip(k / s - k, max(least, 1e-9), 1.0)
    found = np.polynomial.chebyshev.chebfit(x, values(mu) / s**power, DEGREE, w=s**0.25)
    made = np.zeros(DEGREE + 1)
    converted = np.polynomial.chebyshev.cheb2poly(found)
    made[: len(converted)] = converted
    return made


def _packed(k: float, least: float, root: int, coefficients: F64) -> F32:
    low, high = _ends(k, least, root)
    slope = 2 / (high - low)
    return np.array([k, slope, -1 - slope * low, *coefficients], np.float32)


@dataclass(frozen=True, eq=False)
class Family:
    """Curves that change smoothly with a number: fits at a few, and polynomials of it between these.

    `table` (KNOTS, DEGREE + 1) has in column j Chebyshev's coefficients, over numbers from `low` to `high`,
    of the coefficient j of `fit`; `k` is that of a number.
    """

    table: F64
    k: Callable[[float], float]
    low: float
    high: float
    root: int

    @classmethod
    def of(
        cls,
        values: Callable[[float, F64], F64],
        k: Callable[[float], float],
        low: float,
        high: float,
        power: int = 0,
        root: int = 1,
    ) -> Family:
        """Of values(number, cosines (N,))."""
        y = np.cos((np.arange(KNOTS) + 0.5) * np.pi / KNOTS)
        rows = []
        for number in (low + (high - low) * (y + 1) / 2).tolist():

            def one(mu: F64, number: float = number) -> F64:
                return values(number, mu)

            rows.append(_polynomial(one, k(number), 0.0, power, root, FEW_NODES))
        table = np.asarray(np.polynomial.chebyshev.chebfit(y, np.array(rows), KNOTS - 1), np.float64)
        return cls(table, k, low, high, root)

    def at(self, number: float) -> F32:
        """(SIZE,) the curve of a number, as `fit` makes it."""
        held = min(max(number, self.low), self.high)
        y = 2 * (held - self.low) / (self.high - self.low) - 1
        found = np.asarray(np.polynomial.chebyshev.chebval(y, self.table), np.float64)
        return _packed(self.k(held), 0.0, self.root, found)


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
