"""A request's photographs as samples: the folder read, the ball found or the flat piece cut out."""

from __future__ import annotations

import math

from studio_core.errors import InputError
from studio_core.fitting import FitRequest
from studio_core.shading.job import Job
from studio_plugins.residual.ball import find_ball
from studio_plugins.residual.flat import flat_samples
from studio_plugins.residual.light_check import checked
from studio_plugins.residual.lights import read_list
from studio_plugins.residual.pictures import Pictures, read_folder
from studio_plugins.residual.reflectance_map import reflectance_maps
from studio_plugins.residual.samples import Ball, Flags, Samples

_LEAST_BALL, _LEAST_FLAT = 1.01, 0.1  # distances of the camera


def read_samples(request: FitRequest, job: Job) -> tuple[Samples, dict[str, object], tuple[str, ...]]:
    """Samples, what was found out about them, and sentences. InputError in one sentence."""
    if not 8 <= request.size <= 2048:
        raise InputError(f"a map of {request.size} texels cannot be made: maps have 8 to 2048 a side")
    least = _LEAST_FLAT if request.flat else _LEAST_BALL
    if request.distance is not None and not request.distance > least:
        outside = "in front of the sample" if request.flat else "outside of the ball"
        raise InputError(f"a distance of {request.distance:g} cannot be used: the camera is {outside}")
    listed = read_list(request.lamps) if request.lamps is not None else None
    pictures = read_folder(request.folder, listed, job)
    height, width = pictures.size
    found: dict[str, object] = {"pictures": [width, height], "lights": len(pictures.lights)}
    distance = request.distance or float("inf")
    if request.flat:
        return flat_samples(pictures, request.size, pictures.mask, distance), found, pictures.notes
    samples, ball, more = on_ball(pictures, None, pictures.mask, distance, request.size)
    return samples, {**found, "ball": ball}, more


def on_ball(
    pictures: Pictures,
    ball: Ball | None,
    mask: Flags | None = None,
    distance: float = float("inf"),
    size: int = 256,
    check: bool = True,
) -> tuple[Samples, dict[str, float | None], tuple[str, ...]]:
    """Samples of a ball that is found unless it is told, where it is in pixels of the files, and sentences.

    `check`: directions and distance of lights may be mended by what the pictures show (`light_check`).
    """
    spread = 0.0
    if ball is None:
        seen = find_ball(pictures.light, distance, mask)
        ball, spread = seen.ball, seen.spread
    lights, notes = pictures.lights, pictures.notes
    if check:
        told = checked(pictures.light, pictures.clipped, ball, lights)
        ball, lights, notes = told.ball, told.lights, (*notes, *told.notes)
    samples = reflectance_maps(pictures.light, pictures.clipped, ball, lights, size)
    factor = pictures.factor
    found: dict[str, float | None] = {
        "x": ball.x * factor,
        "y": ball.y * factor,
        "radius": ball.radius * factor,
        "spread": spread * factor,
        "distance": ball.distance if math.isfinite(ball.distance) else None,
    }
    return samples, found, notes


__all__ = ["on_ball", "read_samples"]
