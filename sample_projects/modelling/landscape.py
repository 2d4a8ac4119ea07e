"""What lies under a sky, by direction alone: hills in haze, a line of trees, a lawn."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from . import equirect
from .mesh import Array, Mask, Point
from .sky import SUN_RADIUS, Sky

Waves = tuple[tuple[float, int, float], ...]
HILLS: Waves = ((0.016, 2, 0.7), (0.010, 5, 2.9), (0.004, 13, 0.2), (0.0015, 31, 1.0))
CROWNS: Waves = (
    *(
        (0.014, 3, 0.4),
        (0.010, 7, 4.0),
        (0.012, 19, 1.3),
        (0.009, 43, 0.0),
        (0.006, 89, 2.2),
        (0.004, 173, 0.6),
    ),
)


@dataclass(frozen=True)
class Landscape:
    """A lawn (or other ground) seen from `height` metres above it, ringed by trees and far hills.

    `trees` is the trees' mean height in radians above the horizon. With `shaded` the ground up to about
    6 m away lies in the shadow of a house.
    """

    sky: Sky
    ground: Point = (0.125, 0.19, 0.055)
    trees: float = 0.055
    height: float = 1.5
    shaded: bool = False

    def sunlight(self) -> Array:
        """(3,) irradiance of a surface that faces the sun, from its disc alone, klx."""
        return self.sky.sun_radiance() * 2 * math.pi * (1 - math.cos(SUN_RADIUS))

    def skylight(self) -> Array:
        """(3,) irradiance of level ground from the sky without the sun, klx."""
        picture = equirect.painted(self.sky.radiance, 64, 1)
        picture[32:] = 0
        return equirect.irradiance(picture, np.array([0.0, 1.0, 0.0]))

    def painter(self) -> equirect.Radiance:
        """The function from unit directions (N, 3) to radiance (N, 3), in kcd/m²."""
        sunlight, skylight = self.sunlight(), self.skylight()
        level = skylight + self.sky.sun[1] * sunlight

        def radiance(directions: Array) -> Array:
            up = np.arcsin(np.clip(directions[:, 1], -1, 1))
            turn = np.arctan2(directions[:, 0], directions[:, 2])
            haze = 0.8 * self.sky.radiance(
                np.stack([np.sin(turn), np.full_like(turn, 0.05), np.cos(turn)], 1)
            )
            made = self.sky.radiance(directions)
            facing = 0.5 - 0.35 * np.cos(turn - math.atan2(self.sky.sun[0], self.sky.sun[2]))[:, None]
            lit = facing * (0.5 * skylight + 0.6 * sunlight) + 0.3 * skylight
            hills = np.array([0.07, 0.09, 0.055]) / math.pi * lit
            made = _over(made, up < 0.045 + _sum(HILLS, turn), 0.55 * hills + 0.4 * haze)
            leaves = 1 + 0.4 * np.sin(71 * turn + 3 * np.sin(90 * up)) * np.sin(
                150 * up + 2 * np.sin(67 * turn)
            )
            trees = np.array([0.06, 0.105, 0.03]) / math.pi * lit * leaves[:, None]
            made = _over(made, up < self.trees + _sum(CROWNS, turn), 0.95 * trees + 0.05 * haze)
            return _over(made, up < -0.012, self._ground(up, turn, skylight, sunlight, level, haze))

        return radiance

    def _ground(
        self, up: Array, turn: Array, skylight: Array, sunlight: Array, level: Array, haze: Array
    ) -> Array:
        away = self.height / np.tan(np.clip(-up, 0.012, 1.55))
        x, z = away * np.sin(turn), away * np.cos(turn)
        calm = np.exp(-away / 25)
        patches = 1 + calm * (
            0.08 * np.sin(1.1 * x + 2 * np.sin(0.7 * z)) * np.sin(1.3 * z + 1.5 * np.sin(0.9 * x))
            + 0.05 * np.sin(4.3 * x + 1.0) * np.sin(3.9 * z + 2 * np.sin(x))
        )
        light = level
        if self.shaded:
            lit = 1 / (1 + np.exp(-(away - 6.0) * 1.5))[:, None]
            light = 0.7 * skylight + self.sky.sun[1] * lit * sunlight
        far = (1 - np.exp(-away / 260))[:, None] * 0.6
        return np.asarray(
            np.array(self.ground) / math.pi * light * patches[:, None] * (1 - far) + far * haze * 0.6
        )


def _sum(waves: Waves, turn: Array) -> Array:
    return np.asarray(sum(a * np.sin(f * turn + p) for a, f, p in waves))


def _over(back: Array, mask: Mask, front: Array) -> Array:
    return np.where(mask[:, None], front, back)
