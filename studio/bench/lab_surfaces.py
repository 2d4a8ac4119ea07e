"""Surfaces of the lab whose reflectance is known everywhere: bumps, colours, gloss, light that spreads below.

Values are radiance under a light of strength 1, by which a white matte surface that faces it has the value 1.
Patterns are solid (sums of waves in space), so that they have no seams and exact gradients.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

F32 = npt.NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class Waves:
    """A sum of plane waves of about one length; values are mostly within ±1."""

    vectors: F32
    phases: F32

    @classmethod
    def random(cls, seed: int, length: float, count: int = 14, spread: float = 0.45) -> Waves:
        """Waves of `length` (sphere radii) on average."""
        rng = np.random.default_rng(seed)
        towards = rng.normal(size=(count, 3))
        towards /= np.linalg.norm(towards, axis=1, keepdims=True)
        k = 2 * np.pi / length * np.exp(rng.uniform(-spread, spread, count))
        return cls(
            (towards * k[:, None]).astype(np.float32), rng.uniform(0, 2 * np.pi, count).astype(np.float32)
        )

    def at(self, points: F32) -> F32:
        """(m,) values at (m, 3)."""
        scale = np.float32(1.0 / np.sqrt(len(self.phases)))
        return np.asarray(np.cos(points @ self.vectors.T + self.phases).sum(axis=1) * scale, np.float32)

    def gradient(self, points: F32) -> F32:
        """(m, 3) exact gradients."""
        scale = np.float32(-1.0 / np.sqrt(len(self.phases)))
        return np.asarray((np.sin(points @ self.vectors.T + self.phases) * scale) @ self.vectors, np.float32)


@dataclass(frozen=True)
class Gloss:
    """A highlight: `strength` (3) is its albedo, roughly. `kind`: "blinn" (exponent n) or "ggx" (α)."""

    kind: str
    sharpness: float
    strength: tuple[float, float, float]

    def value(self, n: F32, wo: F32, wi: F32) -> F32:
        """(m, 3) radiance: lobe × cosine × π."""
        half = wo + wi
        half /= np.linalg.norm(half, axis=1, keepdims=True)
        nl = np.maximum((n * wi).sum(axis=1), 0)
        nv = np.maximum((n * wo).sum(axis=1), 1e-4)
        tilt = np.minimum(((half - n) ** 2).sum(axis=1) / 4, 1)  # sin² of half the angle: exact when small
        nh = 1 - 2 * tilt
        if self.kind == "blinn":
            peak = (self.sharpness + 2) * (self.sharpness + 4)
            peak /= 8 * np.pi * (2 ** (-self.sharpness / 2) + self.sharpness)
            lobe = peak * np.exp(self.sharpness * np.log(np.maximum(nh, 1e-6))) * nl
        else:
            a2 = self.sharpness**2
            d = a2 / (np.pi * (a2 * nh**2 + 4 * tilt * (1 - tilt)) ** 2)
            into = nl * np.sqrt(nv**2 * (1 - a2) + a2)
            out = nv * np.sqrt(nl**2 * (1 - a2) + a2)
            lobe = d * 0.5 / np.maximum(into + out, 1e-9) * nl
        return np.asarray(np.pi * lobe[:, None] * np.asarray(self.strength, np.float32), np.float32)


def matte(n: F32, wo: F32, wi: F32) -> F32:
    """Lambert's cosine (m,)."""
    return np.asarray(np.maximum((n * wi).sum(axis=1), 0), np.float32)


def rough_matte(sigma: float) -> Callable[[F32, F32, F32], F32]:
    """Oren and Nayar's qualitative model (1994) with slopes of `sigma` radians."""
    a = np.float32(1 - 0.5 * sigma**2 / (sigma**2 + 0.33))
    b = np.float32(0.45 * sigma**2 / (sigma**2 + 0.09))

    def shade(n: F32, wo: F32, wi: F32) -> F32:
        i, o = np.clip((n * wi).sum(axis=1), 0, 1), np.clip((n * wo).sum(axis=1), 1e-4, 1)
        s = (wi * wo).sum(axis=1) - i * o
        t = np.where(s > 0, np.maximum(np.maximum(i, o), 1e-4), 1)
        return np.asarray(i * a + b * np.where(i > 0, i * s / t, 0), np.float32)

    return shade


