"""Captured materials under environment light: the sum that backends make against that of f_r + δ* itself."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from captured_fits import made_up
from scenes import cube, floor, sky

from studio_core.contract import Services
from studio_core.kernels.directions import direction_set
from studio_core.params import defaults
from studio_core.scene.diff import Changes
from studio_core.scene.geometry import Image
from studio_core.scene.nodes import Environment, MeshObject, Scene
from studio_core.scene.transform import Transform
from studio_core.shading.artifacts import Casters, Lighting, Radiance
from studio_core.shading.brute_force import VisibilityBits
from studio_core.shading.frame import Frame
from studio_core.shading.job import Job
from studio_core.shading.offline import backend_params, scene_view
from studio_core.shading.pipeline import Pipeline
from studio_plugins.residual.material import scene_material
from studio_plugins.residual.model import MODEL, RESIDUAL
from studio_plugins.residual.shading import shade

LEVEL = 15


def window() -> Image:
    """A sky with one bright window."""
    pixels = np.array(sky(64).pixels)
    pixels[10:16, 18:24] *= 40
    return Image(pixels)


def room(material: Any) -> Scene:
    """A captured floor with a box on it, under a sky with a bright window."""
    box = Transform((0.2, 0.25, 0.0))
    nodes = (
        MeshObject(id="floor", name="Floor", geometry=floor(2.0), materials=(material.id,)),
        MeshObject(id="box", name="Box", geometry=cube(0.5), materials=(material.id,), transform=box),
        Environment(id="sky", name="Sky", image=window()),
    )
    return Scene().with_materials(material).with_nodes(*nodes)


def shaded(scene: Scene, host: Any, workers: Any, backend: str, **wanted: Any) -> tuple[Pipeline, Frame]:
    found = host.get("backend", backend)
    params = backend_params(found, {"vertices": 1500, **wanted})
    frame = Frame(scene, scene_view(scene, None, 96, 64), params, 1)
    pipeline = Pipeline(found.stages(Services(workers, host)))
    pipeline.update(frame, Changes(), Job("shade"))
    return pipeline, frame


def integral(fit: Any, texel: int, axes: Any, eye: Any, position: Any, directions: Any, light: Any) -> Any:
    """(3,) Σ L V (f_r n·l + δ*) Δω of one texel by the fit's own functions, `light` (S, 3) with V and Δω."""
    wi = directions @ axes.T
    up = wi[:, 2] > 0
    wi, light = wi[up].astype(np.float32), light[up]
    o = axes @ (eye - position)
    views = np.broadcast_to((o / np.linalg.norm(o)).astype(np.float32), wi.shape)
    normals = np.broadcast_to(np.array([0, 0, 1], np.float32), wi.shape)
    now = shade(fit.shared, normals, views, wi)
    columns = now.columns(fit.basis.name, np.broadcast_to(np.eye(3, dtype=np.float32), (*wi.shape, 3)))
    own = fit.coefficients.reshape(-1, fit.basis.size, 3)[texel]
    return ((now.shared + columns @ own) * light).sum(axis=0, dtype=np.float64) / np.pi


@pytest.mark.parametrize("basis", ["half", "albedo-light"])
@pytest.mark.parametrize(("backend", "most"), [("reference", 1e-4), ("cuts", 5e-3)])
def test_light_sums_hold_the_whole_residual(
    backend: str, most: float, basis: str, host: Any, workers: Any
) -> None:
    fit = made_up("blinn", basis)
    material = scene_material(fit, "cloth").material
    scene = room(material)
    own = {"directions": str(1 << LEVEL), "quarters": False} if backend == "reference" else {}
    pipeline, frame = shaded(scene, host, workers, backend, **own)
    radiance, lighting = pipeline.artifact(Radiance), pipeline.artifact(Lighting)
    casters = pipeline.artifact(Casters)
    assert radiance is not None
    assert lighting is not None
    assert casters is not None
    mesh, terms = radiance.surfaces.mesh, radiance.layers["sky"].terms
    assert terms.shape[1] == 5
    rng = np.random.default_rng(3)
    flat = scene_material(fit).material.textures
    some = rng.choice(np.flatnonzero(radiance.valid), 60, replace=False)
    directions = direction_set(LEVEL)
    bits = VisibilityBits(mesh, casters.shadow, workers).of(some, directions, "all", Job("see"))
    seen = np.unpackbits(bits.view(np.uint8), axis=1, bitorder="little").astype(np.float32)
    leaves = np.asarray(lighting.tree.coarsened(LEVEL).radiance, np.float32) * directions.solid_angle
    eye = np.asarray(frame.view.transform.translation) - mesh.origin
    texels = rng.integers(0, fit.normals.shape[0] * fit.normals.shape[1], len(some))
    values = {**defaults(MODEL.Params), **material.values}
    made, truth = np.empty((2, len(some), 3))
    for row, (p, texel) in enumerate(zip(some, texels, strict=True)):
        n, t = mesh.normals[p].astype(np.float64), mesh.tangents[p].astype(np.float64)
        axes = np.stack([t[:3], t[3] * np.cross(n, t[:3]), n])
        truth[row] = integral(
            fit, texel, axes, eye, mesh.positions[p], directions.directions, leaves * seen[row][:, None]
        )
        own_maps = _coefficients(fit, texel, flat)
        c = MODEL.coefficients({**{k: np.asarray(v, np.float32) for k, v in values.items()}, **own_maps})
        made[row] = (terms[p] * c).sum(axis=0)
    off = np.abs(made - truth).mean() / np.abs(truth).mean()
    assert off < most, off


def _coefficients(fit: Any, texel: int, maps: Any) -> dict[str, Any]:
    """What the maps of the material have for a texel of the fit, before they were laid out."""
    own = fit.coefficients.reshape(-1, fit.basis.size, 3)[texel]
    found = {axis: own[len(own) - 3 + k] for k, axis in enumerate(RESIDUAL)}
    if "albedo" in maps:
        found["albedo"] = fit.shared.parametric.colours[0] + own[0]
    return found
