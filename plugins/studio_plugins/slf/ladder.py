"""The gloss levels that are tried: twenty steps that look alike.

Distinctness of gloss is 1 − α, with α the roughness of Ward's model (Pellacini, Ferwerda & Greenberg 2000),
so steps are equal in α: from 0.816 to 0.05, exponents of Phong's model from 1 to 798.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

F64 = npt.NDArray[np.float64]
LEVELS = 20
DULL, SHARP = 0.816, 0.05


def alpha_of_level(level: npt.ArrayLike) -> F64:
    """α of real levels 0 … LEVELS − 1."""
    share = np.asarray(level, np.float64) / (LEVELS - 1)
    return np.asarray(DULL + share * (SHARP - DULL))


def level_of_alpha(alpha: npt.ArrayLike) -> F64:
    """The real level of α, at most the last and at least the first."""
    share = (np.asarray(alpha, np.float64) - DULL) / (SHARP - DULL)
    return np.asarray(np.clip(share, 0, 1) * (LEVELS - 1))


def exponent_of_alpha(alpha: npt.ArrayLike) -> F64:
    """Phong's exponent whose highlight is as wide: 2 / α² − 2."""
    return np.asarray(2 / np.asarray(alpha, np.float64) ** 2 - 2)


def alpha_of_exponent(exponent: npt.ArrayLike) -> F64:
    """The inverse of `exponent_of_alpha`."""
    return np.asarray(np.sqrt(2 / (np.asarray(exponent, np.float64) + 2)))
