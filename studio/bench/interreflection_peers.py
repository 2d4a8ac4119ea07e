"""Mitsuba's `path` integrator as the peer of `lucarne bench interreflection`, of as many bounces.

What comes straight from lamps and sky into the eye is hidden in its pictures and left out of errors, so that
they are of what is lit. So is what a lamp's rectangle hides or shades: it stops light there, and not in ours.
An edit costs Mitsuba a new picture, and next to nothing beyond.
"""

from __future__ import annotations

import dataclasses
import math
import tempfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import numpy.typing as npt

from studio.bench.cuts_peers import Peer, content, converged_half, lit_error
from studio.bench.interreflection_truth import Truth
from studio.headless import Headless
from studio_core.folders import user_cache
from studio_core.scene.nodes import AreaLamp, Environment, PointLamp, Scene, SpotLamp
from studio_core.session import View
from studio_core.shading.cache import DiskCache
from studio_core.shading.offline import scene_view

F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]
METHOD = "Mitsuba, converged paths, 1"
FAR = 1e4
MARGIN = 1.2
"""By which lamps are taken for larger: those that shine have a size, too."""


def path_peer(
    scene: Scene,
    program: Headless,
    size: tuple[int, int],
    bounces: int,
    samples: Sequence[int],
    converged: int,
    distance: F32,
) -> Peer:
    """Mitsuba at each of `samples` a pixel, against 2 × `converged` samples; `size` is (width, height).

    It looks through the scene's first camera. Errors are of pixels that show something lit, and
    nothing that an area lamp hides or shades; distance (H, W) is that of what they show.
    """
    from studio_plugins.export.mitsuba_run import DirectRenderer

    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        program.registry.get("exporter", "mitsuba").save(scene, folder, program.registry)
        key = (content(scene, folder), size, bounces, converged)
        renderer = DirectRenderer(folder, size, max_depth=bounces + 2)
        cache = DiskCache(user_cache() / "peers")
        lamps = behind_lamps(scene, scene_view(scene, None, *size), distance)
        halves = []
        for half in (0, 1):
            kept = cache.get(METHOD, *key, half)
            if kept is None:
                kept = {"linear": converged_half(renderer, converged, half)}
                cache.put(kept, METHOD, *key, half)
            halves.append(np.where(lamps[..., None], 0, kept["linear"]))
        seconds, errors = [], []
        for number, spp in enumerate(samples):
            picture, taken = renderer.timed(spp, seed=1_000_000 + number)
            _, again = renderer.timed(spp, seed=2_000_000 + number)
            seconds.append(min(taken, again))  # in Mitsuba's favour where others use the machine
            errors.append(lit_error(picture, *halves))
    return Peer(tuple(seconds), tuple(errors), (halves[0], halves[1]))


def without_sky(scene: Scene) -> Scene:
    """The scene with no environment to be seen: only lit by them."""
    skies = [dataclasses.replace(sky, background=False) for sky in scene.of(Environment)]
    return scene.with_nodes(*skies)


def behind_lamps(scene: Scene, view: View, distance: F32) -> npt.NDArray[np.bool_]:
    """(H, W) pixels that show an area lamp's rectangle or what is in the shadow of one, and those beside.

    distance (H, W) is metres along the ray of a pixel, inf where nothing is met.
    """
    import cv2

    high, wide = view.height, view.width
    slope = math.tan(math.radians(view.fov) / 2)
    y = (1 - 2 * (np.arange(high)[:, None] + 0.5) / high) * slope
    x = (2 * (np.arange(wide)[None] + 0.5) / wide - 1) * slope * wide / high
    rays = np.stack(np.broadcast_arrays(x, y, -1.0), axis=2)
    rays = rays / np.linalg.norm(rays, axis=2, keepdims=True) @ view.transform.matrix()[:3, :3].T
    eye = view.transform.matrix()[:3, 3]
    met = eye + rays * np.minimum(distance, FAR)[..., None]
    found = np.zeros((high, wide), np.bool_)
    kinds = (PointLamp, SpotLamp, AreaLamp)
    lamps = [lamp for kind in kinds for lamp in scene.of(kind) if scene.shown(lamp.id)]
    for lamp in lamps:
        if isinstance(lamp, AreaLamp):
            found |= _crossed(scene, lamp, met, eye)
            for other in lamps:
                if other is not lamp:
                    found |= _crossed(scene, lamp, met, scene.world(other.id).matrix()[:3, 3])
    return np.asarray(cv2.dilate(found.astype(np.uint8), np.ones((9, 9), np.uint8)) > 0)


def _crossed(scene: Scene, lamp: AreaLamp, start: F64, end: F64) -> npt.NDArray[np.bool_]:
    """(H, W) whether the way from start (H, W, 3) to end (3,) leads through a lamp's rectangle."""
    own = np.linalg.inv(scene.world(lamp.id).matrix())
    one, other = start @ own[:3, :3].T + own[:3, 3], own[:3, :3] @ end + own[:3, 3]
    rise = other[2] - one[..., 2]
    at = np.divide(-one[..., 2], rise, out=np.full(rise.shape, -1.0), where=rise != 0)
    place = one[..., :2] + at[..., None] * (other[:2] - one[..., :2])
    inside = (2 * np.abs(place) < MARGIN * np.array([lamp.width, lamp.height])).all(axis=2)
    return np.asarray((at > 0) & (at < 1) & inside)


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
