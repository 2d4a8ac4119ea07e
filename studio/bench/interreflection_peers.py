"""Mitsuba's `path` integrator as the peer of `lucarne bench interreflection`, of as many bounces.

What comes straight from lamps and sky into the eye is hidden in its pictures and left out of errors, so that
they are of what is lit. An edit costs Mitsuba a new picture, and next to nothing beyond.
"""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import numpy.typing as npt

from studio.bench.cuts_peers import Peer, content, converged_half, lit_error
from studio.bench.interreflection_truth import Truth
from studio.headless import Headless
from studio_core.folders import user_cache
from studio_core.scene.nodes import Scene
from studio_core.shading.cache import DiskCache

F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]
METHOD = "Mitsuba, converged paths, 1"


def path_peer(
    scene: Scene,
    program: Headless,
    size: tuple[int, int],
    bounces: int,
    samples: Sequence[int],
    converged: int,
) -> Peer:
    """Mitsuba at each of `samples` a pixel, against 2 × `converged` samples; `size` is (width, height).

    It looks through the scene's first camera. Errors are of pixels that show something lit.
    """
    from studio_plugins.export.mitsuba_run import DirectRenderer

    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        program.registry.get("exporter", "mitsuba").save(scene, folder, program.registry)
        key = (content(scene, folder), size, bounces, converged)
        renderer = DirectRenderer(folder, size, max_depth=bounces + 2)
        cache = DiskCache(user_cache() / "peers")
        halves = []
        for half in (0, 1):
            kept = cache.get(METHOD, *key, half)
            if kept is None:
                kept = {"linear": converged_half(renderer, converged, half)}
                cache.put(kept, METHOD, *key, half)
            halves.append(kept["linear"])
        seconds, errors = [], []
        for number, spp in enumerate(samples):
            picture, taken = renderer.timed(spp, seed=1_000_000 + number)
            _, again = renderer.timed(spp, seed=2_000_000 + number)
            seconds.append(min(taken, again))  # in Mitsuba's favour where others use the machine
            errors.append(lit_error(picture, *halves))
    return Peer(tuple(seconds), tuple(errors), (halves[0], halves[1]))


def disagreement(
    scene: Scene, program: Headless, origins: F64, normals: F32, truth: Truth, bounces: int, samples: int
) -> tuple[float, float]:
    """Relative RMSE of irradiance by way of surfaces against Mitsuba, without noise; and its noise.

    Both have two independent halves; (ours − theirs) of one times that of the other is the squared difference
    alone. Rays start at origins (N, 3), where those of our own tracer do.
    """
    from studio_plugins.export.mitsuba_paths import indirect_irradiance

    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        program.registry.get("exporter", "mitsuba").save(scene, folder, program.registry)
        theirs = [
            indirect_irradiance(str(folder), origins, normals, bounces, samples, offset=0.0, seed=seed).value
            for seed in (1, 2)
        ]
    ours = [np.asarray(half.irradiance, np.float64) for half in (truth.first, truth.second)]
    mean = float(np.mean(ours))
    squared = float(np.mean((ours[0] - theirs[0]) * (ours[1] - theirs[1])))
    noise = float(np.sqrt(np.mean((theirs[0] - theirs[1]) ** 2)) / 2)
    return float(np.sqrt(max(squared, 0.0))) / mean, noise / mean
