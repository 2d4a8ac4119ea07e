"""The part of `lucarne bench materials` about captured materials in a scene: cases `scene/…`.

`fusion_rel_error`: mean |light sums · coefficients − Σ L V (f_r n·l + δ*) Δω| over the mean of the latter, at
places of a captured floor and a captured box, with the fit's own functions and all 2^15 directions for the
truth. `residual_cost_ratio`: the light sum with E_H in it over that of the same material without a residual;
`pixel_cost_ratio` and `shader_cost_ratio`: pixels by the program and OpenGL's drawing, likewise.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt

from studio.bench.capture import found_maps, read_map
from studio.bench.harness import Report
from studio.bench.materials_captured import CHOSEN, EXACT, photographed
from studio.bench.materials_normals import costs, floor_scene
from studio.headless import Headless
from studio_core.arrays import frozen_map
from studio_core.contract import Services
from studio_core.params import defaults
from studio_core.scene.diff import everything
from studio_core.scene.geometry import Image
from studio_core.scene.nodes import Environment, Material, PointLamp, Scene
from studio_core.shading.artifacts import Casters, Lighting, Radiance, ShadingPoints
from studio_core.shading.brute_force import VisibilityBits, beams
from studio_core.shading.frame import Frame
from studio_core.shading.job import Job
from studio_core.shading.offline import backend_params, scene_view
from studio_core.shading.pipeline import Pipeline
from studio_plugins.residual.fit import fit
from studio_plugins.residual.material import scene_material
from studio_plugins.residual.model import MODEL, RESIDUAL
from studio_plugins.residual.result import ResidualFit
from studio_plugins.residual.shading import shade

F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]

LEVEL = 15
PLACES = 200
BACKENDS = ("reference", "cuts")
FITTED = ("bumpy", "glossy")
_MAP = 48


def fitted(name: str, basis: str = "albedo-half") -> ResidualFit:
    """A material of the lab, photographed without faults."""
    settings = dataclasses.replace(CHOSEN, basis=basis, refine=0, table=False, cautious=False)
    return fit(photographed(name, EXACT, _MAP).samples, settings)


def captured_scene(material: Material, sky: Image | None = None) -> Scene:
    """The floor and box of the normal maps' scene, captured both; where given, under another sky alone."""
    scene = floor_scene("matte", None)
    made = [dataclasses.replace(material, id=name) for name in scene.materials]
    scene = scene.with_materials(*made)
    if sky is None:
        return scene
    dark = [dataclasses.replace(lamp, hidden=True) for lamp in scene.of(PointLamp)]
    return scene.with_nodes(dataclasses.replace(next(scene.of(Environment)), image=sky), *dark)


def fusion(services: Services, found: ResidualFit, sky: Image, backend: str, places: int = PLACES) -> float:
    """`fusion_rel_error` of a backend's vertices under a sky."""
    material = scene_material(found, "captured").material
    scene = captured_scene(material, sky)
    maker = services.registry.get("backend", backend)
    wanted: dict[str, Any] = {"vertices": 2000}
    if backend == "reference":
        wanted |= {"directions": str(1 << LEVEL), "quarters": False}
    frame = Frame(scene, scene_view(scene, None, 96, 64), backend_params(maker, wanted), 1)
    pipeline = Pipeline(maker.stages(services))
    pipeline.update(frame, everything(scene), Job("shading"))
    radiance, lighting = pipeline.artifact(Radiance), pipeline.artifact(Lighting)
    casters = pipeline.artifact(Casters)
    assert radiance is not None
    assert lighting is not None
    assert casters is not None
    mesh, (layer,) = radiance.surfaces.mesh, radiance.layers.values()
    rng = np.random.default_rng(3)
    valid = np.flatnonzero(radiance.valid)
    some = rng.choice(valid, min(places, len(valid)), replace=False)
    arriving = _arriving(services, lighting, casters, mesh, some)
    eye = np.asarray(frame.view.transform.translation) - mesh.origin
    texels = rng.integers(0, found.normals.shape[0] * found.normals.shape[1], len(some))
    made, truth = np.empty((2, len(some), 3))
    for row, (p, texel) in enumerate(zip(some, texels, strict=True)):
        normal, tangent = mesh.normals[p].astype(np.float64), mesh.tangents[p].astype(np.float64)
        axes = np.stack([tangent[:3], tangent[3] * np.cross(normal, tangent[:3]), normal])
        view = axes @ (eye - mesh.positions[p])
        truth[row] = sum(
            integral(found, int(texel), view, directions @ axes.T, light * seen[row][:, None])
            for directions, light, seen in arriving
        )
        made[row] = (layer.terms[p] * of_texel(found, material, int(texel))).sum(axis=0)
    return float(np.abs(made - truth).mean() / np.abs(truth).mean())