def spread_light(width: float) -> Callable[[F32, F32, F32], F32]:
    """Irradiance blurred over the sphere by `width` radians, as by light below the surface: no sharp
    terminator.

    The clamped cosine's Legendre coefficients, damped by exp(−l (l + 1) width² / 2).
    """
    degree = np.arange(41)
    x, w = np.polynomial.legendre.leggauss(400)
    table = np.polynomial.legendre.legvander(x, 40)
    weights = (w[:, None] * np.maximum(x, 0)[:, None] * table).sum(axis=0) * (degree + 0.5)
    weights *= np.exp(-degree * (degree + 1) * width**2 / 2)
    grid = np.linspace(-1, 1, 801)
    curve = np.maximum(np.polynomial.legendre.legval(grid, weights), 0)

    def shade(n: F32, wo: F32, wi: F32) -> F32:
        return np.interp(np.clip((n * wi).sum(axis=1), -1, 1), grid, curve).astype(np.float32)

    return shade


def sheen(strength: float) -> Callable[[F32, F32, F32], F32]:
    """Lambert with more light from fibres towards the rim: cos · (1 + strength · sin²θ_h)."""

    def shade(n: F32, wo: F32, wi: F32) -> F32:
        half = wo + wi
        half /= np.linalg.norm(half, axis=1, keepdims=True)
        tilt = 1 - (half * n).sum(axis=1) ** 2
        return np.asarray(matte(n, wo, wi) * (1 + np.float32(strength) * tilt), np.float32)

    return shade


@dataclass(frozen=True, eq=False)
class Surface:
    """A material of the lab.

    base: mean albedo; tint: how far the albedo goes towards `other` where `pattern` is high (0: one colour);
    bumps: height field, `height` its amplitude (radii): tilts normals and throws shadows; gloss: highlights;
    glossy_where: the highlight is only where the pattern is high (two components); through: share of
    light that comes from behind the surface (translucent).
    """

    base: tuple[float, float, float]
    other: tuple[float, float, float] = (0.0, 0.0, 0.0)
    pattern: Waves | None = None
    hard: float = 1.0
    bumps: Waves | None = None
    height: float = 0.0
    diffuse: Callable[[F32, F32, F32], F32] = field(default=matte)
    gloss: tuple[Gloss, ...] = ()
    glossy_where: bool = False
    spreads: bool = False

    @property
    def sharp(self) -> bool:
        """Whether highlights are narrower than a few pixels."""
        return any(g.sharpness > 400 if g.kind == "blinn" else g.sharpness < 0.05 for g in self.gloss)

    def share(self, points: F32) -> F32:
        """(m,) 0 … 1 how much a point belongs to the second colour."""
        if self.pattern is None:
            return np.zeros(len(points), np.float32)
        return np.asarray(1 / (1 + np.exp(-4 * self.hard * self.pattern.at(points))), np.float32)

    def tilted(self, points: F32, normals: F32) -> F32:
        """(m, 3) normals of the bumpy surface: n − ∇h along the surface, of length 1."""
        if self.bumps is None:
            return normals
        g = self.bumps.gradient(points) * np.float32(self.height)
        g -= (g * normals).sum(axis=1, keepdims=True) * normals
        made = normals - g
        return np.asarray(made / np.linalg.norm(made, axis=1, keepdims=True), np.float32)

    def lit(
        self, points: F32, normals: F32, wi: F32, curved: bool = True, steps: int = 14
    ) -> npt.NDArray[np.bool_]:
        """(m,) whether no bump stands between a point and the light: a march over the height field.

        Exact on the displaced sphere (|x| against 1 + h) and on the displaced plane (z against h).
        """
        made = (normals * wi).sum(axis=1) > 0
        if self.bumps is None or not self.height:
            return made
        top = np.float32(1.9 * self.height)  # above nearly all bumps
        where = np.flatnonzero(made)
        here = self.bumps.at(points[where]) * np.float32(self.height)
        start = points[where] + normals[where] * here[:, None]
        slope = np.maximum((normals[where] * wi[where]).sum(axis=1), 0.03)
        reach = np.minimum(np.maximum(top - here, 0) / slope, 0.8)
        free = np.ones(len(where), np.bool_)
        for step in range(1, steps + 1):
            at = np.flatnonzero(free)
            x = start[at] + wi[where[at]] * (reach[at] * np.float32((step / steps) ** 1.5))[:, None]
            if curved:
                length = np.linalg.norm(x, axis=1, keepdims=True)
                over, foot = length[:, 0] - 1, x / length
            else:
                over, foot = x[:, 2], x * np.array([1, 1, 0], np.float32)
            free[at] = self.bumps.at(foot) * np.float32(self.height) <= over + np.float32(0.02 * self.height)
        made[where] = free
        return made

    def radiance(self, points: F32, tilted: F32, share: F32, wo: F32, wi: F32) -> F32:
        """(m, 3) light that comes back, shadows of other bumps left out."""
        albedo = np.asarray(self.base, np.float32) * (1 - share)[:, None]
        albedo = albedo + np.asarray(self.other, np.float32) * share[:, None]
        made = albedo * self.diffuse(tilted, wo, wi)[:, None]
        for gloss in self.gloss:
            part = gloss.value(tilted, wo, wi)
            made += part * share[:, None] if self.glossy_where else part
        return np.asarray(made, np.float32)


