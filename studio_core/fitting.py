"""Materials from photographs of a sample under known lamps: what is asked for, and what a fitter answers.

Pictures are those of the sample's map, (h, w, 3) scene-linear Rec.709, as under a lamp of strength 1: a white
matte surface that faces it has the value 1. Directions are in the camera's frame: x to the right, y up, z
towards the camera. Errors are nMSE = Σ difference² / Σ measured² over what is lit and not clipped.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from studio_core.scene.nodes import Material

F32 = npt.NDArray[np.float32]
Flags = npt.NDArray[np.bool_]

NONE, CHECKERBOARD, INNER_OUTER, ONE_ROW = "none", "checkerboard", "inner-outer", "one-row"
HELD = (CHECKERBOARD, INNER_OUTER, ONE_ROW, NONE)
"""Which lamps are held back to be asked about: every other one, the outer half, all but one row, none."""
SIZES = (64, 128, 256, 512)
"""Texels along a side that are offered."""


@dataclass(frozen=True)
class FitRequest:
    """What is to be fitted.

    folder: photographs, a lamp each (or several exposures of it); lamps: a list of where they were, None for
    file names or a list in the folder; flat: a flat sample rather than a ball; distance: of the camera's
    centre, in radii of the ball or widths of the flat picture, None for a far one; size: texels along the
    map's longer side; held: one of `HELD`; whole: make the material of all lamps once those held back have
    been asked about.
    """

    folder: Path
    lamps: Path | None = None
    flat: bool = False
    distance: float | None = None
    size: int = 256
    held: str = CHECKERBOARD
    whole: bool = True


@dataclass(frozen=True)
class LampError:
    """One lamp: its picture's name, azimuth and height in degrees (0, 0 is the camera), whether it was held
    back, and nMSE in all, outside of highlights, and of the model without what each spot has of its own.
    """

    name: str
    azimuth: float
    height: float
    held: bool
    whole: float
    outside: float
    alone: float


@dataclass(frozen=True)
class Quality:
    """nMSE over several lamps: in all, outside of highlights, and of the model alone."""

    whole: float
    outside: float
    alone: float


@dataclass(frozen=True)
class Figures:
    """What is told of a fit. `unseen`: over lamps held back (None where there were none), `seen`: over those
    that the measured fit had; `rank`: how many of the basis' `columns` lamps tell apart, of most spots.
    """

    unseen: Quality | None
    seen: Quality
    model: str
    basis: str
    columns: int
    rank: int
    bytes_per_texel: int
    bytes_in_all: int
    texels: tuple[int, int]


class Fitted(Protocol):
    """A fitted material, and all that can be asked about how good it is. Read only; from any thread."""

    @property
    def material(self) -> Material:
        """Ready for a scene."""
        ...

    @property
    def about(self) -> str:
        """A description for the library."""
        ...

    @property
    def tags(self) -> tuple[str, ...]:
        """Words that the library finds it by."""
        ...

    @property
    def notes(self) -> tuple[str, ...]:
        """What was noticed, in sentences."""
        ...

    @property
    def figures(self) -> Figures:
        """Numbers of the fit as a whole."""
        ...

    @property
    def lamps(self) -> tuple[LampError, ...]:
        """Of every lamp."""
        ...

    @property
    def report(self) -> Mapping[str, Any]:
        """All of it, for JSON."""
        ...

    def photograph(self, lamp: int) -> F32:
        """What was measured under a lamp."""
        ...

    def trusted(self, lamp: int) -> Flags:
        """(h, w) what counts of it: lit, not clipped, on the sample."""
        ...

    def reconstruction(self, lamp: int) -> F32:
        """What the fit says of the same lamp, as its error was measured."""
        ...

    def relit(self, azimuth: float, height: float) -> F32:
        """The sample under any lamp, angles in degrees; of at most 128 texels a side, so that a hand may
        drag the lamp.
        """
        ...


def relative_error(made: F32, seen: F32, trusted: Flags) -> F32:
    """(h, w) |difference| over the root mean square of what was measured; NaN where nothing counts."""
    power = float((seen[trusted].astype(np.float64) ** 2).mean()) if trusted.any() else 0.0
    off = np.linalg.norm(made.astype(np.float32) - seen, axis=-1) / np.sqrt(max(3 * power, 1e-20))
    return np.asarray(np.where(trusted, off, np.nan), np.float32)


__all__ = [
    "CHECKERBOARD",
    "HELD",
    "INNER_OUTER",
    "NONE",
    "ONE_ROW",
    "SIZES",
    "Figures",
    "FitRequest",
    "Fitted",
    "LampError",
    "Quality",
    "relative_error",
]
