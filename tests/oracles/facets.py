"""GGX with the light that bounces between facets, in float64: no fits, but splines through many angles.

What one bounce returns is integrated by the program's own `bounce`, which `test_facets.py` holds against
brute force.
"""

from __future__ import annotations

import functools
from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.interpolate import CubicSpline

from studio_plugins.brdfs.facets import bounce, rim_share

Array = npt.NDArray[np.float64]
Values = Mapping[str, Any]

_X, _W = np.polynomial.legendre.leggauss(100)
_C = (_X + 1) / 2
_U = np.linspace(0, 1, 20001)[1:-1]


def fresnel(c: Array, index: float) -> Array:
    """Mean of both polarisations' reflectances, from Snell's law."""
    inside = np.sqrt(1 - (1 - c**2) / index**2)
    across = (c - index * inside) / (c + index * inside)
    along = (index * c - inside) / (index * c + inside)
    return (across**2 + along**2) / 2


def masking(c: Array, alpha: float) -> Array:
    """G1 of GGX."""
    return 2 / (1 + np.sqrt(1 + alpha**2 * (1 - c**2) / c**2))


class Table:
    """E, the reflected share of one bounce, and their means over a white sky."""

    def __init__(self, alpha: float, index: float | None) -> None:
        self.alpha = alpha
        top = np.log1p(1 / (0.3 * alpha))
        place = np.linspace(0, top, 120)
        mu = np.clip(0.3 * alpha * np.expm1(place), 1e-9, 1)
        bounces, reflected = bounce(mu, alpha, index)
        self._bounce = CubicSpline(place, bounces)
        self._reflected = CubicSpline(place, reflected)
        u = top * _C
        mu = 0.3 * alpha * np.expm1(u)
        weight = _W * top / 2 * 0.3 * alpha * np.exp(u) * 2 * mu
        self.missing = float((weight * (1 - self._bounce(u))).sum())  # 1 − Ē
        self.survives = 1.0
        if index is not None:
            mean = float((_W * _C * fresnel(_C, index)).sum())
            self.survives = mean**2 * (1 - self.missing) / (1 - mean * self.missing)
        self.through = float((weight * self.transmitted(mu)).sum())
        self.mu, self.weight = mu, weight

    def lost(self, mu: Array) -> Array:
        """1 − E."""
        return 1 - self._bounce(np.log1p(mu / (0.3 * self.alpha)))

    def transmitted(self, mu: Array) -> Array:
        """1 − all that is reflected."""
        return 1 - self._reflected(np.log1p(mu / (0.3 * self.alpha))) - self.survives * self.lost(mu)

    def multiple(self, no: Array, ni: Array) -> Array:
        """The lobe of several bounces between mirrors."""
        return self.lost(no) * self.lost(ni) / (np.pi * self.missing)


@functools.lru_cache(64)
def table(alpha: float, index: float | None = None) -> Table:
    """Kept by α and index."""
    return Table(alpha, index)


def _facets(values: Values, wo: Array, wi: Array) -> tuple[Array, Array, Array, Array, Array, float]:
    """above, n·o, n·i, o·h, D G / (4 …) and α; directions below are taken as upright."""
    above = (wo[..., 2] > 0) & (wi[..., 2] > 0)
    wo, wi = (
        np.where(above[..., None], w / np.linalg.norm(w, axis=-1, keepdims=True), [0, 0, 1]) for w in (wo, wi)
    )
    alpha = max(float(values["roughness"]) ** 2, 1e-4)
    h = wo + wi
    h = h / np.linalg.norm(h, axis=-1, keepdims=True)
    no, ni = wo[..., 2], wi[..., 2]
    sine = h[..., 0] ** 2 + h[..., 1] ** 2
    d = alpha**2 / (np.pi * (alpha**2 * h[..., 2] ** 2 + sine) ** 2)
    lobe = d * masking(no, alpha) * masking(ni, alpha) / (4 * no * ni)
    return above, no, ni, np.clip((wo * h).sum(-1), 0, 1), lobe, alpha


@functools.lru_cache(64)
def below_rim(alpha: float) -> tuple[CubicSpline, float]:
    """1 − Y by log(1 + μ / (0.3 α)), and its mean over a white sky."""
    place = np.linspace(0, np.log1p(1 / (0.3 * alpha)), 160)
    mu = np.clip(0.3 * alpha * np.expm1(place), 1e-9, 1)
    left = 1 - bounce(mu, alpha)[0] * rim_share(mu, alpha)
    found = CubicSpline(place, left)
    known = table(alpha)
    return found, float((known.weight * found(np.log1p(known.mu / (0.3 * alpha)))).sum())


