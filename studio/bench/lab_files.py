"""The lab's pictures as files: with names that tell azimuths, or with an `.lp` file or a table of angles."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from studio.bench.lab import LabShots
from studio_core.imaging.encode import write_exr, write_png
from studio_core.imaging.transfer import linear_to_srgb
from studio_plugins.residual.lights import write_lp, write_table
from studio_plugins.residual.samples import Lights

LISTS = ("names", "lp", "table")


def write_shots(
    shots: LabShots, folder: Path, *, kind: str = "exr", lights: str = "names", times: tuple[float, ...] = ()
) -> Path | None:
    """Write a picture a light; with `times` (seconds) a bracket of PNG files a light.

    kind: "exr" (linear) or "png" (8 bit sRGB, clipped at 1); lights: one of `LISTS`. The list's path, if any.
    """
    if lights not in LISTS:
        raise ValueError(f"lights are told by one of {', '.join(LISTS)}")
    names = []
    for i, (azimuth, height) in enumerate(shots.told.angles()):
        stem = f"az{azimuth:+.1f}_el{height:+.1f}" if lights == "names" else f"shot{i + 1:03}"
        for time in times or (1.0,):
            name = f"{stem}_t{time:g}" if times else stem
            picture = shots.pictures[i] * np.float32(time)
            if kind == "exr":
                write_exr(folder / f"{name}.exr", picture)
            else:
                write_png(folder / f"{name}.png", linear_to_srgb(picture))
            names.append((f"{name}.{kind}", i))
    if lights == "names":
        return None
    told = shots.told.some([i for _, i in names])
    listed = Lights(told.directions, told.strengths, tuple(name for name, _ in names), told.source)
    path = folder / ("lights.lp" if lights == "lp" else "lights.csv")
    (write_lp if lights == "lp" else write_table)(path, listed)
    return path
