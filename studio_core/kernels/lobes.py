"""Draws and densities of whole batches, lobe by lobe: what `SampledBrdf` functions are put together from.

Everywhere o (3,) is the direction of sight, u = u0[count], u1[count], w = x[count], y[count], z[count]
and d (count,) a row of densities. Where o is not above the surface, draws give z ≤ 0 and densities are 0.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from studio_core.jit import kernel
from studio_core.kernels.brdf import (
    HALF,
    LEAST_HEIGHT,
    ONE,
    TWO,
    ZERO,
    ggx_distribution,
    power_of_complement,
    smith_factor,
)
from studio_core.kernels.sampling import (
    TURN,
    around_mirror,
    around_normal,
    bounced_density,
    bounced_direction,
    cosine_density,
    cosine_direction,
    power_height,
    reflected,
    visible_normal,
)

F = np.float32
_LEAST_SHARE, _ROUGH_SHARE = np.float32(0.02), np.float32(0.4)
_BELOW_ONE = np.float32(1 - 2**-24)


@kernel
def draw_cosine(o: Any, u: Any, w: Any) -> None:
    """By the cosine: for matte lobes."""
    count = len(u) // 2
    for k in range(count):
        x, y, z = cosine_direction(u[k], u[count + k])
        w[k], w[count + k] = x, y
        w[2 * count + k] = z if o[2] > ZERO else -ONE


@kernel
def weigh_cosine(o: Any, w: Any, d: Any) -> None:
    """Density of `draw_cosine`."""
    count = len(d)
    z = w[2 * count :]
    seen = ONE if o[2] > ZERO else ZERO
    for k in range(count):
        d[k] = seen * cosine_density(z[k])


@kernel
def draw_mirror_power(o: Any, n: F, u: Any, w: Any) -> None:
    """By cos^n a of the angle a to the mirror direction."""
    count = len(u) // 2
    for k in range(count):
        x, y, z = around_mirror(o[0], o[1], o[2], power_height(u[k], n), u[count + k])
        w[k], w[count + k] = x, y
        w[2 * count + k] = z if o[2] > ZERO else -ONE


@kernel
def weigh_mirror_power(o: Any, n: F, w: Any, d: Any) -> None:
    """Density of `draw_mirror_power`: (n + 1) / 2π · cos^n a."""
    count = len(d)
    x, y, z = w[:count], w[count : 2 * count], w[2 * count :]
    ox, oy, oz = o[0], o[1], o[2]
    peak = (n + ONE) / TURN
    for k in range(count):
        dx, dy, dz = x[k] + ox, y[k] + oy, z[k] - oz
        lit = ONE if (oz > ZERO and z[k] > ZERO) else ZERO
        t = HALF * (dx * dx + dy * dy + dz * dz)  # 1 − cos a
        d[k] = lit * peak * power_of_complement(t, ONE - t, n)


@kernel
def draw_half_power(o: Any, n: F, u: Any, w: Any) -> None:
    """Reflected at half vectors drawn by (n·h)^n."""
    count = len(u) // 2
    for k in range(count):
        hx, hy, hz = around_normal(power_height(u[k], n), u[count + k])
        facing = o[0] * hx + o[1] * hy + o[2] * hz > ZERO
        x, y, z = reflected(o[0], o[1], o[2], hx, hy, hz)
        w[k], w[count + k] = x, y
        w[2 * count + k] = z if (facing and o[2] > ZERO) else -ONE


@kernel
def weigh_half_power(o: Any, n: F, w: Any, d: Any) -> None:
    """Density of `draw_half_power`: (n + 1) / 2π · (n·h)^n / (4 ω_o·h)."""
    count = len(d)
    x, y, z = w[:count], w[count : 2 * count], w[2 * count :]
    ox, oy, oz = o[0], o[1], o[2]
    power, peak = HALF * n, (n + ONE) / (TWO * TURN)
    for k in range(count):
        lit = ONE if (oz > ZERO and z[k] > ZERO) else ZERO
        hx, hy, hz = x[k] + ox, y[k] + oy, max(z[k] + oz, LEAST_HEIGHT)
        flat, height = hx * hx + hy * hy, hz * hz
        whole = flat + height
        lobe = power_of_complement(flat / whole, height / whole, power)
        d[k] = lit * peak * lobe / np.sqrt(whole)


@kernel
def draw_visible(o: Any, ax: F, ay: F, u: Any, w: Any) -> None:
    """Reflected at GGX's visible normals of the roughnesses ax, ay along x and y."""
    count = len(u) // 2
    up = max(o[2], LEAST_HEIGHT)
    for k in range(count):
        hx, hy, hz = visible_normal(o[0], o[1], up, ax, ay, u[k], u[count + k])
        x, y, z = reflected(o[0], o[1], o[2], hx, hy, hz)
        w[k], w[count + k] = x, y
        w[2 * count + k] = z if o[2] > ZERO else -ONE


