"""What reflectance kernels share: lobes that stay exact when they are sharp, GGX, Smith, Schlick.

Everything is float32 and branch-free, so that a loop over directions becomes vector code. Angles enter
as squared sines or half distances, never as 1 − cos: with exponents of 1e5 or α of 1e-4 the rounding of
a cosine near 1 would be as wide as the lobe.
"""

from __future__ import annotations

from typing import Any, cast

import numba
import numpy as np

from studio_core.jit import kernel

carray = cast(Any, numba).carray  # an array at a C pointer

SIGNATURE = "void(CPointer(float32), CPointer(float32), int64, CPointer(float32), CPointer(float32))"
"""Of the C function that `studio_core.contract.Brdf.address` names."""

SAMPLE_SIGNATURE = (
    "void(CPointer(float32), CPointer(float32), int64, int64, CPointer(float32), CPointer(float32))"
)
"""Of the C function that `studio_core.contract.SampledBrdf.sampler` names."""

DENSITY_SIGNATURE = SIGNATURE
"""Of the C function that `studio_core.contract.SampledBrdf.density` names."""

ZERO = np.float32(0.0)
HALF = np.float32(0.5)
ONE = np.float32(1.0)
TWO = np.float32(2.0)
INV_PI = np.float32(1 / np.pi)
LEAST_HEIGHT = np.float32(1e-7)  # of an unnormalised half vector over the surface

_QUARTER = np.float32(0.25)
_LOG2E_TWICE = np.float32(2 / np.log(2))
_A1, _A2, _A3 = np.float32(1 / 3), np.float32(1 / 5), np.float32(1 / 7)
_A4, _A5, _A6 = np.float32(1 / 9), np.float32(1 / 11), np.float32(1 / 13)
_E1, _E2, _E3 = (np.float32(np.log(2) ** k / d) for k, d in ((1, 1), (2, 2), (3, 6)))
_E4, _E5, _E6 = (np.float32(np.log(2) ** k / d) for k, d in ((4, 24), (5, 120), (6, 720)))
_LEAST_POWER = np.float32(-125.0)
_EXPONENT_BITS = np.int32(0x7F800000)
_MANTISSA_BITS = np.int32(0x007FFFFF)
_HALF_BITS = np.int32(0x3F000000)
_SHIFT, _BIAS, _HALF_BIAS = np.int32(23), np.int32(127), np.int32(126)


@kernel
def power_of_complement(t: np.float32, rest: np.float32, n: np.float32) -> np.float32:
    """(1 − t)^n for n ≥ 0, given t and rest = 1 − t; 0 where rest ≤ 0 or the result is below 1e-37.

    log(1 − z) = −2 artanh(z / (2 − z)) as a series; z is t itself while t is small, so nothing cancels.
    """
    m = max(rest, np.float32(1e-30))
    bits = np.float32(m).view(np.int32)
    mantissa = np.int32((bits & _MANTISSA_BITS) | _HALF_BITS).view(np.float32)  # [0.5, 1)
    exponent = np.float32(np.int32((bits & _EXPONENT_BITS) >> _SHIFT) - _HALF_BIAS)
    small = t < _QUARTER
    z = t if small else ONE - mantissa
    e = ZERO if small else exponent
    s = z / (TWO - z)
    q = s * s
    series = s * (ONE + q * (_A1 + q * (_A2 + q * (_A3 + q * (_A4 + q * (_A5 + q * _A6))))))
    y = n * (e - _LOG2E_TWICE * series)
    clamped = max(y, _LEAST_POWER)
    whole = np.floor(clamped)
    f = clamped - whole - HALF  # [-0.5, 0.5): the Taylor series of 2^f is exact to 1e-7 there
    scale = np.int32((np.int32(whole) + _BIAS) << _SHIFT).view(np.float32)
    fraction = ONE + f * (_E1 + f * (_E2 + f * (_E3 + f * (_E4 + f * (_E5 + f * _E6)))))
    made = scale * fraction * np.float32(1.4142135623730951)
    return made if (rest > ZERO and y > _LEAST_POWER) else ZERO


@kernel
def schlick_weight(cosine: np.float32) -> np.float32:
    """(1 − cosine)^5 with the cosine taken as 0…1: F90's part in Schlick's Fresnel term (1994, eq. 15)."""
    u = max(ONE - cosine, ZERO)
    u2 = u * u
    return u2 * u2 * u


@kernel
def ggx_distribution(x: np.float32, y: np.float32, z: np.float32, alpha: np.float32) -> np.float32:
    """D of GGX for an unnormalised half vector (Walter et al. 2007, eq. 33), per steradian.

    D = α² / (π (α² cos² + sin²)²), here α |h|² / (α² z² + x² + y²) squared over π: exact for α ≥ 1e-6.
    """
    flat = x * x + y * y
    height = max(z, LEAST_HEIGHT)
    up = height * height
    q = alpha * (flat + up) / (alpha * alpha * up + flat)
    return q * q * INV_PI


@kernel
def smith_factor(cosine: np.float32, alpha: np.float32) -> np.float32:
    """G1(cosine) / (2 cosine) of GGX (Walter et al. 2007, eq. 34): 1 / (c + √(α² + (1 − α²) c²)).

    The product of the two directions' factors is G / (4 (n·l) (n·v)), finite at grazing.
    """
    a2 = alpha * alpha
    made: np.float32 = ONE / (cosine + np.sqrt(a2 + (ONE - a2) * cosine * cosine))
    return made


_C0, _C1, _C2 = np.float32(1.5707963050), np.float32(-0.2145988016), np.float32(0.0889789874)
_C3, _C4, _C5 = np.float32(-0.0501743046), np.float32(0.0308918810), np.float32(-0.0170881256)
_C6, _C7 = np.float32(0.0066700901), np.float32(-0.0012624911)


@kernel
def arc_cosine(c: np.float32) -> np.float32:
    """arccos(c) of 0 ≤ c ≤ 1 within 2e-7: √(1 − c) times a polynomial (Abramowitz & Stegun 4.4.46)."""
    p = _C4 + c * (_C5 + c * (_C6 + c * _C7))
    p = _C0 + c * (_C1 + c * (_C2 + c * (_C3 + c * p)))
    made: np.float32 = p * np.sqrt(max(ONE - c, ZERO))
    return made


@kernel
def exponential(y: np.float32) -> np.float32:
    """e^y for y ≤ 0 within 1e-6 of the result; 0 below 1e-37."""
    power = y * np.float32(1 / np.log(2))
    clamped = max(power, _LEAST_POWER)
    whole = np.floor(clamped)
    f = clamped - whole - HALF
    scale = np.int32((np.int32(whole) + _BIAS) << _SHIFT).view(np.float32)
    fraction = ONE + f * (_E1 + f * (_E2 + f * (_E3 + f * (_E4 + f * (_E5 + f * _E6)))))
    return scale * fraction * np.float32(1.4142135623730951) if power > _LEAST_POWER else ZERO


@kernel
def dielectric_fresnel(cosine: np.float32, index2: np.float32) -> np.float32:
    """Reflected share of unpolarised light from outside; `index2` is the squared index of refraction ≥ 1.

    Walter et al. 2007, eq. 22. Total at grazing, and none where the index is 1.
    """
    c = min(cosine, ONE)
    g = np.sqrt(max(index2 - ONE, ZERO) + c * c)
    side = (g - c) / max(g + c, np.float32(1e-12))
    ratio = (c * (g + c) - ONE) / (c * (g - c) + ONE)
    made: np.float32 = HALF * side * side * (ONE + ratio * ratio)
    return made
