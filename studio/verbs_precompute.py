"""`lucarne precompute`: what a backend keeps on disk is made now, so that the window need not."""

from __future__ import annotations

import argparse
import time
from collections.abc import Mapping

from studio.headless import Headless
from studio.verbs import chosen_backend, open_scene, result
from studio_core.errors import InputError

WIDTH, HEIGHT = 960, 540


def precompute(options: argparse.Namespace, program: Headless) -> None:
    """Brings the backend's caches to completeness for a project.

    A backend that precomputes has `precompute(scene, view, params, services, job)`, which gives numbers by
    name: `bytes` on disk, and how much of what it needs was there (`…_cached`). InputError for another one.
    """
    from studio_core.shading.offline import scene_view

    backend, params = chosen_backend(options, program)
    make = getattr(backend, "precompute", None)
    if make is None:
        raise InputError(
            f"--backend {backend.id}: it keeps nothing on disk, so there is nothing to precompute"
        )
    scene = open_scene(options.project)
    view = scene_view(scene, options.camera, WIDTH, HEIGHT)
    started = time.perf_counter()
    with program.job("Precomputing") as job:
        found: Mapping[str, int | float] = make(scene, view, params, program.services, job)
    seconds = time.perf_counter() - started
    values = {**found, "project": str(options.project), "backend": backend.id, "seconds": seconds}
    parts = ", ".join(f"{name.replace('_', ' ')} {_number(name, value)}" for name, value in found.items())
    result(options, program, values, f"{options.project}: {seconds:.1f} s{parts and '; '}{parts}")


def _number(name: str, value: int | float) -> str:
    return f"{value / 1e6:.1f} MB" if name.split("_")[0] == "bytes" else f"{value:,g}"
