"""What light a `Surface` sends where, by the letter of glTF 2.0 and its extensions, in float64.

Khronos glTF 2.0, Appendix B (metallic-roughness: GGX with height-correlated Smith masking, Schlick's Fresnel
term, a matte part under it), KHR_materials_specular, _ior, _anisotropy, _clearcoat and _sheen (fibres by
Estevez & Kulla 2017, the base scaled by the sheen's albedo). Beyond it the matte part is EON
(Portsmouth, Kutz & Hill 2024) where it is rough, and metals have the dip before grazing of Kutz, Hašan &
Edmondson 2021, both as OpenPBR has them. Renderers differ in what they add, such as light that bounces
between facets. It is here to say how far a surface that was written is from the material that was meant.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from studio_core.exchange.surface import Surface

F64 = npt.NDArray[np.float64]
LEAST_ALPHA = 1e-4
LEAST_FIBRES = 0.07**2
_COAT = 0.04


def reflectance(surface: Surface, wi: npt.ArrayLike, wo: npt.ArrayLike) -> F64:
    """(N, 3) f_r in 1/sr for unit wi, wo (N, 3); pictures are taken as their means; 0 below the horizon."""
    mean = surface.mean()
    light, view = np.asarray(wi, np.float64), np.asarray(wo, np.float64)
    lit = (light[:, 2] > 0) & (view[:, 2] > 0)
    down, up = np.maximum(light[:, 2], 1e-6), np.maximum(view[:, 2], 1e-6)
    half = light + view
    length = np.linalg.norm(half, axis=1)
    half = half / np.maximum(length, 1e-12)[:, None]
    away = (1 - np.clip(length / 2, 0, 1)) ** 5
    made = _base(mean, light, view, half, away, down, up)
    if mean.clearcoat > 0:
        share = (mean.clearcoat * (_COAT + (1 - _COAT) * (1 - up) ** 5))[:, None]
        alpha = max(mean.clearcoat_roughness**2, LEAST_ALPHA)
        made = made * (1 - share) + share * _lobe(half, light, view, alpha, alpha)[:, None]
    if max(mean.sheen_color) > 0:
        alpha = max(mean.sheen_roughness**2, LEAST_FIBRES)
        strongest = max(mean.sheen_color)
        kept = 1 - strongest * np.maximum(_sheen_albedo(alpha, up), _sheen_albedo(alpha, down))
        fibres = _charlie(half[:, 2], alpha) * _between(down, up, alpha)
        made = made * np.maximum(kept, 0)[:, None] + np.asarray(mean.sheen_color) * fibres[:, None]
    return np.asarray(np.where(lit[:, None], made, 0.0))


def _base(s: Surface, light: F64, view: F64, half: F64, away: F64, down: F64, up: F64) -> F64:
    along, across = (max(alpha, LEAST_ALPHA) for alpha in s.alphas)
    turn = np.radians(s.anisotropy_rotation)
    light, view, half = (_turned(v, turn) for v in (light, view, half))
    lobe = _lobe(half, light, view, along, across)[:, None]
    base, grazing = np.asarray(s.base_color), away[:, None]
    f0 = np.minimum(s.f0 * np.asarray(s.specular_color), 1) * s.specular
    fresnel = f0 + (s.specular - f0) * grazing
    matte = base / np.pi if s.diffuse_roughness <= 0 else _eon(base, s.diffuse_roughness, light, view)
    dielectric = (1 - fresnel.max(axis=1, keepdims=True)) * matte + fresnel * lobe
    dip = 7 * (7 / 6) ** 6 * (base + (1 - base) * (6 / 7) ** 5) * (1 - np.asarray(s.edge_tint))
    cosine = 1 - grazing**0.2
    metal = np.maximum(base + (1 - base) * grazing - dip * cosine * (1 - cosine) ** 6, 0) * lobe
    return np.asarray(dielectric * (1 - s.metallic) + metal * s.metallic)


def _turned(v: F64, turn: float) -> F64:
    """Directions in a frame that is turned about the normal."""
    c, s = np.cos(turn), np.sin(turn)
    return np.stack([c * v[:, 0] + s * v[:, 1], c * v[:, 1] - s * v[:, 0], v[:, 2]], axis=1)


def _lobe(h: F64, light: F64, view: F64, ax: float, ay: float) -> F64:
    """D V of anisotropic GGX, height-correlated (KHR_materials_anisotropy)."""
    slope = (h[:, 0] / ax) ** 2 + (h[:, 1] / ay) ** 2 + h[:, 2] ** 2
    density = 1 / (np.pi * ax * ay * slope**2)

    def stretched(v: F64) -> F64:
        return np.asarray(np.sqrt((ax * v[:, 0]) ** 2 + (ay * v[:, 1]) ** 2 + v[:, 2] ** 2))

    shadow = view[:, 2] * stretched(light) + light[:, 2] * stretched(view)
    return np.asarray(density * 0.5 / np.maximum(shadow, 1e-12))


def _charlie(cosine: Any, alpha: float) -> F64:
    sine = np.sqrt(np.maximum(1 - np.asarray(cosine) ** 2, 0))
    return np.asarray((2 + 1 / alpha) * sine ** (1 / alpha) / (2 * np.pi))


def _between(down: F64, up: F64, alpha: float) -> F64:
    """V = G / (4 cos cos) by the published fit of Λ."""
    weight = (1 - alpha) ** 2
    ends = ((21.5473, 25.3245), (3.82987, 3.32435), (0.19823, 0.16801), (-1.9776, -1.27393))
    a, b, c, d, e = (x + (y - x) * weight for x, y in (*ends, (-4.32054, -4.85967)))

    def curve(x: Any) -> Any:
        return a / (1 + b * x**c) + d * x + e

    def smith(x: F64) -> F64:
        steep = np.exp(2 * curve(0.5) - curve(np.maximum(1 - x, 1e-9)))
        return np.asarray(np.where(x < 0.5, np.exp(curve(np.maximum(x, 1e-9))), steep))

    return np.asarray(1 / ((1 + smith(down) + smith(up)) * 4 * down * up))


def _sheen_albedo(alpha: float, cosine: F64) -> F64:
    """∫ D V cos over the hemisphere of a white sheen, by the midpoint rule over 48 × 48 directions."""
    mu = (np.arange(24) + 0.5) / 24
    z, turn = np.meshgrid((np.arange(48) + 0.5) / 48, np.pi * (np.arange(48) + 0.5) / 48)
    wi = np.stack([np.sqrt(1 - z * z) * np.cos(turn), np.sqrt(1 - z * z) * np.sin(turn), z], -1)
    found = []
    for m in mu:
        half = wi + np.array([np.sqrt(1 - m * m), 0, m])
        up = half[..., 2] / np.maximum(np.linalg.norm(half, axis=-1), 1e-9)
        values = _charlie(up, alpha) * _between(z, np.full_like(z, m), alpha) * z
        found.append(float(values.mean() * 2 * np.pi))
    return np.asarray(np.interp(cosine, mu, found))


def _eon(base: F64, r: float, light: F64, view: F64) -> F64:
    """Energy-preserving Oren–Nayar (Portsmouth, Kutz & Hill 2024, section 3)."""
    a = 1 / (1 + (0.5 - 2 / (3 * np.pi)) * r)

    def albedo(mu: F64) -> F64:
        theta = np.arccos(np.clip(mu, 0, 1))
        sine = np.sin(theta)
        g = sine * (theta - sine * mu)
        g = g + 2 / 3 * (sine / np.maximum(mu, 1e-6) * (1 - sine**3) - sine)
        return np.asarray(a * (1 + r * g / np.pi))

    down, up = light[:, 2], view[:, 2]
    s = (light * view).sum(axis=1) - down * up
    t = np.where(s > 0, np.maximum(np.maximum(down, up), 1e-6), 1)
    single = base * (a / np.pi * (1 + r * s / t))[:, None]
    mean = a * (1 + (2 / 3 - 28 / (15 * np.pi)) * r)
    bounced = (1 - albedo(down)) * (1 - albedo(up)) / (np.pi * (1 - mean))
    return np.asarray(single + base**2 * mean / (1 - base * (1 - mean)) * bounced[:, None])
