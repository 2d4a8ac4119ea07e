"""What falls on the simulated phone's sensor: a room through a clip-on fisheye, without response and noise.

A lens' pixel sees the room (bilinear, several samples a pixel), darker towards the edge; at the black frame
light from further inside is thrown back (mirrored and blurred, as the paper's figure 2 shows); around the
circle there is a dark rim, perhaps with a shiny ring.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from studio_core.imaging.latlong import direction_to_uv
from studio_core.imaging.projection import Circle, unproject

if TYPE_CHECKING:
    from studio.bench.phone import Arc, Phone

F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]
ARC_BORDER = 3.0
_BAND = 400_000


@dataclass(frozen=True, eq=False)
class Room:
    """A room's light (H, 2H, 3), the same blurred (what black plastic throws back), and how near it is.

    `nearness`: (4, 3) coefficients of a smooth 0 … 1 of directions: 1 is where parallax is largest.
    """

    light: F32
    nearness: F64

    @cached_property
    def blurred(self) -> F32:
        """A quarter of the width, blurred by about 4°, without single lamps' peaks."""
        import cv2

        height = max(self.light.shape[0] // 4, 16)
        calm = np.minimum(self.light, 20 * np.median(self.light) + np.float32(1e-9))
        small = cv2.resize(calm, (2 * height, height), interpolation=cv2.INTER_AREA)
        wide = np.concatenate([small, small, small], axis=1)
        made = cv2.GaussianBlur(wide, (0, 0), height / 45)[:, 2 * height : 4 * height]
        return np.ascontiguousarray(made, np.float32)

    def near(self, directions: F64) -> F64:
        """0 … 1 of (..., 3): the inverse distance, relative to the nearest; a third of it on the whole."""
        phase = directions @ self.nearness[:3] + self.nearness[3]
        return np.asarray((0.5 + 0.5 * np.sin(phase).mean(axis=-1)) ** 2, np.float64)


def look_up(picture: F32, directions: npt.NDArray[Any]) -> F32:
    """(N, 3) bilinear light of an equirectangular picture in directions (N, 3)."""
    import cv2

    height, width = picture.shape[:2]
    padded = np.pad(picture, ((1, 1), (1, 1), (0, 0)), mode="edge")
    padded[:, 0], padded[:, -1] = padded[:, -2], padded[:, 1]
    u, v = direction_to_uv(directions)
    x = np.ascontiguousarray(u * width + 0.5, np.float32)  # one for the border, minus half a pixel
    y = np.ascontiguousarray(v * height + 0.5, np.float32)
    made = np.empty((len(x), 3), np.float32)
    for start in range(0, len(x), 30_000):  # cv2.remap's pictures are less than 32768 wide
        part = slice(start, start + 30_000)
        made[part] = cv2.remap(padded, x[part, None], y[part, None], cv2.INTER_LINEAR)[:, 0]
    return made


@dataclass(frozen=True, eq=False)
class Mover:
    """Something that moves before the front lens: a disc of `radius` degrees about a direction (3,)."""

    towards: F64
    radius: float
    light: F64


@dataclass(frozen=True, eq=False)
class Pose:
    """Where a lens is: `rotation` (3, 3) room from lens, `offset` (3,) in units of the nearest distance."""

    rotation: F64
    offset: F64


@dataclass(frozen=True, eq=False)
class Rays:
    """One side's samples: `direction` (P, 3) in the lens' frame, `share` of the light that arrives (P,)."""

    phone: Phone
    side: str
    circle: Circle

    @cached_property
    def shape(self) -> tuple[int, int]:
        """Height and width in pixels."""
        return self.phone.size[1], self.phone.size[0]

    def gains(self, room: Room, pose: Pose) -> tuple[float, ...]:
        """For each arc of the phone: how much it throws back, so that it is as strong as it shall be."""
        return tuple(self._gain(arc, room, pose) if arc.side == self.side else 0.0 for arc in self.phone.arcs)

    def light(
        self, room: Room, pose: Pose, gains: tuple[float, ...], mover: Mover | None = None
    ) -> tuple[F32, F32, F32]:
        """Means over pixels: the lens' light (H, W, 3), what its frame adds (H, W, 3), the mover (H, W)."""
        height, width = self.shape
        n = self.phone.samples
        light = np.zeros((height, width, 3), np.float32)
        thrown = np.zeros((height, width, 3), np.float32)
        moved = np.zeros((height, width), np.float32)
        rows = max(1, _BAND // (width * n * n))
        for top in range(0, height, rows):
            bottom = min(top + rows, height)
            if bottom < self.circle.y - self.circle.radius or top > self.circle.y + self.circle.radius:
                continue
            band = self._band(room, pose, gains, mover, top, bottom)
            for whole, part in zip((light, thrown, moved), band, strict=True):
                whole[top:bottom] = (
                    part.reshape(bottom - top, n, width, n, -1).mean((1, 3)).reshape(whole[top:bottom].shape)
                )
        return light, thrown, moved

    def _band(
        self, room: Room, pose: Pose, gains: tuple[float, ...], mover: Mover | None, top: int, bottom: int
    ) -> tuple[F32, F32, F32]:
        n, width = self.phone.samples, self.shape[1]
        x = (np.arange(width * n) + 0.5) / n
        y = top + (np.arange((bottom - top) * n) + 0.5) / n
        points = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
        direction, _ = unproject(self.phone.lens, self.circle, points)
        reach = np.hypot(points[:, 0] - self.circle.x, points[:, 1] - self.circle.y) / self.circle.radius
        inside = reach < 1
        light = np.zeros((len(points), 3), np.float32)
        thrown, moved = np.zeros_like(light), np.zeros(len(points), np.float32)
        if not inside.any():
            return light, thrown, moved
        lens_way, reach = direction[inside], reach[inside]
        theta = np.arccos(np.clip(-lens_way[:, 2], -1, 1))
        share = self._share(theta, reach)
        seen = look_up(room.light, self._through(room, pose, lens_way))
        if mover is not None:
            covered = (lens_way @ mover.towards > np.cos(np.radians(mover.radius))).astype(np.float32)
            seen = seen * (1 - covered[:, None]) + (covered[:, None] * mover.light).astype(np.float32)
            moved[inside] = covered
        light[inside] = seen * share[:, None].astype(np.float32)
        for arc, gain in zip(self.phone.arcs, gains, strict=True):
            if gain:
                weight = gain * share * arc_weight(arc, lens_way, theta, self.phone.lens.half)
                near = np.flatnonzero(weight)
                back = self._thrown_back(arc, room, pose, lens_way[near], theta[near])
                thrown[np.flatnonzero(inside)[near]] += back * weight[near, None].astype(np.float32)
        return light, thrown, moved

    def _share(self, theta: F64, reach: F64) -> F64:
        return self.phone.falloff_at(theta / self.phone.lens.half) * _step(1 - reach, self.phone.edge)

    def _through(self, room: Room, pose: Pose, lens_way: F64) -> F64:
        """Directions in the room, from its middle, of what the lens sees from where it is."""
        direction: F64 = lens_way @ pose.rotation.T
        if pose.offset.any():
            direction = direction + room.near(direction)[:, None] * pose.offset
        return direction

    def _thrown_back(self, arc: Arc, room: Room, pose: Pose, lens_way: F64, theta: F64) -> F32:
        """(N, 3): light from as far inside of the arc's border as a direction is outside of it, blurred."""
        border = self.phone.lens.half - np.radians(arc.depth)
        mirrored = 2 * border - theta - np.radians(2.0)
        ring = np.hypot(lens_way[:, 0], lens_way[:, 1])
        sine = np.sin(mirrored) / np.maximum(ring, 1e-9)
        way = np.stack([lens_way[:, 0] * sine, lens_way[:, 1] * sine, -np.cos(mirrored)], axis=-1)
        back = look_up(room.blurred, way @ pose.rotation.T)
        return np.asarray(
            (back + back.mean(axis=1, keepdims=True)) / 2, np.float32
        )  # half of it grey plastic

    def _gain(self, arc: Arc, room: Room, pose: Pose) -> float:
        half = self.phone.lens.half
        azimuth = np.radians(arc.azimuth + arc.width / 2 * np.linspace(-1, 1, 49))
        theta = half - np.radians(arc.depth) * np.linspace(0.05, 0.95, 19)
        azimuth, theta = (a.ravel() for a in np.meshgrid(azimuth, theta))
        ring = np.sin(theta)
        way = np.stack([np.cos(azimuth) * ring, np.sin(azimuth) * ring, -np.cos(theta)], axis=-1)
        weight = arc_weight(arc, way, theta, half)
        core = weight > 0.5
        seen = look_up(room.light, self._through(room, pose, way[core])).sum(axis=1)
        back = self._thrown_back(arc, room, pose, way[core], theta[core]).sum(axis=1) * weight[core]
        return float((2.0**arc.stops - 1) / max(np.median(back / np.maximum(seen, 1e-9)), 1e-9))


def arc_weight(arc: Arc, lens_way: F64, theta: F64, half: float) -> F64:
    """0 … 1: how much of an arc is in directions of the lens (N, 3) at the angles `theta` from its axis.

    Rises from its inner border to the frame, and over 3° at both ends (the width is at half of it).
    """
    azimuth = np.degrees(np.arctan2(lens_way[:, 1], lens_way[:, 0]))
    away = np.abs((azimuth - arc.azimuth + 180) % 360 - 180)
    along = np.clip((arc.width / 2 + ARC_BORDER / 2 - away) / ARC_BORDER, 0, 1)
    inward = np.degrees(half - theta) / arc.depth
    across = np.clip(2.5 * (1 - inward), 0, 1)
    return np.asarray(_smooth(along) * _smooth(across), np.float64)


def _smooth(x: F64) -> F64:
    return x * x * (3 - 2 * x)


def _step(inside: F64, width: float) -> F64:
    """The circle's soft edge: 0 at it, 1 from `width` (of the radius) inside."""
    return _smooth(np.clip(inside / max(width, 1e-6), 0, 1))