def ggx(values: Values, wo: Array, wi: Array) -> Array:
    """(..., 3) f_r of `ggx`."""
    above, no, ni, oh, lobe, alpha = _facets(values, wo, wi)
    base = np.asarray(values["base_color"], np.float64)
    metallic, dielectric = float(values["metallic"]), 0.08 * float(values["specular"])
    f0 = dielectric * (1 - metallic) + base * metallic
    known = table(alpha)
    left, mean = below_rim(alpha)
    at = [left(np.log1p(mu / (0.3 * alpha))) for mu in (no, ni)]
    matte = (at[0] * at[1] / (np.pi * mean))[..., None] * base * (1 - metallic) * (1 - dielectric)
    linear = 0.54 - 0.81 * known.missing
    t = np.maximum(f0 - 0.08, 0) / 0.92
    survives = linear * f0 + (1 - linear) * 0.49 * t**2 / (1 - 0.51 * t)
    survives = survives + (1 - linear) * base * (1 - metallic) * dielectric
    survives = survives * float(values.get("keep_energy", True))
    schlick = f0 + (1 - f0) * ((1 - oh) ** 5)[..., None]
    specular = lobe[..., None] * schlick + known.multiple(no, ni)[..., None] * survives
    return above[..., None] * (matte + specular)


def specgloss(values: Values, wo: Array, wi: Array) -> Array:
    """(..., 3) f_r of `specgloss`."""
    above, no, ni, oh, lobe, alpha = _facets(values, wo, wi)
    diffuse, f0 = (np.asarray(values[name], np.float64) for name in ("diffuse", "specular"))
    f90 = min(50 * float(np.max(f0)), 1.0)
    known = table(alpha)
    left, mean = below_rim(alpha)
    at = [left(np.log1p(mu / (0.3 * alpha))) for mu in (no, ni)]
    under = f90 * at[0] * at[1] / (np.pi * mean) + (1 - f90) / np.pi
    linear = 0.54 - 0.81 * known.missing
    t = np.maximum(f0 - 0.08, 0) / 0.92
    coloured = (1 - diffuse) * 0.49 * t**2 / (1 - 0.51 * t) + diffuse * f0
    survives = (linear * f0 + (1 - linear) * coloured) * float(values.get("keep_energy", True))
    schlick = f0 + (f90 - f0) * ((1 - oh) ** 5)[..., None]
    specular = lobe[..., None] * schlick + known.multiple(no, ni)[..., None] * survives
    return above[..., None] * (under[..., None] * diffuse * (1 - f0) + specular)


def ggx_dielectric(values: Values, wo: Array, wi: Array) -> Array:
    """(..., 3) f_r of `ggx-dielectric`."""
    above, no, ni, oh, lobe, alpha = _facets(values, wo, wi)
    index = float(values["ior"])
    known = table(alpha, index)
    f = lobe * fresnel(oh, index) + known.survives * known.multiple(no, ni)
    return (above * f)[..., None] * np.asarray(values["tint"], np.float64)


def plastic(values: Values, wo: Array, wi: Array) -> Array:
    """(..., 3) f_r of `plastic`."""
    above, no, ni, oh, lobe, alpha = _facets(values, wo, wi)
    index = float(values["ior"])
    known = table(alpha, index)
    skin = lobe * fresnel(oh, index) + known.survives * known.multiple(no, ni)
    ground = known.transmitted(no) * known.transmitted(ni) / (np.pi * known.through)
    inside = 1 - (1 - (_W * _C * fresnel(_C, index)).sum()) / index**2
    rho, f = np.asarray(values["base_color"], np.float64), inside * float(values["depth"])
    colour = rho * (1 - f) / (1 - rho * f)
    return above[..., None] * (float(values["gloss"]) * skin[..., None] + ground[..., None] * colour)


def ggx_conductor(values: Values, wo: Array, wi: Array) -> Array:
    """(..., 3) f_r of `ggx-conductor`."""
    above, no, ni, oh, lobe, alpha = _facets(values, wo, wi)
    f0, edge = (np.asarray(values[name], np.float64) for name in ("base_color", "edge_tint"))
    schlick = f0 + (1 - f0) * (6 / 7) ** 5
    a = schlick * (1 - edge) / ((1 / 7) * (6 / 7) ** 6)
    highest = np.array([((f + (1 - f) * (1 - _U) ** 5) / (_U * (1 - _U) ** 6)).min() for f in np.ravel(f0)])
    a = np.minimum(a, 0.9 * highest.reshape(np.shape(f0)))
    oh = oh[..., None]
    f = f0 + (1 - f0) * (1 - oh) ** 5 - a * oh * (1 - oh) ** 6
    c = _C[:, None]
    mean = (_W[:, None] * c * (f0 + (1 - f0) * (1 - c) ** 5 - a * c * (1 - c) ** 6)).sum(0)
    known = table(alpha)
    survives = mean**2 * (1 - known.missing) / (1 - mean * known.missing)
    return above[..., None] * (lobe[..., None] * f + known.multiple(no, ni)[..., None] * survives)
