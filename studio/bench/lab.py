"""A synthetic photographer's lab: a ball or a flat sample under known lights, photographed with all its
faults.

`shoot` gives pictures as linear arrays and everything that made them; `truth_map` the exact radiance of any
texel under any light. `studio.bench.lab_files` writes the pictures as files.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from studio.bench.lab_surfaces import Surface
from studio_plugins.residual.samples import Ball, Lights

F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]


@dataclass(frozen=True)
class Rig:
    """The camera and all that can go wrong. Angles are degrees; everything that errs is off by default.

    ball: where the sphere is in the picture; flat: a flat sample fills the picture instead, `extent` wide;
    samples: along a pixel's side (sharp highlights take more); white: value that saturates at EV 0;
    evs: of the exposures that are merged; bits: of the numbers (0: exact); full_well: electrons at white;
    read_noise: electrons; direction_error, strength_error: standard deviations of what lights do against what
    is told; drift: the lamp's height changes by this over the sequence; lamp_size: its diameter as seen;
    backdrop: light of what is behind the ball.
    """

    size: tuple[int, int] = (236, 230)
    ball: Ball = Ball(118.4, 114.3, 104.7)
    flat: bool = False
    extent: float = 1.0
    samples: int = 2
    white: float = 2.0
    evs: tuple[float, ...] = (0.0,)
    bits: int = 0
    full_well: float = 0.0
    read_noise: float = 0.0
    direction_error: float = 0.0
    strength_error: float = 0.0
    drift: float = 0.0
    lamp_size: float = 0.0
    backdrop: float = 0.0


@dataclass(frozen=True, eq=False)
class LabShots:
    """Pictures (n, H, W, 3) linear and merged, whether a pixel was clipped in every exposure (n, H, W),
    the lights as `told` and as they `were`, and the rig."""

    pictures: F32
    clipped: Flags
    told: Lights
    were: Lights
    rig: Rig
    surface: Surface = field(repr=False)


def row(heights: float = 0.0) -> Lights:
    """The paper's lights: azimuths −60 … 60° by 10° without 0°."""
    return Lights.at([a for a in range(-60, 61, 10) if a], heights, "angles")


def dome(heights: tuple[float, ...] = (-40.0, -20.0, 0.0, 20.0, 40.0)) -> Lights:
    """The paper's row at several heights, with lights above and below the camera."""
    pairs = [(a, h) for h in heights for a in range(-60, 61, 10) if a or h]
    return Lights.at([float(a) for a, _ in pairs], [h for _, h in pairs], "angles")


def scattered(count: int, seed: int, widest: float = 65.0) -> Lights:
    """Random lights, even over the cap of `widest` degrees around the camera, none within 6°."""
    rng = np.random.default_rng(seed)
    z = rng.uniform(np.cos(np.radians(widest)), np.cos(np.radians(6.0)), count)
    turn = rng.uniform(0, 2 * np.pi, count)
    r = np.sqrt(1 - z * z)
    return Lights.of(np.stack([r * np.cos(turn), r * np.sin(turn), z], axis=1), "angles")


def shoot(surface: Surface, told: Lights, rig: Rig | None = None, seed: int = 0) -> LabShots:
    """Photograph a surface under every light."""
    rig = rig or Rig()
    rng = np.random.default_rng(seed)
    were = erring(told, rig, rng)
    pictures = _pictures(surface, were, rig)
    made, clipped = _sensed(pictures, rig, rng)
    return LabShots(made, clipped, told, were, rig, surface)


def erring(told: Lights, rig: Rig, rng: np.random.Generator) -> Lights:
    """Where lights really are and how strong, when they are told so."""
    towards = told.directions.copy()
    if rig.drift:
        height = np.radians(rig.drift) * np.linspace(-0.5, 0.5, len(told))
        towards[:, 1] += height * np.sqrt(np.maximum(1 - towards[:, 1] ** 2, 0))
    if rig.direction_error:
        off = rng.normal(scale=np.radians(rig.direction_error) / np.sqrt(2), size=towards.shape)
        towards += off - (off * towards).sum(axis=1, keepdims=True) * towards
    strengths = told.strengths * np.exp(rng.normal(scale=rig.strength_error, size=(len(told), 1)))
    return Lights(towards, strengths, told.names, "truth")


def truth_map(surface: Surface, normals: F32, views: F32, lights: Lights) -> tuple[F32, Flags]:
    """Radiance (n, h, w, 3) of points of the ball with these normals (h, w, 3), and whether they are lit.

    Points, not pixels: nothing is averaged. Lit: no part of the ball nor a bump is before the light.
    """
    shape = normals.shape[:2]
    points = normals.reshape(-1, 3).astype(np.float32)
    grain = _Grain.of(surface, points, points, views.reshape(-1, 3).astype(np.float32))
    values, lit = [], []
    for i in range(len(lights)):
        made, free = grain.under(lights.directions[i], True)
        values.append((made * lights.strengths[i].astype(np.float32)).reshape(*shape, 3))
        lit.append(free.reshape(shape))
    return np.stack(values), np.stack(lit)