def library() -> dict[str, Surface]:
    """The lab's materials by name."""
    white = (0.04, 0.04, 0.04)
    stone = Waves.random(3, 0.35)
    return {
        "matte": Surface((0.62, 0.55, 0.42), diffuse=rough_matte(0.4)),
        "textured": Surface((0.65, 0.42, 0.2), (0.16, 0.2, 0.36), Waves.random(1, 0.3), 1.2),
        "bumpy": Surface(
            (0.5, 0.46, 0.4), (0.34, 0.3, 0.25), stone, 1.0, Waves.random(2, 0.16), 0.008, rough_matte(0.3)
        ),
        "two-component": Surface(
            *((0.5, 0.12, 0.1), (0.12, 0.1, 0.09), Waves.random(4, 0.5), 4.0),
            gloss=(Gloss("blinn", 60.0, (0.06, 0.055, 0.04)),),
            glossy_where=True,
        ),
        "fabric": Surface(
            (0.2, 0.26, 0.4), (0.12, 0.15, 0.26), Waves.random(5, 0.2), 0.8, diffuse=sheen(1.5)
        ),
        "translucent": Surface(
            (0.5, 0.62, 0.5),
            (0.36, 0.52, 0.4),
            stone,
            1.0,
            diffuse=spread_light(0.35),
            spreads=True,
            gloss=(Gloss("blinn", 900.0, white),),
        ),
        "glossy": Surface(
            (0.32, 0.05, 0.04),
            (0.22, 0.04, 0.03),
            Waves.random(6, 0.3),
            0.7,
            gloss=(Gloss("blinn", 2500.0, white),),
        ),
        "two-lobes": Surface(
            (0.1, 0.16, 0.12),
            gloss=(Gloss("ggx", 0.06, (0.03, 0.03, 0.03)), Gloss("ggx", 0.3, (0.04, 0.04, 0.03))),
        ),
        "narrow": Surface((0.3, 0.28, 0.25), gloss=(Gloss("blinn", 12000.0, white),)),
    }
