"""Pictures without OpenGL: interpolated radiance at primary hits, textures and background per pixel."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from studio_core.contract import Registry, Services
from studio_core.kernels.compose import background_samples, shade_samples
from studio_core.parallel import Workers
from studio_core.scene.diff import Aspect
from studio_core.scene.nodes import Light, Scene
from studio_core.session import View
from studio_core.shading.artifacts import TERMS, Hits, Picture, Radiance, Surfaces
from studio_core.shading.frame import Frame
from studio_core.shading.job import Job
from studio_core.shading.lamps import shown_environment
from studio_core.shading.materials import Resolved, coefficients, linear_rgb, resolve
from studio_core.shading.pipeline import Inputs
from studio_core.shading.primary import pinhole

F32 = npt.NDArray[np.float32]
I64 = npt.NDArray[np.int64]

CHUNK = 1 << 15
EVERY = np.zeros(0, np.int64)
_LEVELS = 12


@dataclass(frozen=True)
class Coefficients:
    """BRDF coefficients of all materials, with mip levels where textured; see `kernels.compose`."""

    table: F32
    first: I64
    size: I64
    uv_scale: F32


class CoefficientTable:
    """Makes `Coefficients`, keeping the maps of materials that did not change."""

    def __init__(self, registry: Registry) -> None:
        self._registry = registry
        self._kept: dict[str, tuple[object, list[F32], F32]] = {}

    def __call__(self, scene: Scene, surfaces: Surfaces) -> Coefficients:
        """The table for `surfaces.materials`."""
        count = max(len(surfaces.materials), 1)
        first, size = np.zeros((count, _LEVELS), np.int64), np.zeros((count, _LEVELS, 2), np.int64)
        uv_scale = np.tile(np.array([1, 1, 0, 0], np.float32), (count, 1))
        rows: list[F32] = []
        length = 0
        kept: dict[str, tuple[object, list[F32], F32]] = {}
        for m, material_id in enumerate(surfaces.materials):
            material = scene.material(material_id)
            had = self._kept.get(material_id)
            if had is None or had[0] is not material:
                resolved = resolve(material, self._registry)
                had = material, _pyramid(coefficients(resolved)), _uv_scale(resolved)
            kept[material_id] = had
            _, levels, uv_scale[m] = had
            for level, values in enumerate(levels):
                first[m, level], size[m, level] = length, values.shape[:2]
                rows.append(values.reshape(-1, TERMS * 3))
                length += len(rows[-1])
        self._kept = kept
        table = np.concatenate(rows) if rows else np.zeros((1, TERMS * 3), np.float32)
        return Coefficients(table, first, size, uv_scale)


def _pyramid(base: F32) -> list[F32]:
    level = base.reshape(1, 1, TERMS, 3) if base.ndim == 2 else base
    made = [np.ascontiguousarray(level)]
    while max(level.shape[:2]) > 1 and len(made) < _LEVELS:
        height, width = max(level.shape[0] // 2, 1), max(level.shape[1] // 2, 1)
        y, x = level.shape[0] // height, level.shape[1] // width
        cut = level[: height * y, : width * x].reshape(height, y, width, x, TERMS, 3)
        level = cut.mean(axis=(1, 3), dtype=np.float32)
        made.append(level)
    return made


def _uv_scale(resolved: Resolved) -> F32:
    for texture in resolved.textures.values():
        return np.array([*texture.scale, *texture.offset], np.float32)
    return np.array([1, 1, 0, 0], np.float32)


class PictureStage:
    """Linear pixels of what the camera sees, from radiance at vertices."""

    needs: tuple[type, ...] = (Surfaces, Hits, Radiance)
    gives = Picture
    dirtied_by = Aspect.MATERIAL | Aspect.GAIN | Aspect.LIGHT | Aspect.VIEW

    def __init__(self, services: Services) -> None:
        self._workers: Workers = services.workers
        self._coefficients = CoefficientTable(services.registry)

    def run(self, frame: Frame, inputs: Inputs, job: Job) -> Picture:
        """The picture; no light is summed here."""
        table = self._coefficients(frame.scene, inputs[Surfaces])
        return compose(frame.scene, inputs[Radiance], inputs[Hits], table, self._workers, job)


def compose(
    scene: Scene,
    radiance: Radiance,
    hits: Hits,
    table: Coefficients,
    workers: Workers,
    job: Job | None = None,
) -> Picture:
    """Linear (H, W, 3) with the environment behind where it is to be seen."""
    surfaces, view = radiance.surfaces, hits.view
    samples = Compositor(scene, radiance, view, table, workers, job)(hits, EVERY)
    n2 = hits.samples**2
    shape = (view.height, view.width)
    linear = samples.reshape(*shape, n2, 3).mean(axis=2, dtype=np.float32)
    coverage = (hits.face >= 0).reshape(*shape, n2).mean(axis=2, dtype=np.float32)
    node = np.full(shape, -1, np.int32)
    face = hits.face.reshape(*shape, n2)[..., 0]
    node[face >= 0] = surfaces.mesh.object[surfaces.mesh.faces[face[face >= 0], 0]]
    distance = np.where(face >= 0, hits.distance.reshape(*shape, n2)[..., 0], np.inf).astype(np.float32)
    return Picture(radiance, linear, coverage, node, distance)


class Compositor:
    """Radiance of samples; what lies behind transparent surfaces is mixed in by opacity."""

    def __init__(
        self,
        scene: Scene,
        radiance: Radiance,
        view: View,
        table: Coefficients,
        workers: Workers,
        job: Job | None,
    ) -> None:
        lights = {light.id: light for light in scene.of(Light) if scene.shown(light.id)}
        environment = shown_environment(scene)
        self.environment = environment if environment is not None and environment.background else None
        self.surfaces = radiance.surfaces
        self.terms = radiance.combined(lights).reshape(-1, TERMS * 3)
        self.table = table
        self.texels = texels_per_metre(self.surfaces, table)
        self.pinhole = pinhole(view)
        self.pixel_angle = float(2 * self.pinhole[3] / (view.height * view.antialias))
        self.workers, self.job = workers, job

    def __call__(self, hits: Hits, samples: I64) -> F32:
        """(N, 3) radiance of hits that belong to `samples` of the picture."""
        out = np.zeros((len(hits.face), 3), np.float32)
        self._background(hits, samples, out)
        mesh, table = self.surfaces.mesh, self.table

        def shade(start: int, stop: int) -> None:
            shade_samples(
                start,
                stop,
                hits.face,
                hits.u,
                hits.v,
                hits.distance,
                samples,
                self.pinhole,
                mesh.faces,
                mesh.back_faces,
                mesh.positions,
                mesh.material,
                mesh.uvs,
                self.texels,
                self.terms,
                table.table,
                table.first,
                table.size,
                table.uv_scale,
                self.pixel_angle,
                out,
            )

        self.workers.run(len(hits.face), CHUNK, shade, self.job)
        for index, rest in hits.behind:
            under = self(rest, samples[index] if len(samples) else index)
            slot = mesh.face_material[hits.face[index]]
            alpha = self.surfaces.opacity[slot][:, None]
            out[index] = alpha * out[index] + (1 - alpha) * under
        return out

    def _background(self, hits: Hits, samples: I64, out: F32) -> None:
        if self.environment is None:
            return
        rotation = np.ascontiguousarray(self.environment.rotation().matrix()[:3, :3].T, np.float32)
        pixels = linear_rgb(self.environment.image)
        gain = np.array(self.environment.gain(), np.float32)

        def look(start: int, stop: int) -> None:
            background_samples(start, stop, hits.face, samples, self.pinhole, rotation, pixels, gain, out)

        self.workers.run(len(hits.face), CHUNK, look, self.job)


def texels_per_metre(surfaces: Surfaces, table: Coefficients) -> F32:
    """(F,) texels of the finest level along a metre of each face; 1 where nothing is textured."""
    mesh = surfaces.mesh
    if not (table.size[:, 0] > 1).any() or not len(mesh.faces):
        return np.ones(max(len(mesh.faces), 1), np.float32)
    corners, uvs = mesh.positions[mesh.faces].astype(np.float64), mesh.uvs[mesh.faces].astype(np.float64)
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area = np.linalg.norm(cross, axis=1)
    a, b = uvs[:, 1] - uvs[:, 0], uvs[:, 2] - uvs[:, 0]
    uv_area = np.abs(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])
    m = mesh.face_material
    texels = uv_area * table.uv_scale[m, 0] * table.uv_scale[m, 1] * table.size[m, 0, 0] * table.size[m, 0, 1]
    made: F32 = np.minimum(np.sqrt(np.abs(texels) / np.maximum(area, 1e-20)), 1e30).astype(np.float32)
    return made
