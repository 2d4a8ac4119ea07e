"""Real spherical harmonics: orthonormal on the sphere, l² + l + m numbers them, any number of bands.

Y_l0 = P̄_l0(z); for m > 0, Y_lm = √2 P̄_lm cos(mφ) and Y_l−m = √2 P̄_lm sin(mφ), where P̄ are the associated
Legendre functions normalised to 1 over the sphere, without the Condon–Shortley sign, made by the recurrence
P̄_lm = a_lm (z P̄_l−1,m − b_lm P̄_l−2,m), a² = (4l² − 1) / (l² − m²), b² = ((l−1)² − m²) / (4(l−1)² − 1).
"""

from __future__ import annotations

import functools
import math

import numpy as np
import numpy.typing as npt

from studio_core.jit import kernel

F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]

MOST_BANDS = 8


def _tables() -> tuple[F64, F64, F64]:
    """a, b (bands, bands) and P̄_mm without (sin θ)^m, times √2 for m > 0."""
    a, b = np.zeros((MOST_BANDS, MOST_BANDS)), np.zeros((MOST_BANDS, MOST_BANDS))
    first = np.empty(MOST_BANDS)
    first[0] = math.sqrt(0.25 / math.pi)
    for m in range(MOST_BANDS):
        if m:
            first[m] = first[m - 1] * math.sqrt((2 * m + 1) / (2 * m))
        for band in range(m + 1, MOST_BANDS):
            a[band, m] = math.sqrt((4 * band**2 - 1) / (band**2 - m**2))
            b[band, m] = math.sqrt(((band - 1) ** 2 - m**2) / (4 * (band - 1) ** 2 - 1))
    first[1:] *= math.sqrt(2.0)
    return a, b, first


_A, _B, _FIRST = _tables()


@kernel
def harmonics(x: float, y: float, z: float, bands: int, out: F64) -> None:
    """Fills out (bands²,) with all functions of a unit direction."""
    cosine, sine = 1.0, 0.0  # of mφ, times (sin θ)^m
    for m in range(bands):
        low, high = 0.0, _FIRST[m]
        for band in range(m, bands):
            if band > m:
                low, high = high, _A[band, m] * (z * high - _B[band, m] * low)
            middle = band * band + band
            out[middle + m] = high * cosine
            if m > 0:
                out[middle - m] = high * sine
        cosine, sine = x * cosine - y * sine, x * sine + y * cosine


@kernel
def _of_all(directions: F64, bands: int, out: F64) -> None:
    for i in range(len(directions)):
        harmonics(directions[i, 0], directions[i, 1], directions[i, 2], bands, out[i])


def harmonics_of(directions: npt.ArrayLike, bands: int) -> F64:
    """(N, bands²) the functions of unit directions (N, 3)."""
    if not 1 <= bands <= MOST_BANDS:
        raise ValueError(f"there are 1 to {MOST_BANDS} bands, not {bands}")
    given = np.ascontiguousarray(directions, np.float64).reshape(-1, 3)
    made = np.empty((len(given), bands * bands))
    _of_all(given, bands, made)
    return made


@functools.cache
def cosine_lobe(bands: int) -> F64:
    """(bands²,) the factors A_l of irradiance: E(n) = Σ A_l L_lm Y_lm(n) (Ramamoorthi, Hanrahan 2001)."""
    made = []
    for band in range(bands):
        if band == 1:
            size = 2 * math.pi / 3
        elif band % 2:
            size = 0.0
        else:
            half = band // 2
            size = (-1) ** (half - 1) / ((band + 2) * (band - 1)) if band else 0.5
            size *= 2 * math.pi * math.factorial(band) / (2**band * math.factorial(half) ** 2)
        made += [size] * (2 * band + 1)
    found = np.array(made)
    found.setflags(write=False)
    return found


@functools.cache
def probes(bands: int) -> tuple[F64, F64]:
    """Directions (Q, 3) that tell functions of so many bands apart, and what makes coefficients of values."""
    count = bands * (bands + 2)
    z = 1 - (2 * np.arange(count) + 1) / count
    turn = np.arange(count) * (math.pi * (3 - math.sqrt(5)))
    flat = np.sqrt(1 - z * z)
    directions = np.stack([flat * np.cos(turn), flat * np.sin(turn), z], axis=1)
    return directions, np.asarray(np.linalg.pinv(harmonics_of(directions, bands)), np.float64)


def rotations(turns: npt.ArrayLike, bands: int) -> F64:
    """(N, bands², bands²) that make coefficients of f(Rᵀ ω) from those of f(ω), for rotations R (N, 3, 3).

    R leads from the frame in which f is known to the other: fields turn with their object.
    """
    given = np.asarray(turns, np.float64).reshape(-1, 3, 3)
    directions, inverse = probes(bands)
    back = np.einsum("nij,qi->nqj", given, directions)  # Rᵀ ω
    values = harmonics_of(back.reshape(-1, 3), bands).reshape(len(given), len(directions), -1)
    made: F64 = np.einsum("sq,nqt->nst", inverse, values)
    return made


__all__ = ["MOST_BANDS", "cosine_lobe", "harmonics", "harmonics_of", "probes", "rotations"]
