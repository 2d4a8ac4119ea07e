"""A scene as paths go through it: meshes, textures, reflectance models and lights with their gains."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from studio_core.brdfs.calls import is_sampled
from studio_core.contract import Registry
from studio_core.kernels.light_tree import LightTree
from studio_core.kernels.path_light import BINS, weigh_terms
from studio_core.kernels.path_state import (
    AREA,
    DIRECTIONAL,
    POINT,
    SPOT,
    SUNS,
    Lights,
    Looks,
    Mesh,
    Models,
    Tracer,
)
from studio_core.kernels.suns import Sun
from studio_core.scene.nodes import Light, MaterialId, NodeId, Scene
from studio_core.scene.world_mesh import WorldMesh
from studio_core.shading.artifacts import Casters, Lamp, Lighting, Shapes, Surfaces
from studio_core.shading.coefficients import Coefficients, CoefficientTable
from studio_core.shading.lamps import disc_axes
from studio_core.shading.materials import resolve
from studio_core.shading.varying import Between, ShapeTable

F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]
I32 = npt.NDArray[np.int32]
I64 = npt.NDArray[np.int64]

MATTE_WITHIN = 1e-3
DRAWS = 64
KINDS = {"point": POINT, "spot": SPOT, "area": AREA, "directional": DIRECTIONAL}


@dataclass(frozen=True, eq=False)
class PathWorld:
    """What `shading.path_tracing` needs of a scene; made by `PathWorlds`. Valid as long as `casters` is."""

    scene: Scene
    casters: Casters
    materials: tuple[MaterialId, ...]
    centre: F64
    """What places in kernels are relative to, (3,) world."""
    tracer: Tracer
    mesh: Mesh
    looks: Looks
    models: Models
    shapes: Shapes
    lights: Lights
    table: ShapeTable = field(repr=False)
    vertices: WorldMesh = field(repr=False)

    @property
    def dark(self) -> bool:
        """Whether nothing shines."""
        return not len(self.lights.kind) and not self.lights.k

    def shapes_at(self, material: I32, uvs: F32, vertex: I32) -> Shapes:
        """Where pictures or paint change shapes (`shapes.row` is not None): for points near vertices (P,)."""
        near = Between(self.vertices, vertex.astype(np.int64)[:, None], np.ones((len(vertex), 1), np.float32))
        return self.table.at(self.scene, self.materials, material, uvs, near)


class PathWorlds:
    """Makes worlds, keeping what belongs to pictures that did not change. Owned by the compute thread."""

    def __init__(self, registry: Registry) -> None:
        self._registry = registry
        self._coefficients = CoefficientTable(registry)
        self._table = ShapeTable(registry)
        self._leaves: tuple[LightTree, tuple[float, ...], tuple[F32, F32, F64]] | None = None

    def __call__(self, scene: Scene, surfaces: Surfaces, casters: Casters, lighting: Lighting) -> PathWorld:
        """Of the unrefined meshes, lit by the shown lights with their gains."""
        surfaces = surfaces.unrefined
        mesh, caster = surfaces.mesh, casters.primary
        nothing = np.zeros(0, np.int32), np.zeros((0, 2), np.float32)
        nowhere = Between(mesh, np.zeros((0, 1), np.int64), np.zeros((0, 1), np.float32))
        shapes = self._table.at(scene, surfaces.materials, *nothing, nowhere)
        table = self._coefficients(scene, surfaces)
        handles = caster.handles()
        tracer = Tracer(
            handles.occluded8,
            handles.intersect8,
            handles.scene,
            float(handles.epsilon),
            handles.face_start,
            handles.face_ids,
        )
        return PathWorld(
            scene,
            casters,
            surfaces.materials,
            caster.centre,
            tracer,
            _mesh(mesh, caster.centre),
            _looks(table),
            self._models(scene, surfaces.materials, shapes, table.width),
            shapes,
            self._lights(scene, lighting, caster.centre),
            self._table,
            mesh,
        )

    def _models(self, scene: Scene, materials: Sequence[MaterialId], shapes: Shapes, width: int) -> Models:
        count = max(len(materials), 1)
        width = max(width, shapes.width)
        sampler, density = np.zeros(count, np.int64), np.zeros(count, np.int64)
        albedo, matte = np.zeros((count, BINS, width), np.float32), np.zeros((count, width), np.bool_)
        numbers = np.random.default_rng(0).random(2 * DRAWS, np.float32)
        for m, name in enumerate(materials):
            brdf = resolve(scene.material(name), self._registry).brdf
            if is_sampled(brdf):
                sampler[m], density[m] = brdf.sampler, brdf.density  # type: ignore[attr-defined]
            flat = np.zeros(width, np.float32)
            terms = int(shapes.terms[m])
            calls = int(shapes.address[m]), int(sampler[m]), int(density[m])
            weigh_terms(*calls, terms, shapes.data[shapes.offset[m] :], numbers, albedo[m], flat)
            matte[m, :terms] = flat[:terms] <= MATTE_WITHIN
        address, terms_of = np.zeros((2, count), np.int64)
        address[: len(materials)], terms_of[: len(materials)] = (
            values[: len(materials)] for values in (shapes.address, shapes.terms)
        )
        return Models(address, sampler, density, terms_of, albedo, matte)

    def _lights(self, scene: Scene, lighting: Lighting, centre: F64) -> Lights:
        gains = shown_gains(scene)
        lamps = [lamp for lamp in lighting.lamps if gains.get(lamp.node, np.zeros(3)).any()]
        rows = [_lamp(lamp, gains[lamp.node], centre) for lamp in lamps]
        rows = [row for row in rows if row[-1] > 0]
        sky = np.zeros(3)
        if lighting.environment is not None:
            sky = gains.get(lighting.environment.id, sky)
        sun = lighting.sun if sky.any() else None
        towards, light, upto = _suns(sun, sky)
        if upto[-1] > 0:
            rows.append(_sun_row(towards, light))
        k, leaves = 0, (np.zeros((1, 3), np.float32), np.zeros(1, np.float32), np.ones(1))
        if lighting.tree is not None and sky.any() and lighting.tree.radiance.any():
            k, leaves = lighting.tree.k, self._environment(lighting.tree, sky)
        columns = [np.array(column) for column in zip(*rows, strict=True)] if rows else _NO_LAMPS
        named = dict(zip(Lights._fields, columns, strict=False))
        return Lights(
            **named, towards=towards, sun=light, sun_upto=upto, k=k, radiance=leaves[0], chance=leaves[1],
            upto=leaves[2], areas=int(sum(row[0] == AREA for row in rows)),
        )  # fmt: skip

    def _environment(self, tree: LightTree, gain: F64) -> tuple[F32, F32, F64]:
        """Radiance, density of being chosen, and its running sum; kept while the tree and its gain stay."""
        key = tuple(gain.tolist())
        if self._leaves is not None and self._leaves[0] is tree and self._leaves[1] == key:
            return self._leaves[2]
        radiance = tree.radiance * gain.astype(np.float32)
        upto = np.cumsum(radiance.sum(axis=1, dtype=np.float64))
        chance = radiance.sum(axis=1, dtype=np.float64) / (upto[-1] * tree.solid_angle)
        self._leaves = tree, key, (radiance, chance.astype(np.float32), upto)
        return self._leaves[2]


def shown_gains(scene: Scene) -> dict[NodeId, F64]:
    """(3,) of every light that is not hidden."""
    return {
        light.id: np.asarray(light.gain(), np.float64) for light in scene.of(Light) if scene.shown(light.id)
    }


_NO_LAMPS = [
    np.zeros(0, np.int64),
    *(np.zeros((0, 3)) for _ in range(4)),
    np.zeros((0, 2)),
    np.zeros(0),
    np.zeros((0, 3)),
    np.zeros(0),
    np.zeros(0),
]
_Row = tuple[int, F64, F64, F64, F64, tuple[float, float], float, F64, float, float]


def _lamp(lamp: Lamp, gain: F64, centre: F64) -> _Row:
    across, up, spread, area = lamp.across, lamp.up, 0.0, 0.0
    if lamp.kind == "area":
        area = float(np.linalg.norm(np.cross(across, up)))
        gain = gain * area
        spread = float((across @ across + up @ up) / 12)
    elif lamp.kind == "directional":
        spread = float(np.tan(lamp.angle / 2))
        across, up = disc_axes(lamp.axis)
    cones = (lamp.cos_cone, lamp.cos_inner)
    place = lamp.position - centre
    return KINDS[lamp.kind], place, lamp.axis, across, up, cones, spread, gain, area, float(gain.max())


def _suns(sun: Sun | None, gain: F64) -> tuple[F32, F32, F64]:
    if sun is None:
        return np.zeros((1, 3), np.float32), np.zeros((1, 3), np.float32), np.zeros(1)
    light = sun.irradiance * gain.astype(np.float32)
    upto = np.cumsum(light.sum(axis=1, dtype=np.float64))
    return sun.directions.astype(np.float32), light.astype(np.float32), upto


def _sun_row(towards: F32, light: F32) -> _Row:
    """All suns together: how they are chosen among lamps. Spread over 1 says that they may stand anywhere."""
    weight = light.sum(axis=1, dtype=np.float64)
    middle = weight @ towards.astype(np.float64)
    length = float(np.linalg.norm(middle))
    axis = -middle / length if length > 0 else np.zeros(3)
    zero, gain = np.zeros(3), light.sum(axis=0, dtype=np.float64)
    return SUNS, zero, axis, zero, zero, (-1.0, -1.0), 1.0, gain, 0.0, float(gain.max())


def _mesh(mesh: WorldMesh, centre: F64) -> Mesh:
    return Mesh(
        mesh.origin - centre,
        mesh.positions,
        mesh.normals,
        mesh.tangents,
        mesh.uvs,
        mesh.material,
        mesh.faces,
        mesh.back_faces,
        np.ascontiguousarray(mesh.face_offsets, np.int64),
    )


def _looks(table: Coefficients) -> Looks:
    maps = table.maps
    first, size = maps.first[:, 0].copy(), maps.size[:, 0].copy()
    layout = (first, size, maps.uv_map, table.painted)
    return Looks(maps.kind, table.plain, table.slope, maps.texels, maps.tables, *layout)


__all__ = ["PathWorld", "PathWorlds", "shown_gains"]
