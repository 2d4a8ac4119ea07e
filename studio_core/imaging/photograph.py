"""A photograph as the camera wrote it: encoded numbers, and what it says about its exposure."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
import numpy.typing as npt


@dataclass(frozen=True)
class ShotFacts:
    """What a photograph's metadata tell; None or "" where they don't. Positions are never read.

    `taken`: seconds, camera's own clock, any origin. `bias`: EV of the exposure correction. `orientation`:
    Exif's (1 … 8), by which the pixels were turned upright.
    """

    name: str
    seconds: float | None = None
    iso: float | None = None
    aperture: float | None = None
    bias: float | None = None
    taken: float | None = None
    camera: str = ""
    lens: str = ""
    orientation: int = 1

    @property
    def ev(self) -> float | None:
        """log2 of time × ISO / aperture²: light let in and amplified, any origin; None when unknown.

        A missing ISO or aperture counts as 100 and 1: both are mostly the same for all shots.
        """
        if not self.seconds or self.seconds <= 0:
            return None
        return math.log2(self.seconds * (self.iso or 100.0) / (self.aperture or 1.0) ** 2)


@dataclass(frozen=True, eq=False)
class Photograph:
    """(H, W, 3) upright pixels: uint8 or uint16 as encoded by the camera, or float32 linear.

    `digest` names the file's content; `notes` are sentences on what was converted. `colour`: the nine numbers
    of a matrix, rows first, that makes linear Rec.709 of these numbers once they are linear light; empty
    where they are Rec.709's or nothing is said (phones often write Display P3).
    """

    pixels: npt.NDArray[Any]
    facts: ShotFacts
    digest: str
    notes: tuple[str, ...] = ()
    colour: tuple[float, ...] = ()

    @property
    def kind(self) -> Literal["8 bit", "16 bit", "linear"]:
        """What the numbers are."""
        if self.pixels.dtype == np.uint8:
            return "8 bit"
        return "16 bit" if self.pixels.dtype == np.uint16 else "linear"

    @property
    def size(self) -> tuple[int, int]:
        """Width and height."""
        return self.pixels.shape[1], self.pixels.shape[0]


def in_rec709(light: npt.NDArray[np.float32], colour: tuple[float, ...]) -> npt.NDArray[np.float32]:
    """Linear light (..., 3) of a photograph's own primaries as Rec.709 (`Photograph.colour`).

    Colours that Rec.709 cannot show would have a negative part; it becomes 0.
    """
    if not colour:
        return light
    matrix = np.asarray(colour, np.float32).reshape(3, 3)
    made: npt.NDArray[np.float32] = np.maximum(light @ matrix.T, np.float32(0))
    return made
