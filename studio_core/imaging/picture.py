"""Rendered pictures as files: scene-linear EXR, or PNG as the display shows it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import numpy.typing as npt

from studio_core.errors import InputError
from studio_core.imaging.encode import write_exr, write_png
from studio_core.kernels.tonemap import Kind, tonemap


def write_picture(
    path: Path, linear: npt.NDArray[np.float32], *, exposure: float = 0.0, kind: Kind = "srgb"
) -> None:
    """Write (H, W, 3) scene-linear radiance; exposure (EV) and tone curve act on PNG only."""
    match path.suffix.lower():
        case ".exr":
            write_exr(path, linear)
        case ".png":
            write_png(path, tonemap(linear, exposure, kind))
        case _:
            raise InputError(f"{path.name}: pictures are written as .png or .exr")