@dataclass(frozen=True, eq=False)
class _Grain:
    """Points of a surface, ready to be lit: (m, 3) each, and the share of the second colour (m,)."""

    surface: Surface
    points: F32
    normals: F32
    tilted: F32
    share: F32
    views: F32

    @classmethod
    def of(cls, surface: Surface, points: F32, normals: F32, views: F32) -> _Grain:
        return cls(surface, points, normals, surface.tilted(points, normals), surface.share(points), views)

    def under(self, towards: F64, curved: bool) -> tuple[F32, Flags]:
        """Radiance (m, 3) with shadows, and where light falls."""
        wi = np.broadcast_to(towards.astype(np.float32), self.points.shape)
        made = self.surface.radiance(self.points, self.tilted, self.share, self.views, wi)
        lit = self.surface.lit(self.points, self.normals, wi, curved)
        if not self.surface.spreads:
            made *= lit[:, None]
        return made, lit


def _pictures(surface: Surface, lights: Lights, rig: Rig) -> F32:
    """Exact pictures (n, H, W, 3): means over pixels."""
    width, height = rig.size
    side = max(rig.samples, 5) if surface.sharp else rig.samples
    made = np.full((len(lights), height * width, 3), 0, np.float32)
    weight = np.float32(1 / side**2)
    for part in range(side * side):
        at, points, normals, views = _seen(rig, (part % side + 0.5) / side, (part // side + 0.5) / side)
        grain = _Grain.of(surface, points, normals, views)
        if rig.backdrop:
            made += weight * np.float32(rig.backdrop)
            made[:, at] -= weight * np.float32(rig.backdrop)
        for i in range(len(lights)):
            towards = _lamp(lights.directions[i], rig.lamp_size)
            strength = lights.strengths[i].astype(np.float32) * (weight / np.float32(len(towards)))
            for one in towards:
                made[i, at] += grain.under(one, not rig.flat)[0] * strength
    return made.reshape(len(lights), height, width, 3)


def _seen(rig: Rig, x: float, y: float) -> tuple[npt.NDArray[np.intp], F32, F32, F32]:
    """Pixels that show the sample at a place within them: their index, points, normals, directions to the
    camera.
    """
    width, height = rig.size
    u, v = (a.ravel() for a in np.meshgrid(np.arange(width) + x, np.arange(height) + y))
    if rig.flat:
        scale = rig.extent / width
        points = np.stack([(u - width / 2) * scale, (height / 2 - v) * scale, 0 * u], axis=1)
        up = np.broadcast_to(np.array([0, 0, 1], np.float32), points.shape)
        return np.arange(len(points)), points.astype(np.float32), up, up
    normals, views, there = rig.ball.normals(u, v)
    at = np.flatnonzero(there)
    n = normals[at].astype(np.float32)
    return at, n, n, views[at].astype(np.float32)


def _lamp(towards: F64, diameter: float) -> F64:
    """Directions over a round lamp (k, 3)."""
    if not diameter:
        return towards[None]
    side = np.cross(towards, [0.3, 0.9, 0.2])
    side /= np.linalg.norm(side)
    other = np.cross(towards, side)
    radius = np.radians(diameter) / 2
    turn = np.arange(7) * 2.39996
    r = radius * np.sqrt((np.arange(7) + 0.5) / 7)
    made = towards + (r * np.cos(turn))[:, None] * side + (r * np.sin(turn))[:, None] * other
    return np.asarray(made / np.linalg.norm(made, axis=1, keepdims=True), np.float64)


def _sensed(light: F32, rig: Rig, rng: np.random.Generator) -> tuple[F32, Flags]:
    """What comes out of the camera and the merging of its exposures: light, and what was clipped in all."""
    if not rig.bits and not rig.full_well and not rig.read_noise:
        return np.minimum(light, np.float32(rig.white * 2.0 ** -min(rig.evs))), np.asarray(
            light.max(axis=-1) >= rig.white * 2.0 ** -min(rig.evs)
        )
    total, weights = np.zeros(light.shape, np.float64), np.zeros(light.shape, np.float64)
    least = min(rig.evs)
    clipped = np.zeros(light.shape[:3], np.bool_)
    well = rig.full_well or 1e9
    for ev in rig.evs:
        scale = 2.0**ev / rig.white
        electrons = np.maximum(light * scale, 0) * well
        electrons = electrons + rng.normal(size=light.shape) * np.sqrt(electrons + rig.read_noise**2)
        number = electrons / well
        if rig.bits:
            top = 2**rig.bits - 1
            # photographs of 8 bit are encoded: a step is finer in the dark
            code = np.clip(number, 0, 1) ** (1 / 2.2 if rig.bits <= 8 else 1.0)
            number = (np.round(code * top) / top) ** (2.2 if rig.bits <= 8 else 1.0)
        full = (number >= 0.995).any(axis=-1)
        if ev == least:
            clipped = full
        weight = np.where(full[..., None], 1e-6 if ev == least else 0.0, scale**2)
        total += weight * np.minimum(number, 1) / scale
        weights += weight
    return np.asarray(total / weights, np.float32), clipped
