"""What a hand can do between two exposures, as a few numbers to be found.

Behind a fisheye the world turns under a circle that stays on the sensor; a picture without one is shifted
and turned as a whole.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from studio_core.capturing.artifacts import Motion
from studio_core.imaging.projection import Circle, Lens
from studio_core.imaging.warping import degrees_of, source_points, turn

F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]

_INSIDE = 0.95  # of the circle's radius: outside it the frame's reflections stay put


@dataclass(frozen=True)
class Place:
    """The part of the picture that is compared, in its own pixels, and what may move in it.

    Behind a fisheye: a turn in space about x, y and z (degrees), then a shift of the circle itself, as the
    stabiliser of a phone or a film scan makes it (pixels). Else: a shift and a turn about the middle.
    """

    size: tuple[int, int]
    circle: Circle | None
    lens: Lens | None

    @property
    def expected(self) -> F64:
        """Standard deviations of hands, before anything is seen."""
        if self.circle is None:
            far = 0.05 * max(self.size)
            return np.array([far, far, 2.0])
        loose = 0.004 * self.circle.radius
        return np.array([4.0, 4.0, 3.0, loose, loose])

    @property
    def starts(self) -> list[Motion]:
        """Where to look for a hand's motion that is too far for descending from rest."""
        if self.circle is not None:
            angles = (0.0, -6.0, -3.0, 3.0, 6.0)
            tried = [(x, y) for x in angles for y in angles]
            return [Motion(rotation=(x, y, 0.0)) for x, y in sorted(tried, key=lambda at: math.hypot(*at))]
        far = [0.03 * i * max(self.size) for i in range(-3, 4)]
        tried = [(x, y) for x in far for y in far]
        return [Motion(x, y) for x, y in sorted(tried, key=lambda at: math.hypot(*at))]

    def smaller(self, by: float) -> Place:
        """The same, seen `by` times as small."""
        size = (round(self.size[0] / by), round(self.size[1] / by))
        return Place(size, self.circle.scaled(1 / by) if self.circle else None, self.lens)

    def values(self, motion: Motion) -> F64:
        """What moves, as numbers."""
        if self.circle is None:
            return np.array([motion.dx, motion.dy, motion.degrees])
        return np.array([*motion.rotation, motion.dx, motion.dy])

    def after(self, motion: Motion, step: F64) -> Motion:
        """`motion` of what was moved by the small `step` before."""
        if self.circle is None:
            angle = math.radians(motion.degrees)
            c, s = math.cos(angle), math.sin(angle)
            dx, dy = motion.dx + c * step[0] - s * step[1], motion.dy + s * step[0] + c * step[1]
            return Motion(dx, dy, motion.degrees + step[2])
        turned = degrees_of(turn(motion.rotation) @ turn(step[:3]))
        return Motion(motion.dx + step[3], motion.dy + step[4], rotation=turned)

    def columns(self) -> F32:
        """(h, w, n, 2): how far a pixel moves for one unit of each number, about rest."""
        width, height = self.size
        flat = np.zeros((height, width, 2, 2), np.float32)
        flat[..., 0, 0] = flat[..., 1, 1] = 1
        x, y = np.meshgrid(
            np.arange(width, dtype=np.float32) + 0.5, np.arange(height, dtype=np.float32) + 0.5
        )
        if self.circle is None:
            about = np.stack([height / 2 - y, x - width / 2], axis=-1) * np.float32(math.pi / 180)
            return np.asarray(np.concatenate([flat, about[:, :, None]], axis=2), np.float32)
        here = np.stack([x, y], axis=-1)
        small = 0.01
        turns = [
            (source_points(Motion(rotation=axis), self.size, self.circle, self.lens) - here) / small
            for axis in ((small, 0.0, 0.0), (0.0, small, 0.0), (0.0, 0.0, small))
        ]
        return np.asarray(np.concatenate([np.stack(turns, axis=2), flat], axis=2), np.float32)

    def inside(self) -> F32:
        """(h, w) 1 where pixels are compared."""
        width, height = self.size
        if self.circle is None:
            return np.ones((height, width), np.float32)
        x, y = np.arange(width) + 0.5 - self.circle.x, np.arange(height) + 0.5 - self.circle.y
        far = np.hypot(x[None, :], y[:, None])
        return np.asarray(far < _INSIDE * self.circle.radius, np.float32)


def scaled(motion: Motion, by: float) -> Motion:
    """The motion in a picture `by` times as large."""
    return Motion(motion.dx * by, motion.dy * by, motion.degrees, rotation=motion.rotation)
