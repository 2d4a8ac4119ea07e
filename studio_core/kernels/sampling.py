"""How reflectance models draw directions: cosine, powers of a cosine, GGX by visible normals.

In the shading frame (z = normal), float32, from two numbers in [0, 1): maps are smooth, and periodic in the
second. As in `studio_core.kernels.brdf`, nothing is found as 1 − cos: draws are exact for mirrors and along
the surface. Densities are per steradian.
"""

from __future__ import annotations

import numpy as np

from studio_core.jit import kernel
from studio_core.kernels.brdf import (
    INV_PI,
    ONE,
    TWO,
    ZERO,
)

F = np.float32
Vector = tuple[np.float32, np.float32, np.float32]
TURN = np.float32(2 * np.pi)
LEAST_LENGTH = np.float32(1e-30)


@kernel
def cosine_direction(u0: F, u1: F) -> Vector:
    """A direction with density cos θ / π."""
    r = np.sqrt(u0)
    phi = TURN * u1
    return r * np.cos(phi), r * np.sin(phi), np.sqrt(ONE - u0)


@kernel
def cosine_density(z: F) -> F:
    """Density of `cosine_direction`."""
    return max(z, ZERO) * INV_PI


@kernel
def even_direction(u0: F, u1: F) -> Vector:
    """A direction of the hemisphere, all alike: density 1 / 2π."""
    return around_normal(u0, u1)


@kernel
def power_height(u0: F, n: F) -> F:
    """1 − cos θ of a direction with density (n + 1) / 2π · cos^n θ: 1 − (1 − u0)^(1 / (n + 1))."""
    made: F = -np.expm1(np.log1p(-u0) / (n + ONE))
    return made


@kernel
def around_normal(t: F, u1: F) -> Vector:
    """The direction with 1 − cos θ = t in the azimuth u1."""
    sine = np.sqrt(max(t * (TWO - t), ZERO))
    phi = TURN * u1
    return sine * np.cos(phi), sine * np.sin(phi), ONE - t


@kernel
def around_mirror(ox: F, oy: F, oz: F, t: F, u1: F) -> Vector:
    """The direction 1 − cos a = t away from the mirror direction (−ox, −oy, oz), in the azimuth u1."""
    squared = ox * ox + oy * oy
    level = squared <= LEAST_LENGTH
    reach = ZERO if level else np.sqrt(squared)
    flat = ONE if level else reach
    c, s = (ONE if level else ox / flat), (ZERO if level else oy / flat)
    ax, ay, az = around_normal(t, u1)
    along = reach * az - oz * ax  # towards the mirror, in the plane; ax leads to the normal
    return -along * c - ay * s, -along * s + ay * c, oz * az + reach * ax


@kernel
def reflected(ox: F, oy: F, oz: F, hx: F, hy: F, hz: F) -> Vector:
    """ω_o mirrored at the unit half vector: 2 (ω_o·h) h − ω_o, its height without cancellation."""
    level = ox * hx + oy * hy
    twice = TWO * (level + oz * hz)
    return twice * hx - ox, twice * hy - oy, TWO * level * hz + oz * (ONE - TWO * (hx * hx + hy * hy))


@kernel
def visible_normal(ox: F, oy: F, oz: F, ax: F, ay: F, u0: F, u1: F) -> Vector:
    """A unit normal of GGX with the roughnesses ax, ay, drawn as often as it is seen from ω_o, oz > 0.

    By spherical caps (Dupuy & Benyoub 2023, listing 3): D_o(h) = G1(ω_o) max(ω_o·h, 0) D(h) / oz.
    """
    x, y = ax * ox, ay * oy
    flat = x * x + y * y
    length = np.sqrt(flat + oz * oz)
    x, y, z = x / length, y / length, oz / length
    tall = ONE + z
    low = flat / (length * length * tall)  # 1 − z
    up = (ONE - u0) * tall  # height of the cap's direction, plus z
    sine = np.sqrt(max(u0 * tall * (up + low), ZERO))
    phi = TURN * u1
    hx, hy, hz = ax * (x + sine * np.cos(phi)), ay * (y + sine * np.sin(phi)), up
    size = np.sqrt(hx * hx + hy * hy + hz * hz)
    scale = ONE / max(size, LEAST_LENGTH)
    return hx * scale, hy * scale, hz * scale


@kernel
def bounced_direction(alpha: F, u0: F, u1: F) -> Vector:
    """A direction with density ∝ cos θ / (cos² θ + α²): about as light leaves GGX's facets after bounces."""
    a2 = alpha * alpha
    squared = min(a2 * np.expm1(u0 * np.log1p(ONE / a2)), ONE)
    r, phi = np.sqrt(ONE - squared), TURN * u1
    return r * np.cos(phi), r * np.sin(phi), np.sqrt(squared)


@kernel
def bounced_density(alpha: F, z: F) -> F:
    """Density of `bounced_direction`: cos θ / (π (cos² θ + α²) ln(1 + 1 / α²))."""
    a2 = alpha * alpha
    up = max(z, ZERO)
    made: F = up * INV_PI / ((up * up + a2) * np.log1p(ONE / a2))
    return made
