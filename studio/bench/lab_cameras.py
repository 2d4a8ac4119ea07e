"""The lab's light as files of cameras that nobody calibrated: curves, brackets, Exif, folders, white balance.

`write_bracketed` writes what `shoot` gave (linear, exact or noisy) through a response curve into 8 or 16
bits, an exposure a file.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from studio.bench.lab import F32, LabShots
from studio.bench.phone_files import write_photograph
from studio.bench.phone_response import Curve
from studio_core.imaging.photograph import Photograph, ShotFacts

Name = Callable[[float, float, int, float], str]
"""The name of a file, without ending, of an azimuth, a height, the number of the exposure and its EV."""


def flat_name(azimuth: float, height: float, number: int, ev: float) -> str:
    """`cloth_-60_3`: which of the exposures it is, not how long."""
    return f"cloth_{azimuth:+.0f}_{number + 1}"


def folder_name(azimuth: float, height: float, number: int, ev: float) -> str:
    """`m60/IMG_0003`: a folder a lamp."""
    return f"{'m' if azimuth < 0 else 'p'}{abs(azimuth):.0f}/IMG_{number + 1:04}"


@dataclass(frozen=True)
class Camera:
    """A camera: `curve`, `bits` (8: JPEG of `quality`; 16: PNG), light that fills it at EV 0 (`full`), what
    it makes of white (`white`), exposures (`evs`) and what it says of them (`listed`, or None for no Exif).
    """

    curve: Curve = Curve()
    bits: int = 8
    quality: int = 95
    full: float = 1.0
    white: tuple[float, float, float] = (1.0, 1.0, 1.0)
    evs: tuple[float, ...] = (0.0,)
    listed: tuple[float, ...] | None = None

    def encoded(self, light: F32, ev: float) -> np.ndarray:
        """(H, W, 3) whole numbers of linear light."""
        top = 2**self.bits - 1
        made = [self.curve.encode(light[..., c] * (self.white[c] * 2.0**ev / self.full), c) for c in range(3)]
        return np.rint(np.stack(made, axis=-1) * top).astype(np.uint8 if self.bits == 8 else np.uint16)


def write_bracketed(shots: LabShots, folder: Path, camera: Camera, name: Name = flat_name) -> None:
    """Every light under every exposure."""
    for i, (azimuth, height) in enumerate(shots.told.angles().tolist()):
        for k, ev in enumerate(camera.evs):
            suffix = "jpg" if camera.bits == 8 else "png"
            path = folder / f"{name(azimuth, height, k, ev)}.{suffix}"
            path.parent.mkdir(parents=True, exist_ok=True)
            seconds = 0.01 * 2.0 ** camera.listed[k] if camera.listed is not None else None
            facts = ShotFacts(path.name, seconds=seconds, iso=100.0, aperture=8.0, camera="Lab")
            shot = Photograph(camera.encoded(shots.pictures[i], ev), facts, "")
            write_photograph(shot, path, exif=camera.listed is not None, quality=camera.quality)
