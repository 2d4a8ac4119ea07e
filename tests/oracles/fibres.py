"""Cloth in float64: what fibres hide and return by plain sums, and splines between many angles."""

from __future__ import annotations

import functools
from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.interpolate import CubicSpline

Array = npt.NDArray[np.float64]
Values = Mapping[str, Any]

_X, _W = np.polynomial.legendre.leggauss(160)
_U, _WU = (_X + 1) / 2, _W / 2


def density(n: float, cosine2: Array) -> Array:
    """D of a half vector with cos² θ_h."""
    return (2 + n) / (2 * np.pi) * np.clip(1 - cosine2, 0, 1) ** (n / 2)


class Pile:
    """A and E of a roughness."""

    def __init__(self, roughness: float) -> None:
        self.n = n = 1 / max(roughness, 0.07) ** 2
        place = np.linspace(0, 1, 81)
        mu = place**3
        # A = ∫ D(m) max(ω·m, 0) dm; sin^n concentrates near the surface: cos θ_m = u²
        c, weight = _U**2, 2 * _U * _WU
        sine = np.sqrt(1 - c * c)
        phi = np.linspace(0, np.pi, 2001)
        theta = np.linspace(0, np.pi / 2, 61)
        area = []
        for m in np.cos(theta):
            dot = np.sqrt(1 - m * m) * sine[:, None] * np.cos(phi) + m * c[:, None]
            area.append((weight * density(n, c * c) * 2 * np.trapezoid(np.maximum(dot, 0), phi)).sum())
        self._area = CubicSpline(theta, area)
        albedo = []
        around = (_X + 1) * np.pi / 2
        for m in np.maximum(mu, 1e-9):
            s = np.sqrt(1 - m * m)
            hx, hy = s + sine[:, None] * np.cos(around), sine[:, None] * np.sin(around)
            cosine2 = (m + c[:, None]) ** 2 / (hx**2 + hy**2 + (m + c[:, None]) ** 2)
            lobe = self.lobe(m, c[:, None], cosine2) * c[:, None]
            albedo.append((weight[:, None] * _W * np.pi * lobe).sum())
        self._albedo = CubicSpline(place, albedo)
        self.average = float((3 * _WU * _U**2 * 2 * _U**3 * self.passing(_U**3)).sum())

    def area(self, mu: Any) -> Array:
        """A."""
        return self._area(np.arccos(np.clip(mu, 0, 1)))

    def lobe(self, no: Any, ni: Any, cosine2: Array) -> Array:
        """D / (4 (A_i μ_o + A_o μ_i − μ_i μ_o))."""
        a, b = self.area(no), self.area(ni)
        return density(self.n, cosine2) / (4 * (a * ni + b * no - no * ni))

    def passing(self, mu: Array) -> Array:
        """1 − E."""
        return 1 - self._albedo(np.cbrt(mu))


@functools.lru_cache(64)
def pile(roughness: float) -> Pile:
    """Kept by roughness."""
    return Pile(roughness)


def cloth(values: Values, wo: Array, wi: Array) -> Array:
    """(..., 3) f_r of `cloth`."""
    above = (wo[..., 2] > 0) & (wi[..., 2] > 0)
    wo, wi = (
        np.where(above[..., None], w / np.linalg.norm(w, axis=-1, keepdims=True), [0, 0, 1]) for w in (wo, wi)
    )
    h = wo + wi
    cosine2 = h[..., 2] ** 2 / (h**2).sum(-1)
    known = pile(float(values["roughness"]))
    base, sheen = (np.asarray(values[name], np.float64) for name in ("base_color", "sheen"))
    no, ni = wo[..., 2], wi[..., 2]
    under = (known.passing(no) * known.passing(ni) / known.average)[..., None]
    ground = base / np.pi * (1 - sheen + sheen * under)
    return above[..., None] * (ground + sheen * known.lobe(no, ni, cosine2)[..., None])
