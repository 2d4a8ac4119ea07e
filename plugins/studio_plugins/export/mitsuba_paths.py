"""Light between surfaces by Mitsuba 3's own `path` integrator, from an exported folder, to check ours.

Needs the extra `peers`; Mitsuba is imported inside the functions.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from studio_plugins.export.mitsuba_run import BATCH, REPLICATES, Estimate, load, mitsuba

F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]
Sent = Callable[[Any, Any], Any]


def indirect_irradiance(
    scene: Any,
    positions: npt.ArrayLike,
    normals: npt.ArrayLike,
    bounces: int,
    spp: int,
    *,
    offset: float = 1e-4,
    seed: int = 0,
) -> Estimate:
    """(V, 3) irradiance by way of 1 to `bounces` surfaces, with its standard error.

    `scene` is an exported folder or a loaded Mitsuba scene (llvm_ad_rgb). Rays start `offset` metres above
    positions (V, 3), distributed as the cosine with normals (V, 3).
    """
    mi = mitsuba()
    import drjit as dr

    scene = _loaded(scene)
    p, n = (np.ascontiguousarray(a, np.float32) for a in (positions, normals))
    path = _integrator(mi, bounces + 1)

    def sent(rows: Any, sampler: Any) -> Any:
        normal = mi.Normal3f(*n[rows].T)
        local = mi.warp.square_to_cosine_hemisphere(sampler.next_2d())
        ray = mi.Ray3f(mi.Point3f(*(p + np.float32(offset) * n)[rows].T), mi.Frame3f(normal).to_world(local))
        return dr.pi * _along(mi, path, scene, sampler, ray, True)

    return _estimated(mi, len(p), spp, seed, sent)


def indirect_radiance(
    scene: Any, origins: npt.ArrayLike, directions: npt.ArrayLike, bounces: int, spp: int, *, seed: int = 0
) -> Estimate:
    """(V, 3) what surfaces send back along rays, of light that came by 1 to `bounces` others, and its error.

    Rays (V, 3) from the eye, of unit directions; the surface that each meets is shaded by the scene's own
    BSDF, whose samples go on as paths. Where a ray meets nothing, or a lamp, it is 0.
    """
    mi = mitsuba()
    import drjit as dr

    scene = _loaded(scene)
    o, d = (np.ascontiguousarray(a, np.float32) for a in (origins, directions))
    path = _integrator(mi, bounces + 1)

    def sent(rows: Any, sampler: Any) -> Any:
        si = scene.ray_intersect(mi.Ray3f(mi.Point3f(*o[rows].T), mi.Vector3f(*d[rows].T)))
        active = si.is_valid()
        bs, weight = si.bsdf().sample(mi.BSDFContext(), si, sampler.next_1d(), sampler.next_2d(), active)
        active &= bs.pdf > 0
        ray = si.spawn_ray(si.to_world(bs.wo))
        return dr.select(active, weight * _along(mi, path, scene, sampler, ray, active), 0)

    return _estimated(mi, len(o), spp, seed, sent)


def _loaded(scene: Any) -> Any:
    return load(Path(scene)) if isinstance(scene, str | Path) else scene


def _integrator(mi: Any, max_depth: int) -> Any:
    """Lamps and the sky are not seen along the ray itself, so what it brings came by way of a surface."""
    return mi.load_dict({"type": "path", "max_depth": max_depth, "rr_depth": 64, "hide_emitters": True})


def _along(mi: Any, path: Any, scene: Any, sampler: Any, ray: Any, active: Any) -> Any:
    return path.sample(scene, sampler, mi.RayDifferential3f(ray), None, active)[0]


def _estimated(mi: Any, count: int, spp: int, seed: int, sent: Sent) -> Estimate:
    """Means over `spp` samples in `REPLICATES` independent parts, whose differences give the error."""
    each = max(1, -(-spp // REPLICATES))
    total, squares = np.zeros((count, 3)), np.zeros((count, 3))
    block = max(1, BATCH // each)
    for part in range(REPLICATES):
        mean = np.zeros((count, 3))
        for start in range(0, count, block):
            rows = np.repeat(np.arange(start, min(start + block, count)), each)
            sampler = mi.load_dict({"type": "independent"})
            sampler.seed((seed * REPLICATES + part) * 1_000_003 + start, len(rows))
            values = np.array(sent(rows, sampler), np.float64).reshape(3, -1, each)
            mean[start : start + block] = values.mean(axis=2).T
        total += mean
        squares += mean**2
    value = total / REPLICATES
    variance = np.maximum(squares / REPLICATES - value**2, 0) / (REPLICATES - 1)
    return Estimate(value, np.sqrt(variance))


__all__ = ["indirect_irradiance", "indirect_radiance"]
