"""The first stages: shading meshes of what is shown, and ray casters over them."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from studio_core.errors import EditError
from studio_core.kernels.raycast import CasterObject, RayCaster
from studio_core.params import param
from studio_core.scene.bounds import scene_bounds
from studio_core.scene.diff import Aspect
from studio_core.scene.nodes import MaterialId, MeshObject, Scene
from studio_core.scene.shading_mesh import BUDGET, choose_edge, rung
from studio_core.scene.world_mesh import MeshCache, Placed, assemble
from studio_core.shading.artifacts import Casters, Source, Surfaces
from studio_core.shading.frame import Frame
from studio_core.shading.job import Job
from studio_core.shading.pipeline import Inputs

F32 = npt.NDArray[np.float32]

BODIES = Aspect.STRUCTURE | Aspect.GEOMETRY


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
        opacity, catches = _opacity(scene, old.materials), _catches(scene, old.materials)
        mesh = old.mesh.moved_many({i: scene.world(node) for i, node in enumerate(old.nodes)})
        same = np.array_equal(opacity, old.opacity) and np.array_equal(catches, old.catches)
        if mesh is old.mesh and same:
            return old
        return dataclasses.replace(old, mesh=mesh, opacity=opacity, catches=catches)

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
        mesh = assemble(
            [
                Placed(
                    node, self._cache.mesh(geometry, rung(geometry, edge / world.scale)), world, tuple(slots)
                )
                for node, geometry, world, slots in items
            ],
            origin=np.round((low + high) / 2),
        )
        return Surfaces(sources, tuple(table), mesh, _opacity(scene, table), _catches(scene, table), budget)


def _opacity(scene: Scene, materials: Iterable[MaterialId]) -> F32:
    """(M,) of each material; what shows the backdrop is not looked through as well."""
    found = (scene.material(material) for material in materials)
    return np.array([1.0 if m.catches else m.opacity for m in found], np.float32)


def _catches(scene: Scene, materials: Iterable[MaterialId]) -> npt.NDArray[np.bool_]:
    return np.array([scene.material(material).catches for material in materials], np.bool_)


class CasterStage:
    """Ray casters; objects that only moved keep theirs."""

    needs: tuple[type, ...] = (Surfaces,)
    gives = Casters
    dirtied_by = BODIES | Aspect.TRANSFORM

    def run(self, frame: Frame, inputs: Inputs, job: Job) -> Casters:
        """Built anew only when the set of meshes changed."""
        surfaces, scene = inputs[Surfaces].unrefined, frame.scene
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
            primary.append(
                CasterObject(part.positions, part.faces, key, matrix, np.array(stops, np.bool_)[part.slots])
            )
        job.checkpoint()
        lend = (previous.shadow, previous.primary) if previous is not None else (None, None)
        casters = (RayCaster(shadow, previous=lend[0]), RayCaster(primary, previous=lend[1]))
        return Casters(*casters, meshes, transforms)
