"""Densities of the bundled models' samplers in float64, by the textbook; directions as in `oracles.brdf`."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt
from oracles.brdf import Values, unit

Array = npt.NDArray[np.float64]


def cosine(wi: Array) -> Array:
    return np.maximum(wi[..., 2], 0) / np.pi


def lambert(values: Values, wo: Array, wi: Array) -> Array:
    return cosine(wi)[..., None]


def phong(values: Values, wo: Array, wi: Array) -> Array:
    n = float(values["exponent"])
    t = ((wi - wo * [-1, -1, 1]) ** 2).sum(-1) / 2  # 1 − cos a
    lobe = (n + 1) / (2 * np.pi) * np.maximum(1 - t, 0) ** n
    return np.stack([cosine(wi), lobe], -1)


def blinn_phong(values: Values, wo: Array, wi: Array) -> Array:
    n = float(values["exponent"])
    h = unit(wi + wo)
    lobe = (n + 2) / (2 * np.pi) * np.maximum(h[..., 2], 0) ** (n + 1) / (4 * (wo * h).sum(-1))
    return np.stack([cosine(wi), lobe], -1)


def visible_normals(ax: float, ay: float, wo: Array, h: Array) -> Array:
    """D_o(h) of GGX (Heitz 2018, eqs. 1–3): G1(ω_o) max(ω_o·h, 0) D(h) / cos θ_o."""
    x, y, z = h[..., 0] / ax, h[..., 1] / ay, h[..., 2]
    d = 1 / (np.pi * ax * ay * (x * x + y * y + z * z) ** 2)
    slope = ((ax * wo[..., 0]) ** 2 + (ay * wo[..., 1]) ** 2) / wo[..., 2] ** 2
    g1 = 2 / (1 + np.sqrt(1 + slope))
    return g1 * np.maximum((wo * h).sum(-1), 0) * d / wo[..., 2]


def ggx(values: Values, wo: Array, wi: Array) -> Array:
    alpha = max(float(values["roughness"]) ** 2, 1e-4)
    h = unit(wi + wo)
    lobe = visible_normals(alpha, alpha, wo, h) / (4 * (wo * h).sum(-1))
    bounced = bounced_density(alpha, wi)
    share = 0.02 + 0.4 * min(alpha, 1.0)
    return np.stack([cosine(wi), (1 - share) * lobe + share * bounced, lobe, bounced], -1)


def specgloss(values: Values, wo: Array, wi: Array) -> Array:
    return np.concatenate([ggx(values, wo, wi), cosine(wi)[..., None]], -1)


def bounced_density(alpha: float, wi: Array) -> Array:
    """∝ cos θ / (cos² θ + α²)."""
    return cosine(wi) / (wi[..., 2] ** 2 + alpha**2) / np.log1p(1 / alpha**2)


def visible_normal(wo: Array, ax: float, ay: float, u: Array) -> Array:
    """(N, 3) normals from u (N, 2): Dupuy & Benyoub 2023, listings 1 and 3, u swapped as in the program."""
    std = unit(wo * [ax, ay, 1])
    z = (1 - u[:, 0]) * (1 + std[2]) - std[2]
    sine, phi = np.sqrt(np.clip(1 - z * z, 0, 1)), 2 * np.pi * u[:, 1]
    cap = np.stack([sine * np.cos(phi), sine * np.sin(phi), z], -1)
    return unit((cap + std) * [ax, ay, 1])


DENSITIES: dict[str, Callable[[Any, Array, Array], Array]] = {
    "lambert": lambert,
    "phong": phong,
    "blinn-phong": blinn_phong,
    "ggx": ggx,
    "specgloss": specgloss,
}
