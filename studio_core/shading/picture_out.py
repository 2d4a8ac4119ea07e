"""A picture of a scene into a file: shaded, measured if asked for, and written band by band."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from studio_core.imaging.picture import Finish, PictureFile, channel_names
from studio_core.imaging.rows import Facts
from studio_core.scene.nodes import Scene
from studio_core.session import View
from studio_core.shading.artifacts import MeasuredError, Radiance
from studio_core.shading.bands import BETWEEN, Band, Parts, PictureMaker, layers_of, shading_share
from studio_core.shading.job import Job
from studio_core.shading.job_parts import JobPart


@dataclass(frozen=True)
class Outcome:
    """What became of a picture: mean radiance (nan where some pixel is not finite), seconds for each half."""

    radiance: Radiance
    mean: float
    error: MeasuredError | None
    shading: float
    composing: float

    @property
    def finite(self) -> bool:
        """Whether every pixel is a number."""
        return math.isfinite(self.mean)


def write_view(
    maker: PictureMaker,
    scene: Scene,
    view: View,
    path: Path,
    finish: Finish,
    job: Job,
    *,
    parts: Parts | None = None,
    places: int = 0,
    facts: Facts | None = None,
    watch: Callable[[Band], object] | None = None,
) -> Outcome:
    """Make the picture that `view` sees of the scene, and put it at `path` when it is whole.

    `places`: of so many random places the error is measured and told in the file (0: none). `watch` gets
    every band. Cancelled, or when the disk refuses (InputError), nothing is left.
    """
    parts, started, share = parts or Parts(), time.perf_counter(), shading_share(view)
    radiance = maker.shade(scene, view, JobPart(job, 0.0, share, job.label))
    told = {
        "lucarne:exposure": finish.exposure,
        "lucarne:tonemap": finish.tonemap,
        "lucarne:samples": view.antialias**2,
        **(facts or {}),
    }
    error = maker.measure(places, JobPart(job, share, share)) if places else None
    if error is not None:
        told["lucarne:error"] = str(error.picture)
    shaded = time.perf_counter()
    nodes = layers_of(scene, radiance) if parts.lights else ()
    names = channel_names(tuple(BETWEEN if node == BETWEEN else scene[node].name for node in nodes))
    total, count = 0.0, view.width * view.height * 3
    size = (view.width, view.height)
    with PictureFile(path, size, finish, alpha=parts.transparent, lights=names, facts=told) as file:
        for band in maker.bands(JobPart(job, share, 1.0), parts):
            lights = {name: band.lights[node] for name, node in zip(names, nodes, strict=True)}
            file.write(band.linear, band.alpha, lights)
            total += float(band.linear.sum(dtype=np.float64))
            if watch is not None:
                watch(band)
    JobPart(job, share, 1.0).at(1.0)
    done = time.perf_counter()
    return Outcome(radiance, total / count, error, shaded - started, done - shaded)