@kernel
def weigh_visible(o: Any, alpha: F, w: Any, d: Any) -> None:
    """Density of `draw_visible` for one roughness: G1(ω_o) D(h) / (4 n·ω_o)."""
    count = len(d)
    x, y, z = w[:count], w[count : 2 * count], w[2 * count :]
    ox, oy, up = o[0], o[1], max(o[2], ZERO)
    scale = HALF * smith_factor(up, alpha)
    for k in range(count):
        lit = ONE if (up > ZERO and z[k] > ZERO) else ZERO
        height = max(max(z[k], ZERO) + up, LEAST_HEIGHT)
        d[k] = lit * scale * ggx_distribution(x[k] + ox, y[k] + oy, height, alpha)


@kernel
def draw_bounced(o: Any, alpha: F, u: Any, w: Any) -> None:
    """As light leaves that bounced between GGX facets: flat for small α."""
    count = len(u) // 2
    for k in range(count):
        x, y, z = bounced_direction(alpha, u[k], u[count + k])
        w[k], w[count + k] = x, y
        w[2 * count + k] = z if o[2] > ZERO else -ONE


@kernel
def weigh_bounced(o: Any, alpha: F, w: Any, d: Any) -> None:
    """Density of `draw_bounced`."""
    count = len(d)
    z = w[2 * count :]
    seen = ONE if o[2] > ZERO else ZERO
    for k in range(count):
        d[k] = seen * bounced_density(alpha, z[k])


@kernel
def draw_skin(o: Any, alpha: F, u: Any, w: Any) -> None:
    """By `draw_visible` and, the rougher the more, by `draw_bounced`: for both in one term."""
    count = len(u) // 2
    share, up = _bounced_share(alpha), max(o[2], LEAST_HEIGHT)
    for k in range(count):
        if u[k] < share:
            x, y, z = bounced_direction(alpha, min(u[k] / share, _BELOW_ONE), u[count + k])
        else:
            u0 = min((u[k] - share) / (ONE - share), _BELOW_ONE)
            hx, hy, hz = visible_normal(o[0], o[1], up, alpha, alpha, u0, u[count + k])
            x, y, z = reflected(o[0], o[1], o[2], hx, hy, hz)
        w[k], w[count + k] = x, y
        w[2 * count + k] = z if o[2] > ZERO else -ONE


@kernel
def weigh_skin(o: Any, alpha: F, w: Any, d: Any) -> None:
    """Density of `draw_skin`."""
    count = len(d)
    z = w[2 * count :]
    share = _bounced_share(alpha)
    seen = share if o[2] > ZERO else ZERO
    weigh_visible(o, alpha, w, d)
    for k in range(count):
        d[k] = (ONE - share) * d[k] + seen * bounced_density(alpha, z[k])


@kernel
def _bounced_share(alpha: F) -> F:
    """Of the draws of a skin: about what one bounce leaves out, and never nothing."""
    made: F = _LEAST_SHARE + _ROUGH_SHARE * min(alpha, ONE)
    return made


__all__ = [
    "draw_bounced",
    "draw_cosine",
    "draw_half_power",
    "draw_mirror_power",
    "draw_skin",
    "draw_visible",
    "weigh_bounced",
    "weigh_cosine",
    "weigh_half_power",
    "weigh_mirror_power",
    "weigh_skin",
    "weigh_visible",
]
