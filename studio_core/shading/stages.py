"""The stages every backend shares: surfaces, ray casters, BRDF shapes, lights, what the camera sees."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from studio_core.contract import Services
from studio_core.errors import EditError
from studio_core.kernels.camera import first_hits, sample_directions
from studio_core.kernels.directions import LARGEST
from studio_core.kernels.light_tree import LightTree, integrate_environment
from studio_core.kernels.raycast import CasterObject, RayCaster
from studio_core.params import param
from studio_core.scene.bounds import scene_bounds
from studio_core.scene.diff import Aspect
from studio_core.scene.nodes import Environment, MaterialId, MeshObject, Scene
from studio_core.scene.shading_mesh import BUDGET, NO_BACK, choose_edge
from studio_core.scene.transform import rotation_matrix
from studio_core.scene.world_mesh import MeshCache, world_mesh
from studio_core.session import View
from studio_core.shading.artifacts import Casters, Hits, Lighting, Shapes, Source, Surfaces
from studio_core.shading.frame import Frame
from studio_core.shading.job import Job
from studio_core.shading.lamps import lamps, shown_environment
from studio_core.shading.materials import linear_rgb, same_shapes, shapes
from studio_core.shading.pipeline import Inputs

F32 = npt.NDArray[np.float32]

BODIES = Aspect.STRUCTURE | Aspect.GEOMETRY
CHUNK = 1 << 14
LAYERS = 6  # most transparent surfaces looked through


@dataclass(frozen=True)
class SurfaceParams:
    """Parameters that every backend over shading vertices has."""

    vertices: int = param(
        BUDGET,
        "Shading vertices",
        "How many points the whole scene is lit at; more shows finer shadow edges",
        low=500,
        high=5_000_000,
        scale="log",
    )


class SurfaceStage:
    """Shading meshes of all shown objects, in the world."""

    needs: tuple[type, ...] = ()
    gives = Surfaces
    dirtied_by = BODIES | Aspect.TRANSFORM | Aspect.MATERIAL | Aspect.QUALITY

    def __init__(self) -> None:
        self._cache = MeshCache()

    def run(self, frame: Frame, inputs: Inputs, job: Job) -> Surfaces:
        """The previous where no object differs; where some only moved, just these are transformed again."""
        scene = frame.scene
        shown = (node for node in scene.of(MeshObject) if scene.shown(node.id))
        sources = tuple((node.id, node.geometry, node.materials) for node in shown)
        budget = int(getattr(frame.params, "vertices", BUDGET))
        old: Surfaces | None = inputs.previous
        if old is None or old.budget != budget or old.sources != sources:
            return self._build(scene, sources, budget)
        opacity = _opacity(scene, old.materials)
        mesh = old.mesh.moved_many({i: scene.world(node) for i, node in enumerate(old.nodes)})
        if mesh is old.mesh and np.array_equal(opacity, old.opacity):
            return old
        return dataclasses.replace(old, mesh=mesh, opacity=opacity)

    def _build(self, scene: Scene, sources: tuple[Source, ...], budget: int) -> Surfaces:
        table: dict[str, int] = {}
        items = []
        for node, geometry, materials in sources:
            if len(geometry.faces) and not materials:  # a script's: edits and project files refuse it
                raise EditError(f"{scene[node].name!r} cannot be shaded: it has no material")
            slots = [table.setdefault(material, len(table)) for material in materials]
            items.append((node, geometry, scene.world(node), slots))
        sizes = [(geometry, world.scale) for _, geometry, world, _ in items]
        edge = choose_edge(sizes, budget, prepared=self._cache.prepared)
        low, high = scene_bounds(scene)
        mesh = world_mesh(items, edge, origin=np.round((low + high) / 2), cache=self._cache)
        return Surfaces(sources, tuple(table), mesh, _opacity(scene, table), budget)


def _opacity(scene: Scene, materials: Iterable[MaterialId]) -> F32:
    return np.array([scene.material(material).opacity for material in materials], np.float32)


class CasterStage:
    """Ray casters; objects that only moved keep theirs."""

    needs: tuple[type, ...] = (Surfaces,)
    gives = Casters
    dirtied_by = BODIES | Aspect.TRANSFORM

    def run(self, frame: Frame, inputs: Inputs, job: Job) -> Casters:
        """Built anew only when the set of meshes changed."""
        surfaces, scene = inputs[Surfaces], frame.scene
        objects = [node for node in map(scene.__getitem__, surfaces.nodes) if isinstance(node, MeshObject)]
        opaque = [tuple(scene.material(m).casts_shadow for m in node.materials) for node in objects]
        parts = [placed.mesh for placed in surfaces.mesh.objects]
        keys = [f"{n.geometry.key} {p.edge} {len(p)}" for n, p in zip(objects, parts, strict=True)]
        meshes = tuple(zip(keys, opaque, strict=True))
        transforms = tuple(scene.world(node) for node in surfaces.nodes)
        previous: Casters | None = inputs.previous
        if previous is not None and previous.meshes == meshes:
            if previous.transforms == transforms:
                return previous
            for index, (now, before) in enumerate(zip(transforms, previous.transforms, strict=True)):
                if now != before:
                    previous.shadow.move(index, now.matrix())
                    previous.primary.move(index, now.matrix())
            return dataclasses.replace(previous, transforms=transforms)
        shadow, primary = [], []
        for node, part, key, stops, transform in zip(objects, parts, keys, opaque, transforms, strict=True):
            mesh, matrix = node.geometry, transform.matrix()
            faces = np.array(stops, np.bool_)[mesh.slots]
            shadow.append(CasterObject(mesh.positions, mesh.faces, mesh.key, matrix, faces))
            primary.append(CasterObject(part.positions, part.faces, key, matrix, None))
        job.checkpoint()
        lend = (previous.shadow, previous.primary) if previous is not None else (None, None)
        casters = (RayCaster(shadow, previous=lend[0]), RayCaster(primary, previous=lend[1]))
        return Casters(*casters, meshes, transforms)


class ShapeStage:
    """BRDF kernels and their parameters; a change of colour alone gives the previous one back."""

    needs: tuple[type, ...] = (Surfaces,)
    gives = Shapes
    dirtied_by = Aspect.MATERIAL | BODIES

    def __init__(self, services: Services) -> None:
        self._registry = services.registry

    def run(self, frame: Frame, inputs: Inputs, job: Job) -> Shapes:
        """The table for the materials of `Surfaces`."""
        made = shapes(frame.scene, inputs[Surfaces].materials, self._registry)
        previous: Shapes | None = inputs.previous
        if previous is not None and same_shapes(previous, made) and previous.problems == made.problems:
            return previous
        return made


class LightingStage:
    """The environment integrated over the finest leaves there are, and all lamps, at unit gain."""

    needs: tuple[type, ...] = ()
    gives = Lighting
    dirtied_by = Aspect.LIGHT

    def __init__(self, services: Services) -> None:
        self._workers = services.workers
        self._cache = services.cache

    def run(self, frame: Frame, inputs: Inputs, job: Job) -> Lighting:
        """Integrates again only for another picture, rotation or finer directions."""
        scene = frame.scene
        environment = shown_environment(scene)
        tree: LightTree | None = None
        key: tuple[object, ...] = ()
        if environment is not None:
            key = (environment.image.key, environment.azimuth, environment.tilt)
            previous: Lighting | None = inputs.previous
            if previous is not None and previous.integrated == key:
                tree = previous.tree
            else:
                turned = previous is not None and previous.integrated[:1] == key[:1]
                tree = LightTree.build(self._leaves(environment, key, job, keep=not turned))
        return Lighting(environment, tree, lamps(scene), key)

    def _leaves(self, environment: Environment, key: tuple[object, ...], job: Job, keep: bool) -> F32:
        method = "environment over 2^17 leaves, 1"
        kept = self._cache.get(method, *key) if self._cache is not None else None
        if kept is not None and kept["leaves"].shape == (1 << LARGEST, 3):
            found: F32 = kept["leaves"]
            return found
        rotation = environment.rotation().matrix()[:3, :3]
        pixels = linear_rgb(environment.image)
        leaves = integrate_environment(pixels, rotation, LARGEST, self._workers, job)
        if self._cache is not None and keep:  # not every step of a turn
            self._cache.put({"leaves": leaves}, method, *key)
        return leaves


class PrimaryStage:
    """What the camera sees at every sample of the picture."""

    needs: tuple[type, ...] = (Surfaces, Casters)
    gives = Hits
    dirtied_by = Aspect.VIEW

    def __init__(self, services: Services) -> None:
        self._workers = services.workers

    def run(self, frame: Frame, inputs: Inputs, job: Job) -> Hits:
        """Primary rays, followed on through transparent surfaces."""
        surfaces, caster, view = inputs[Surfaces], inputs[Casters].primary, frame.view
        lens = pinhole(view)
        count = view.width * view.height * view.antialias**2
        face = np.empty(count, np.int32)
        u, v, distance = np.empty((3, count), np.float32)
        eye = caster.local(view.transform.translation)
        handles, offsets = caster.handles(), surfaces.mesh.face_offsets

        def look(start: int, stop: int) -> None:
            first_hits(
                handles.intersect8,
                handles.scene,
                eye,
                lens,
                handles.face_start,
                handles.face_ids,
                offsets,
                face,
                u,
                v,
                distance,
                start,
                stop,
            )

        self._workers.run(count, CHUNK, look, job)
        caster.count(count)
        seen = Hits(view, view.antialias, face, u, v, distance)
        everything = np.arange(count) if (surfaces.opacity < 1).any() else np.zeros(0, np.int64)
        return self._beyond(seen, surfaces, caster, everything, lens, 0, job)

    def _beyond(
        self,
        hits: Hits,
        surfaces: Surfaces,
        caster: RayCaster,
        samples: npt.NDArray[np.int64],
        lens: npt.NDArray[np.float64],
        depth: int,
        job: Job,
    ) -> Hits:
        """The hits with what is seen through those on transparent surfaces."""
        mesh = surfaces.mesh
        if depth == LAYERS or not len(samples):
            return hits
        met = np.flatnonzero(hits.face >= 0)
        through = met[surfaces.opacity[mesh.face_material[hits.face[met]]] < 1]
        if not len(through):
            return hits
        directions = np.empty((len(through), 3), np.float32)
        sample_directions(lens, samples[through], directions)
        gone = hits.distance[through].astype(np.float64) * (1 + 1e-5) + caster.epsilon
        origins = np.asarray(hits.view.transform.translation) + gone[:, None] * directions
        found = caster.closest(origins, directions, 0.0, np.inf, self._workers, job)
        hit = found.object >= 0
        face = np.where(hit, mesh.face_offsets[found.object] + found.face, -1).astype(np.int32)
        distance = (found.t + gone).astype(np.float32)
        rest = Hits(hits.view, hits.samples, face, found.u, found.v, distance)
        rest = self._beyond(rest, surfaces, caster, samples[through], lens, depth + 1, job)
        return dataclasses.replace(hits, behind=((through, rest),))


def pinhole(view: View) -> npt.NDArray[np.float64]:
    """A view as `kernels.camera` wants it."""
    up = np.tan(np.radians(view.fov) / 2)
    rotation = rotation_matrix(view.transform.rotation)
    size = (view.width, view.antialias, up * view.width / view.height, up, view.height)
    return np.array([*size, *rotation.ravel()], np.float64)


def visible_vertices(surfaces: Surfaces, hits: Hits) -> npt.NDArray[np.bool_]:
    """(V,) the corners of every face that a sample sees, on the side it sees."""
    seen = np.zeros(len(surfaces.mesh.positions), np.bool_)
    touched = np.zeros(len(surfaces.mesh.faces) + 1, np.bool_)
    touched[hits.face] = True  # -1, nothing, marks the one too many
    faces = np.flatnonzero(touched[:-1])
    seen[surfaces.mesh.faces[faces]] = True
    back = surfaces.mesh.back_faces[faces]
    seen[back[back[:, 0] != NO_BACK]] = True
    for _, rest in hits.behind:
        seen |= visible_vertices(surfaces, rest)
    return seen


def common_stages(services: Services) -> list[Any]:
    """Surfaces, casters, shapes, lighting, hits: the first stages of every backend."""
    return [
        SurfaceStage(),
        CasterStage(),
        ShapeStage(services),
        LightingStage(services),
        PrimaryStage(services),
    ]
