"""Radiance at shading vertices: light sums with their materials' coefficients."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from studio_core.contract import Registry
from studio_core.scene.nodes import Light, Scene
from studio_core.shading.artifacts import Radiance, Surfaces
from studio_core.shading.materials import coefficients, resolve
from studio_core.shading.painting import PaintTable


def vertex_radiance(scene: Scene, radiance: Radiance, registry: Registry) -> npt.NDArray[np.float32]:
    """(V, 3) towards the view, with gains; textures are read at the vertices."""
    lights = {light.id: light for light in scene.of(Light) if scene.shown(light.id)}
    weights = vertex_weights(scene, radiance.surfaces, radiance.width, registry)
    made: npt.NDArray[np.float32] = np.einsum("vtc,vtc->vc", radiance.combined(lights), weights)
    return np.maximum(made, 0)  # captured ones go below 0


def vertex_weights(
    scene: Scene, surfaces: Surfaces, width: int, registry: Registry
) -> npt.NDArray[np.float32]:
    """(V, width, 3) what light sums are multiplied with; textures are read at the vertices."""
    mesh = surfaces.mesh
    made = np.zeros((len(mesh), width, 3), np.float32)
    for index, material in enumerate(surfaces.materials):
        own = np.flatnonzero(mesh.material == index)
        if not len(own):
            continue
        resolved = resolve(scene.material(material), registry)
        table = coefficients(resolved, width)
        if table.ndim == 2:
            made[own] = table
        else:
            texture = next(iter(resolved.textures.values()))
            made[own] = bilinear(table, texture.placed(mesh.uvs[own]))
    painted = PaintTable(registry)(scene, surfaces.materials, mesh, width)
    return made + painted.reshape(made.shape) if len(painted) else made


def bilinear(table: npt.NDArray[np.float32], uv: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
    """(P, T, 3) of a table (H, W, T, 3), rows from v = 0 up, that repeats, at uv (P, 2)."""
    height, width = table.shape[:2]
    x, y = uv[:, 0] * width - 0.5, uv[:, 1] * height - 0.5
    x0, y0 = np.floor(x).astype(np.int64), np.floor(y).astype(np.int64)
    fx, fy = (x - x0)[:, None, None], (y - y0)[:, None, None]
    x1, y1 = (x0 + 1) % width, (y0 + 1) % height
    x0, y0 = x0 % width, y0 % height
    low = table[y0, x0] * (1 - fx) + table[y0, x1] * fx
    high = table[y1, x0] * (1 - fx) + table[y1, x1] * fx
    made: npt.NDArray[np.float32] = (low * (1 - fy) + high * fy).astype(np.float32)
    return made
