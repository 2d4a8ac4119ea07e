"""The light of a day: what is seen from inside a room with two windows under a clear sky.

The sun stands behind the house, so only sky, garden and their bounces come in: soft light from the left.
Outside is `Sky` over a garden; inside is diffuse light solved by `radiosity`; window light is summed over
a fine grid on each opening, so the picture has no noise.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from studio_core.colour import LUMINANCE

from ..modelling import equirect
from ..modelling.landscape import Landscape
from ..modelling.mesh import Array, Mask, Point, unit
from ..modelling.radiosity import Wall, bounced, walls
from ..modelling.sky import Sky, sun_at

LOW: Point = (-3.0, 0.0, -2.5)
HIGH: Point = (3.0, 2.8, 2.5)
EYE: Point = (0.6, 1.25, 0.5)
REVEAL = 0.2
CELLS = 28  # points across an opening
GLASS = 0.88
GLASS_SHARE = 0.82  # of an opening; the rest is frame and bars
FRAME, BAR = 0.07, 0.035
SKY = Sky(turbidity=4.5, sun=sun_at(46.0, 118.0))
outside = Landscape(SKY, ground=(0.20, 0.19, 0.15), trees=0.12, shaded=True).painter()
UPWARD_IRRADIANCE = 2.5  # what a table top gets, in units of radiance · sr: mid-greys land near 0.25
PAINT = {
    "wall": (0.72, 0.68, 0.61),
    "accent": (0.24, 0.285, 0.255),
    "ceiling": (0.86, 0.85, 0.83),
    "floor": (0.36, 0.24, 0.15),
    "white": (0.82, 0.81, 0.78),
    "door": (0.66, 0.63, 0.58),
}


@dataclass(frozen=True)
class Window:
    """An opening in wall number `wall` (order of `walls`): low and high corner in the wall's own axes."""

    wall: int
    low: tuple[float, float]
    high: tuple[float, float]


WINDOWS = (
    Window(0, (0.6, -1.3), (2.35, 0.3)),
    Window(5, (-1.9, 0.6), (-0.1, 2.35)),
)


def glazing(window: Window, flat: Array) -> Mask:
    """(N,) True where coordinates on the opening's outer plane are glass, not frame or bar."""
    low, high = np.array(window.low), np.array(window.high)
    inside = ((flat > low + FRAME) & (flat < high - FRAME)).all(axis=1)
    vertical = 0 if window.wall < 2 else 1  # which of the wall's axes is up
    middle = (low + high) / 2
    transom = low[vertical] + 0.68 * (high[vertical] - low[vertical])
    bars = (np.abs(flat[:, 1 - vertical] - middle[1 - vertical]) < BAR) | (
        np.abs(flat[:, vertical] - transom) < BAR
    )
    return np.asarray(inside & ~bars)


def through(side: Wall, window: Window, flat: Array, directions: Array) -> tuple[Mask, Mask]:
    """Whether rays that enter an opening at `flat` reach its outer plane, and whether there is glass."""
    depth = REVEAL / np.maximum(-side.inward * directions[:, side.axis], 1e-6)
    outer = flat + depth[:, None] * directions[:, list(side.spans)]
    reaches = np.asarray(((outer > window.low) & (outer < window.high)).all(axis=1))
    return reaches, reaches & glazing(window, outer)


def from_windows(points: Array, normal: Array, sides: list[Wall]) -> Array:
    """(N, 3) irradiance that points inside get straight through the windows."""
    total = np.zeros((len(points), 3))
    for window in WINDOWS:
        side = sides[window.wall]
        opening = Wall(side.axis, side.at, side.inward, side.spans, window.low, window.high, (CELLS, CELLS))
        area = math.prod(h - lo for lo, h in zip(window.low, window.high, strict=True)) / CELLS**2
        centres = opening.centres()
        for start in range(0, len(points), 128):
            ray = opening.points(centres)[None] - points[start : start + 128, None]
            square = np.einsum("ijk,ijk->ij", ray, ray)
            ray /= np.sqrt(square)[..., None]
            weight = np.maximum(ray @ normal, 0) * np.maximum(ray @ -side.normal, 0) / square * area
            flat_rays = ray.reshape(-1, 3)
            reaches, _ = through(side, window, np.tile(centres, (len(ray), 1)), flat_rays)
            lit = (weight.ravel() > 0) & reaches
            light = np.zeros((len(flat_rays), 3))
            light[lit] = outside(flat_rays[lit]) * GLASS * GLASS_SHARE
            total[start : start + 128] += np.einsum("ij,ijk->ik", weight, light.reshape(*weight.shape, 3))
    return total


