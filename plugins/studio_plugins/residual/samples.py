"""What a fit starts from: lights, where the ball is, and what every texel showed under every light."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Lights:
    """Directional lights: unit `directions` towards them (n, 3), `strengths` (n, 3) linear Rec.709.

    `source` says in a word where the directions come from. ValueError when shapes or numbers don't fit.
    """

    directions: F64
    strengths: F64
    names: tuple[str, ...]
    source: str = ""

    def __post_init__(self) -> None:
        towards = np.array(self.directions, np.float64).reshape(-1, 3)
        strengths = np.array(np.broadcast_to(self.strengths, towards.shape), np.float64)
        length = np.linalg.norm(towards, axis=1, keepdims=True)
        if not (np.isfinite(towards).all() and np.isfinite(strengths).all()) or (length < 1e-12).any():
            raise ValueError("a light needs a direction and a strength that are finite")
        if len(self.names) != len(towards):
            raise ValueError("every light needs a name")
        for name, array in (("directions", towards / length), ("strengths", strengths)):
            array.flags.writeable = False
            object.__setattr__(self, name, array)

    def __len__(self) -> int:
        return len(self.names)

    @classmethod
    def of(cls, directions: npt.ArrayLike, source: str = "", names: Sequence[str] = ()) -> Lights:
        """Lights of strength 1."""
        towards = np.asarray(directions, np.float64).reshape(-1, 3)
        called = tuple(names) or tuple(f"light {i + 1}" for i in range(len(towards)))
        return cls(towards, np.ones_like(towards), called, source)

    @classmethod
    def at(
        cls, azimuths: Sequence[float], heights: Sequence[float] | float = 0.0, source: str = ""
    ) -> Lights:
        """From degrees: azimuth 0 is the camera, 90 to the right of it; height above the horizon."""
        a = np.radians(np.asarray(azimuths, np.float64))
        h = np.radians(np.broadcast_to(np.asarray(heights, np.float64), a.shape))
        towards = np.stack([np.sin(a) * np.cos(h), np.sin(h), np.cos(a) * np.cos(h)], axis=1)
        names = tuple(f"{x:+.0f}/{y:+.0f}" for x, y in zip(np.degrees(a), np.degrees(h), strict=True))
        return cls.of(towards, source, names)

    def some(self, chosen: npt.ArrayLike) -> Lights:
        """Those of the given indices or flags, in that order."""
        which = np.arange(len(self))[np.asarray(chosen)]
        names = tuple(self.names[i] for i in which)
        return Lights(self.directions[which], self.strengths[which], names, self.source)

    def angles(self) -> F64:
        """(n, 2) azimuth and height in degrees, as in `at`."""
        x, y, z = self.directions.T
        made: F64 = np.degrees(np.stack([np.arctan2(x, z), np.arcsin(np.clip(y, -1, 1))], axis=1))
        return made


@dataclass(frozen=True)
class Ball:
    """A sphere in a picture: centre and radius of its outline in pixels, x right and y down from the corner.

    A pixel's middle is at half numbers. `distance` of the camera from the centre in radii of the sphere;
    infinity for a view without perspective. The camera looks at the centre.
    """

    x: float
    y: float
    radius: float
    distance: float = float("inf")

    def normals(self, x: npt.ArrayLike, y: npt.ArrayLike) -> tuple[F64, F64, Flags]:
        """Normals (..., 3), directions to the camera (..., 3) and whether the ball is there, at positions."""
        u = (np.asarray(x, np.float64) - self.x) / self.radius
        v = (self.y - np.asarray(y, np.float64)) / self.radius
        square = u * u + v * v
        inside = square < 1.0
        if not np.isfinite(self.distance):
            n = np.stack([u, v, np.sqrt(np.maximum(1 - square, 0))], axis=-1)
            return n, np.broadcast_to(np.array([0.0, 0.0, 1.0]), n.shape), inside
        slope = 1 / np.sqrt(self.distance**2 - 1)  # tangent of the outline's half angle
        ray = np.stack([u * slope, v * slope, np.full_like(u, -1.0)], axis=-1)
        ray /= np.linalg.norm(ray, axis=-1, keepdims=True)
        eye = np.array([0.0, 0.0, self.distance])
        along = -ray[..., 2] * self.distance
        deep = along**2 - (self.distance**2 - 1)
        n = eye + ray * (along - np.sqrt(np.maximum(deep, 0)))[..., None]
        return n / np.linalg.norm(n, axis=-1, keepdims=True), -ray, inside

    def positions(self, normals: npt.ArrayLike) -> tuple[F64, F64]:
        """x and y in the picture of points with these normals, which the camera must see."""
        n = np.asarray(normals, np.float64)
        if np.isfinite(self.distance):
            scale = np.sqrt(self.distance**2 - 1) / (self.distance - n[..., 2])
        else:
            scale = np.ones_like(n[..., 2])
        return self.x + self.radius * scale * n[..., 0], self.y - self.radius * scale * n[..., 1]

    def views(self, normals: npt.ArrayLike) -> F64:
        """(..., 3) unit directions from points with these normals to the camera."""
        n = np.asarray(normals, np.float64)
        if not np.isfinite(self.distance):
            return np.broadcast_to(np.array([0.0, 0.0, 1.0]), n.shape)
        towards = np.array([0.0, 0.0, self.distance]) - n
        return np.asarray(towards / np.linalg.norm(towards, axis=-1, keepdims=True), np.float64)


@dataclass(frozen=True, eq=False)
class Samples:
    """What every texel showed: `values` (n, h, w, 3), as under strength 1, and whether they count (n, h, w).

    `usable`: neither outside, nor clipped, nor missing; `normals` and `views` (h, w, 3) point to the camera's
    side; `noise`: standard deviation of a value, where known.
    """

    values: F32
    usable: Flags
    normals: F32
    views: F32
    lights: Lights
    noise: float = 0.0

    def __post_init__(self) -> None:
        shape = (len(self.lights), *self.normals.shape[:2])
        if self.values.shape != (*shape, 3) or self.usable.shape != shape:
            raise ValueError(f"samples of {shape[0]} lights have the shape {self.values.shape}")
        if self.views.shape != self.normals.shape:
            raise ValueError("a texel has one normal and one direction to the camera")

    @property
    def size(self) -> tuple[int, int]:
        """Height and width in texels."""
        return self.normals.shape[0], self.normals.shape[1]

    def some(self, chosen: npt.ArrayLike) -> Samples:
        """Under the lights of the given indices or flags."""
        which = np.arange(len(self.lights))[np.asarray(chosen)]
        return replace(
            self, values=self.values[which], usable=self.usable[which], lights=self.lights.some(which)
        )

    def lit_by(self, lights: Lights) -> Samples:
        """The same values as under other lights' directions and strengths (relative to the present ones)."""
        gain = (self.lights.strengths / lights.strengths).astype(np.float32)
        return replace(self, values=self.values * gain[:, None, None, :], lights=lights)