def _arriving(
    services: Services, lighting: Lighting, casters: Casters, mesh: ShadingPoints, some: npt.NDArray[np.int64]
) -> list[tuple[F32, F32, F32]]:
    """Directions (S, 3), light (S, 3) with Δω, and what of it reaches some points (P, S): leaves and suns."""
    bits, made = VisibilityBits(mesh, casters.shadow, services.workers), []
    for beam in beams(lighting, LEVEL, quarters=False):
        words = bits.of(some, beam.directions, beam.name, Job("seeing"))
        seen = np.unpackbits(words.view(np.uint8), axis=1, bitorder="little").astype(np.float32)
        light = (beam.light * beam.directions.solid_angle).astype(np.float32)
        made.append((beam.directions.directions, light, seen))
    return made


def integral(found: ResidualFit, texel: int, view: F64, wi: F64, light: npt.NDArray[np.float32]) -> F64:
    """(3,) Σ L V (f_r n·l + δ*) Δω of one texel by the fit's own functions, in the surface's frame.

    wi (S, 3) are where light (S, 3) comes from, which has visibility and Δω in it.
    """
    up = wi[:, 2] > 0
    towards, arriving = wi[up].astype(np.float32), light[up]
    views = np.broadcast_to((view / np.linalg.norm(view)).astype(np.float32), towards.shape)
    normals = np.broadcast_to(np.array([0, 0, 1], np.float32), towards.shape)
    now = shade(found.shared, normals, views, towards)
    made = now.shared
    if found.basis.size:
        frames = np.broadcast_to(np.eye(3, dtype=np.float32), (*towards.shape, 3))
        own = found.coefficients.reshape(-1, found.basis.size, 3)[texel]
        made = made + now.columns(found.basis.name, frames) @ own
    return np.asarray((made * arriving).sum(axis=0, dtype=np.float64) / np.pi)


def of_texel(found: ResidualFit, material: Material, texel: int) -> npt.NDArray[np.float32]:
    """(T, 3) coefficients of a texel of the fit, before maps are laid out flat."""
    values = {k: np.asarray(v, np.float32) for k, v in {**defaults(MODEL.Params), **material.values}.items()}
    own = found.coefficients.reshape(-1, found.basis.size, 3)[texel]
    values |= {axis: own[len(own) - 3 + k] for k, axis in enumerate(RESIDUAL) if axis in material.textures}
    if "albedo" in material.textures:
        values["albedo"] = found.shared.parametric.colours[0].astype(np.float32) + own[0]
    return MODEL.coefficients(values)


def skies() -> dict[str, Callable[[], Image]]:
    """The sample room's windows, and the shared HDR maps where they are."""
    from studio.samples import sample
    from studio_core.project.store import load

    def windows() -> Image:
        return next(load(sample()).scene.of(Environment)).image

    maps = {name: lambda path=path: Image(read_map(path)) for name, path in found_maps()}
    return {"windows": windows, **maps}


def run(report: Report, program: Headless) -> None:
    """Rows `scene/fusion/SKY/MATERIAL/BACKEND` and `scene/cost/MATERIAL`."""
    known = skies()
    for name in FITTED[:1] if report.quick else FITTED:
        wanted = [
            (case, sky, backend)
            for sky in (list(known)[:1] if report.quick else known)
            for backend in BACKENDS
            if report.wants(case := f"scene/fusion/{sky}/{name}/{backend}")
        ]
        costing = report.wants(f"scene/cost/{name}")
        if not wanted and not costing:
            continue
        found = fitted(name)
        for case, sky, backend in wanted:
            error = fusion(program.services, found, known[sky](), backend, 20 if report.quick else PLACES)
            report.add(case, "fusion_rel_error", error, "ratio")
        if costing:
            for metric, (value, spread) in cost(program.services, found, 1 if report.quick else 9).items():
                report.add(f"scene/cost/{name}", metric, value, "ratio", spread)
        report.keep()


def cost(services: Services, found: ResidualFit, repeats: int) -> dict[str, tuple[float, float]]:
    """What a residual costs: the material over itself with its albedo alone."""
    whole = scene_material(found, "captured").material
    kept = frozen_map({name: t for name, t in whole.textures.items() if name not in RESIDUAL})
    table = dataclasses.replace(whole.tables["capture"], values=_fewer_terms(whole.tables["capture"].values))
    plain = dataclasses.replace(whole, textures=kept, tables=frozen_map({"capture": table}))
    ratios = costs(services, (captured_scene(plain), captured_scene(whole)), repeats)
    ratios["residual_cost_ratio"] = ratios.pop("sum_cost_ratio")
    return ratios


def _fewer_terms(capture: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
    """The same without a residual: matte, and with a highlight where there is one."""
    made = capture.copy()
    made[..., 0] = 2 if made[0, 0, 0, 2] else 1
    return made


__all__ = ["captured_scene", "cost", "fitted", "fusion", "integral", "of_texel", "run"]