def paint(wall: int, flat: Array) -> Array:
    """(N, 3) albedo at coordinates on a wall."""
    if wall in (2, 3):
        return np.broadcast_to(PAINT["floor" if wall == 2 else "ceiling"], (len(flat), 3)).copy()
    vertical = 0 if wall < 2 else 1
    height, along = flat[:, vertical], flat[:, 1 - vertical]
    made = np.broadcast_to(PAINT["accent" if wall == 4 else "wall"], (len(flat), 3)).copy()
    made[(height < 0.1) | (height > 2.74)] = PAINT["white"]
    if wall == 1:  # a door behind the camera
        made[(np.abs(along - 1.2) < 0.52) & (height < 2.12)] = PAINT["white"]
        made[(np.abs(along - 1.2) < 0.44) & (height < 2.04)] = PAINT["door"]
    return made


class Room:
    """The solved room: `radiance` gives what is seen from a point inside, in kcd/m²."""

    def __init__(self, patch: float = 0.32):
        self.sides = walls(LOW, HIGH, patch)
        direct, albedo = [], []
        for number, side in enumerate(self.sides):
            direct.append(from_windows(side.points(side.centres()), side.normal, self.sides))
            albedo.append(paint(number, side.centres()) * (1 - 0.9 * self._open(number, side))[:, None])
        self.irradiance = bounced(self.sides, direct, albedo)

    def _open(self, number: int, side: Wall) -> Array:
        fine = 8
        steps = (np.arange(fine) + 0.5) / fine - 0.5
        cell = [(h - lo) / n for lo, h, n in zip(side.low, side.high, side.cells, strict=True)]
        offsets = np.stack(np.meshgrid(steps * cell[0], steps * cell[1], indexing="ij"), -1).reshape(-1, 2)
        flat = side.centres()[:, None] + offsets
        share = np.zeros(len(flat))
        for window in (w for w in WINDOWS if w.wall == number):
            share += ((flat > window.low) & (flat < window.high)).all(axis=2).mean(axis=1)
        return share

    def radiance(self, directions: Array, eye: Point = EYE) -> Array:
        """(N, 3) seen from `eye` along unit directions (N, 3)."""
        start = np.array(eye)
        with np.errstate(divide="ignore"):
            reach = np.where(directions > 0, np.array(HIGH) - start, np.array(LOW) - start) / directions
        reach = np.where(np.abs(directions) < 1e-12, np.inf, reach)
        axis = reach.argmin(axis=1)
        distance = reach[np.arange(len(reach)), axis]
        number = 2 * axis + (directions[np.arange(len(axis)), axis] > 0)
        made = np.empty((len(directions), 3))
        for k, side in enumerate(self.sides):
            here = np.flatnonzero(number == k)
            flat = (start + directions[here] * distance[here, None])[:, list(side.spans)]
            made[here] = self._wall(k, flat)
            for window in (w for w in WINDOWS if w.wall == k):
                inside = ((flat > window.low) & (flat < window.high)).all(axis=1)
                made[here[inside]] = self._window(window, flat[inside], directions[here[inside]])
        return made

    def _wall(self, number: int, flat: Array) -> Array:
        return paint(number, flat) * self.sides[number].smooth(self.irradiance[number], flat) / math.pi

    def _window(self, window: Window, flat: Array, rays: Array) -> Array:
        """Glass shows the garden, frames the light of the room, reveals both."""
        side = self.sides[window.wall]
        reaches, clear = through(side, window, flat, rays)
        low, high = np.array(window.low), np.array(window.high)
        room = side.smooth(self.irradiance[window.wall], flat)
        made = np.array(PAINT["white"]) * room / math.pi
        made[clear] = outside(rays[clear]) * GLASS
        deep = ~reaches
        if deep.any():
            # The first jamb, sill or head that is hit, and how far out: towards the glass it is brighter.
            slope = rays[deep][:, list(side.spans)] / (-side.inward * rays[deep, side.axis])[:, None]
            wall = np.where(slope > 0, high, low)
            depth = ((wall - flat[deep]) / np.where(np.abs(slope) < 1e-9, 1e-9, slope)).min(axis=1)
            depth = np.clip(depth, 0, REVEAL)
            outwards = unit(np.array([[0.0, 0.0, 0.0], [0.0, 0.5, 0.0], [0.0, -0.5, 0.0]]) - side.normal)
            view = outside(outwards).mean(axis=0)
            share = 0.5 * (1 - (REVEAL - depth) / np.hypot(REVEAL - depth, 0.9))
            made[deep] = np.array(PAINT["white"]) * (
                room[deep] / math.pi * 0.6 + share[:, None] * view * GLASS
            )
        return made


def day_room(height: int = 512, patch: float = 0.32) -> tuple[Array, float]:
    """The picture (height, 2·height, 3), white-balanced and exposed, and cd/m² for a unit of luminance.

    `patch` is the edge in metres of what the bounced light is solved on.
    """
    room = Room(patch)
    picture = equirect.painted(room.radiance, height)
    light = equirect.irradiance(picture, np.array([0.0, 1.0, 0.0]))
    picture = picture * equirect.balance(light, 0.8)
    scale = UPWARD_IRRADIANCE / float(light @ np.array(LUMINANCE))
    return picture * scale, 1000.0 / scale
