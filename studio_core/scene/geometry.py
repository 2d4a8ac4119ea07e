"""Meshes, pictures and tables: the heavy, shared, read-only parts of a scene."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from studio_core.arrays import content_hash, readonly


@dataclass(frozen=True, eq=False)
class Geometry:
    """A triangle mesh in its own frame, metres, y up. Shared by all its instances.

    positions (P, 3) float32; faces (F, 3) uint32 into positions; normals (P, 3) float32 unit or None;
    uvs (P, 2) float32 (v up, OpenGL's way) or None; slots (F,) uint16: which of the object's materials a
    face has. A corner with two normals or two uvs is two positions. Raises ValueError when they do not fit.
    """

    positions: npt.NDArray[np.float32]
    faces: npt.NDArray[np.uint32]
    normals: npt.NDArray[np.float32] | None = None
    uvs: npt.NDArray[np.float32] | None = None
    slots: npt.NDArray[np.uint16] | None = None

    def __post_init__(self) -> None:
        fill = object.__setattr__
        fill(self, "positions", readonly(self.positions, np.float32, -1, 3))
        fill(self, "faces", readonly(self.faces, np.uint32, -1, 3))
        count = len(self.positions)
        if len(self.faces) and int(self.faces.max()) >= count:
            raise ValueError("a face names a position that does not exist")
        for name, width in (("normals", 3), ("uvs", 2)):
            array = getattr(self, name)
            if array is not None:
                fill(self, name, readonly(array, np.float32, -1, width))
                if len(getattr(self, name)) != count:
                    raise ValueError(f"{name} and positions differ in length")
        slots = np.zeros(len(self.faces), np.uint16) if self.slots is None else self.slots
        fill(self, "slots", readonly(slots, np.uint16, -1))
        if len(slots) != len(self.faces):
            raise ValueError("slots and faces differ in length")
        for array in (self.positions, self.normals, self.uvs):
            if array is not None and not np.isfinite(array).all():
                raise ValueError("a mesh must be finite")

    @cached_property
    def key(self) -> str:
        """Content hash: equal meshes have equal keys."""
        return content_hash(*(array for _, array in self.parts()))

    def parts(self) -> tuple[tuple[str, npt.NDArray[Any]], ...]:
        """Name and array of everything that is there, in a fixed order."""
        named = (
            ("positions", self.positions),
            ("faces", self.faces),
            ("slots", self.slots),
            ("normals", self.normals),
            ("uvs", self.uvs),
        )
        return tuple((name, array) for name, array in named if array is not None)

    @property
    def nbytes(self) -> int:
        """Bytes of all arrays."""
        return sum(array.nbytes for _, array in self.parts())

    @cached_property
    def bounds(self) -> npt.NDArray[np.float64]:
        """(2, 3): lowest and highest corner; zeros for an empty mesh."""
        if not len(self.positions):
            return np.zeros((2, 3))
        return np.stack([self.positions.min(axis=0), self.positions.max(axis=0)]).astype(np.float64)


@dataclass(frozen=True, eq=False)
class Image:
    """A picture: (H, W, C) float32 or uint8, rows from the top, C 1, 3 or 4.

    `encoding` says what the numbers are: scene-linear Rec.709, sRGB-encoded, or plain data (normals).
    Raises ValueError when the shape does not fit or a pixel is not finite.
    """

    pixels: npt.NDArray[Any]
    encoding: Literal["linear", "srgb", "data"] = "linear"

    def __post_init__(self) -> None:
        dtype = np.uint8 if self.pixels.dtype == np.uint8 else np.float32
        made = readonly(self.pixels, dtype, -1, -1, -1)
        if made.shape[2] not in (1, 3, 4) or 0 in made.shape:
            raise ValueError(f"a picture of shape {made.shape} cannot be used")
        if not (np.isfinite(made.min()) and np.isfinite(made.max())):
            raise ValueError("a picture must have finite pixels")
        object.__setattr__(self, "pixels", made)

    @cached_property
    def key(self) -> str:
        """Content hash of pixels and encoding."""
        return f"{content_hash(self.pixels)}-{self.encoding}"

    @property
    def nbytes(self) -> int:
        """Bytes of the pixels."""
        return int(self.pixels.nbytes)


@dataclass(frozen=True)
class Texture:
    """A picture laid on a surface, repeated; multiplies its parameter.

    uv ↦ scale · (uv, turned) + offset. Turned: the picture lies `rotation` degrees counter-clockwise about
    the origin of uv, where one unit of v is as long as `aspect` units of u. So any size in metres can be
    turned without being sheared, and so can what KHR_texture_transform says: −rotation, with a uniform scale.
    Raises ValueError for what is not finite.
    """

    image: Image
    scale: tuple[float, float] = (1.0, 1.0)
    offset: tuple[float, float] = (0.0, 0.0)
    rotation: float = 0.0
    aspect: float = 1.0

    def __post_init__(self) -> None:
        if not all(math.isfinite(n) for n in (*self.scale, *self.offset, self.rotation, self.aspect)):
            raise ValueError("a picture must lie at finite numbers")

    @cached_property
    def affine(self) -> tuple[float, float, float, float, float, float]:
        """(a, b, t, c, d, s): (u, v) ↦ (a u + b v + t, c u + d v + s)."""
        cosine, sine = _turn(self.rotation)
        (wide, high), (t, s), aspect = self.scale, self.offset, self.aspect
        return wide * cosine, wide * aspect * sine, t, -high * sine, high * aspect * cosine, s

    def placed(self, uvs: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
        """(P, 2) places in the picture, not yet repeated, of texture coordinates (P, 2)."""
        a, b, t, c, d, s = (np.float32(number) for number in self.affine)
        u, v = uvs[:, 0], uvs[:, 1]
        return np.stack([u * a + v * b + t, u * c + v * d + s], axis=1)

    @property
    def area(self) -> float:
        """Of one unit of uv in the picture: how often it lies there."""
        a, b, _, c, d, _ = self.affine
        return abs(a * d - b * c)


def _turn(degrees: float) -> tuple[float, float]:
    """Cosine and sine, exact for quarters of a turn."""
    quarters, rest = divmod(degrees, 90.0)
    if rest == 0:
        return ((1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0))[int(quarters % 4)]
    return math.cos(math.radians(degrees)), math.sin(math.radians(degrees))


@dataclass(frozen=True, eq=False)
class Table:
    """Numbers a reflectance model reads: (A, B, C, channels) float32, and where they are from.

    Raises ValueError when the shape does not fit or a number is not finite.
    """

    values: npt.NDArray[np.float32]
    name: str = ""

    def __post_init__(self) -> None:
        made = readonly(self.values, np.float32, -1, -1, -1, -1)
        if 0 in made.shape:
            raise ValueError(f"a table of shape {made.shape} cannot be used")
        if not (np.isfinite(made.min()) and np.isfinite(made.max())):
            raise ValueError("a table must be finite")
        object.__setattr__(self, "values", made)

    @cached_property
    def key(self) -> str:
        """Content hash of the numbers."""
        return content_hash(self.values)

    @property
    def nbytes(self) -> int:
        """Bytes of the numbers."""
        return int(self.values.nbytes)
