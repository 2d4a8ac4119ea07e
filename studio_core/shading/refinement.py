"""Shading meshes that grow where light needs it, while nobody moves anything.

After every round `AdaptiveSurfaceStage` estimates what interpolation between vertices does to the picture
(`interpolation`) and splits the edges that add most to it, as few rounds as possible. A round that did not
come through is forgotten. Refinement is kept by object, over moves and changes of light, up to a number of
vertices; hits are carried down to the parts of split faces instead of traced again.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
import numpy.typing as npt

from studio_core.contract import Services
from studio_core.kernels.refinement import locate
from studio_core.parallel import Workers
from studio_core.scene.diff import Aspect
from studio_core.scene.face_tree import FaceTree, joined
from studio_core.scene.nodes import Light, Material, MaterialId, NodeId, Scene
from studio_core.scene.shading_mesh import ShadingMesh, refined
from studio_core.scene.world_mesh import WorldMesh
from studio_core.shading.artifacts import Casters, DirectRadiance, Hits, Radiance, Surfaces
from studio_core.shading.frame import Frame
from studio_core.shading.interpolation import EdgeErrors, edge_errors, squares_saved
from studio_core.shading.job import Job
from studio_core.shading.materials import coefficients, resolve
from studio_core.shading.paint_edges import with_paint
from studio_core.shading.painting import PaintTable
from studio_core.shading.pipeline import Inputs
from studio_core.shading.primary import PrimaryStage
from studio_core.shading.surfaces import SurfaceStage

F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]
I64 = npt.NDArray[np.int64]
CHUNK = 1 << 15
LEFT = 0.5  # share of the target's square that edges which are not split may add up to
WORTH = 0.1  # share of all squares, and of the edges to split, that a round must be able to take on
LOSS = 0.1  # share of the target's square that may be lost when refinement is dropped


@dataclass(frozen=True)
class Adaptive:
    """How far shading meshes are refined.

    target: estimated relative RMSE of the picture at which it ends; extra: most vertices beyond those of
    the unrefined meshes, and likewise `share` times the unrefined vertices that are seen; rounds: most of
    them after an edit; pixels: edges no longer than this in the picture are left alone.
    """

    target: float = 0.02
    extra: int = 60_000
    share: float = 4.0
    rounds: int = 6
    pixels: float = 1.0


@dataclass(frozen=True, eq=False)
class Refinement:
    """One object's refined mesh; `key` names the mesh that it was made from."""

    key: tuple[str, float]
    mesh: ShadingMesh
    tree: FaceTree
    base: int

    @property
    def extra(self) -> int:
        """Vertices beyond those of the unrefined mesh."""
        return len(self.mesh) - self.base


@dataclass(frozen=True)
class RoundReport:
    """What a round found: estimated relative RMSE of the picture, vertices in all, edges to split next."""

    estimate: float
    vertices: int
    marked: int


class AdaptiveSurfaceStage(SurfaceStage):
    """Shading meshes of all shown objects, refined where the last picture needed it."""

    def __init__(self, services: Services, adaptive: Callable[[Any], Adaptive | None]) -> None:
        super().__init__()
        self._adaptive = adaptive
        self._radiance = VertexRadiance(services)
        self._proven: dict[NodeId, Refinement] = {}
        self._proposed: dict[NodeId, Refinement] | None = None
        self._content: tuple[tuple[Scene, Radiance, Hits], Adaptive] | None = None  # needs no more rounds
        self._has_dropped = False  # in this update: once, so that it ends
        self.reports: list[RoundReport] = []

    def run(self, frame: Frame, inputs: Inputs, job: Job) -> Surfaces:
        """The previous where no object differs and none is refined further."""
        old: Surfaces | None = inputs.previous
        before = dataclasses.replace(inputs, previous=old.unrefined if old is not None else None)
        base = super().run(frame, before, job)
        meant = self._meant(base) if self._adaptive(frame.params) is not None else {}
        if not meant:
            return base
        meshes = {index: found.mesh for index, found in meant.items()}
        if old is not None and old.sources is base.sources and _has(old.mesh, base.mesh, meshes):
            if old.base is base:
                return old
            places = {index: placed.transform for index, placed in enumerate(base.mesh.objects)}
            mesh, tree = old.mesh.moved_many(places), old.tree
        else:
            mesh = base.mesh.with_meshes(meshes)
            tree = joined(
                [
                    meant[index].tree if index in meant else FaceTree.unsplit(len(placed.mesh.faces))
                    for index, placed in enumerate(base.mesh.objects)
                ]
            )
        return dataclasses.replace(base, mesh=mesh, base=base, tree=tree)

    def again(self, frame: Frame, made: Mapping[type, Any], rounds: int, job: Job) -> bool:
        """Whether splitting edges would bring the picture nearer to its target; `reports` tell of each."""
        if self._proposed is not None:
            self._proven, self._proposed = self._proposed, None
        adaptive, surfaces = self._adaptive(frame.params), made[Surfaces]
        # More vertices make light between surfaces no finer: what there is of it is only weighed against.
        radiance: Radiance = made.get(DirectRadiance, made[Radiance])
        if adaptive is None or not radiance.final or radiance.surfaces.mesh is not surfaces.mesh:
            return False
        hits = radiance.hits if radiance.hits is not None else made[Hits]
        asked = (frame.scene, radiance, hits)
        if self._content is not None and _same(asked, self._content[0]) and adaptive == self._content[1]:
            return False
        if not rounds:
            self.reports, self._has_dropped = [], False
        shown = self._radiance(frame.scene, radiance)
        job.checkpoint()
        whole = self._whole(frame.scene, made[Radiance], radiance)
        errors = edge_errors(surfaces.mesh, hits, shown, radiance.valid, whole)
        errors = self._radiance.with_paint(errors, frame.scene, radiance, hits)
        job.checkpoint()
        saved = partial(squares_saved, surfaces.mesh, hits, shown, radiance.valid)
        proven = self._proven
        if not self._has_dropped and rounds < adaptive.rounds:
            proven = self._dropped(surfaces, errors, saved, adaptive)
        if proven is not self._proven:
            self._proposed, self._has_dropped = proven, True
            self.reports.append(RoundReport(errors.relative_rmse, len(surfaces.mesh), 0))
            return True
        edges = _worst(errors, adaptive) if rounds < adaptive.rounds else np.zeros(0, np.int64)
        room = self._room(surfaces, errors, adaptive)
        worth = len(edges) > 0 and room > WORTH * len(edges)
        proposed = self._split(surfaces, errors.ends[edges], room, job) if worth else None
        self.reports.append(RoundReport(errors.relative_rmse, len(surfaces.mesh), len(edges)))
        self._proposed, self._content = proposed, (asked, adaptive) if proposed is None else None
        return proposed is not None

    def _whole(self, scene: Scene, all_light: Radiance, direct: Radiance) -> F32 | None:
        """(V, 3) what is shown in all; None where that is the direct light alone."""
        together = all_light.indirect is not None and all_light.layers is direct.layers
        return self._radiance(scene, all_light) if together else None

    def abandon(self) -> None:
        """Forget the round under way."""
        self._proposed = None

    def _meant(self, base: Surfaces) -> dict[int, Refinement]:
        """Refinements by object, of those that were made from the mesh the object has."""
        held = self._proven if self._proposed is None else self._proposed
        found = {}
        for index, ((node, geometry, _), placed) in enumerate(
            zip(base.sources, base.mesh.objects, strict=True)
        ):
            known = held.get(node)
            if known is not None and known.key == (geometry.key, placed.mesh.edge):
                found[index] = known
        return found

    def _room(self, surfaces: Surfaces, errors: EdgeErrors, adaptive: Adaptive) -> int:
        """How many vertices may still be added."""
        base, mesh = surfaces.unrefined.mesh, surfaces.mesh
        seen = np.unique(errors.ends)
        own = mesh.object[seen]
        unrefined = (seen - mesh.vertex_offsets[own] < np.diff(base.vertex_offsets)[own]).sum()
        return min(adaptive.extra, int(adaptive.share * unrefined)) - (len(mesh) - len(base))

    def _split(self, surfaces: Surfaces, ends: I64, room: int, job: Job) -> dict[NodeId, Refinement] | None:
        """All refinements with these edges (worst first) split, as many of them as there is room for."""
        meant, mesh = self._meant(surfaces.unrefined), surfaces.mesh
        while len(ends):
            made, added = dict(self._proven), 0
            owner = mesh.object[ends[:, 0]]
            for index in np.unique(owner).tolist():
                job.checkpoint()
                placed = mesh.objects[index]
                marked = ends[owner == index] - mesh.vertex_offsets[index]
                node, geometry, _ = surfaces.sources[index]
                known = meant.get(index)
                tree = known.tree if known else FaceTree.unsplit(len(placed.mesh.faces))
                finer, parent = refined(placed.mesh, marked=marked)
                base = known.base if known else len(placed.mesh)
                tree = tree.grown(placed.mesh, finer, parent)
                made[node] = Refinement((geometry.key, placed.mesh.edge), finer, tree, base)
                added += len(finer) - len(placed.mesh)
            if added <= room:
                return made
            ends = ends[: int(len(ends) * min(0.9, 0.95 * room / added))]
        return None

    def _dropped(
        self, surfaces: Surfaces, errors: EdgeErrors, saved: Callable[[], F64], adaptive: Adaptive
    ) -> dict[NodeId, Refinement]:
        """The refinements without those that hardly help, where others have no room; else as they are."""
        meant = self._meant(surfaces.unrefined)
        used = {surfaces.sources[index][0]: known for index, known in meant.items()}
        if sum(known.extra for known in self._proven.values()) > adaptive.extra:
            self._proven = used  # without objects that were removed, or have another mesh by now
        if len(_worst(errors, adaptive)) <= self._room(surfaces, errors, adaptive):
            return self._proven
        gains = saved()
        loss = {index: float(gains[surfaces.mesh.vertices_of(index)].sum()) for index in meant}
        kept, lost = dict(self._proven), 0.0
        for index in sorted(meant, key=lambda index: loss[index] / max(meant[index].extra, 1)):
            lost += loss[index]
            if lost > LOSS * adaptive.target**2 * errors.scale:
                break
            del kept[surfaces.sources[index][0]]
        return kept if len(kept) < len(self._proven) else self._proven


def _same(asked: tuple[object, ...], before: tuple[object, ...]) -> bool:
    return all(one is other for one, other in zip(asked, before, strict=True))


def _has(refined_mesh: WorldMesh, base: WorldMesh, meshes: Mapping[int, ShadingMesh]) -> bool:
    """Whether `refined_mesh` is `base` with these meshes, wherever its objects are."""
    wanted = [meshes.get(index, placed.mesh) for index, placed in enumerate(base.objects)]
    return all(placed.mesh is mesh for placed, mesh in zip(refined_mesh.objects, wanted, strict=True))


def _worst(errors: EdgeErrors, adaptive: Adaptive) -> I64:
    """The edges to split, worst first: those left alone add little to what the target allows."""
    if errors.relative_rmse <= adaptive.target:
        return np.zeros(0, np.int64)
    order = np.argsort(errors.squares, kind="stable")
    order = order[(errors.pixels[order] > adaptive.pixels) & (errors.squares[order] > 0)]
    left = np.cumsum(errors.squares[order])
    marked = order[left > LEFT * adaptive.target**2 * errors.scale]
    if errors.squares[marked].sum() < WORTH * errors.squares.sum():
        return np.zeros(0, np.int64)
    return np.asarray(marked[::-1])


class VertexRadiance:
    """Radiance (V, 3) of light sums with gains, materials' mean coefficients and paint, without textures."""

    def __init__(self, services: Services) -> None:
        self._registry = services.registry
        self._means: dict[MaterialId, tuple[Material, F32]] = {}
        self._paint = PaintTable(services.registry)

    def __call__(self, scene: Scene, radiance: Radiance) -> F32:
        """Zeros where `radiance` is not valid."""
        lights = {light.id: light for light in scene.of(Light) if scene.shown(light.id)}
        materials = radiance.surfaces.materials
        table = np.zeros((len(materials) + 1, radiance.width, 3), np.float32)
        for index, material in enumerate(materials):
            mean = self._mean(scene.material(material))
            table[index, : len(mean)] = mean
        known = np.flatnonzero(radiance.valid)
        terms = radiance.combined(lights)[known]
        mesh = radiance.surfaces.mesh
        shown = table[mesh.material[known]]
        painted = self._paint(scene, materials, mesh, radiance.width)
        if len(painted):
            shown += painted[known].reshape(shown.shape)
        made = np.zeros((len(radiance.valid), 3), np.float32)
        made[known] = (terms * shown).sum(axis=1)
        return made

    def with_paint(self, errors: EdgeErrors, scene: Scene, radiance: Radiance, hits: Hits) -> EdgeErrors:
        """What edges miss, with paint between vertices."""
        coats = self._paint.coats(scene, radiance.surfaces.mesh)
        if not coats or not len(errors.ends):
            return errors
        surfaces = radiance.surfaces
        painted = self._paint(scene, surfaces.materials, surfaces.mesh, radiance.width)
        lights = {light.id: light for light in scene.of(Light) if scene.shown(light.id)}
        terms = np.where(radiance.valid[:, None, None], radiance.combined(lights), 0)
        return with_paint(errors, scene, surfaces, coats, painted, terms, hits, self._registry)

    def _mean(self, material: Material) -> F32:
        known = self._means.get(material.id)
        if known is None or known[0] is not material:
            made = coefficients(resolve(material, self._registry))
            mean = made.reshape(-1, *made.shape[-2:]).mean(axis=0).astype(np.float32)
            known = self._means[material.id] = (material, mean)
        return known[1]


class LocatedPrimaryStage:
    """What the camera sees: primary rays against the unrefined meshes, hits carried to the refined ones."""

    needs: tuple[type, ...] = (Surfaces, Casters)
    gives = Hits
    dirtied_by = Aspect.VIEW

    def __init__(self, services: Services) -> None:
        self._workers = services.workers
        self._primary = PrimaryStage(services)
        self._met: tuple[Surfaces, Casters, Hits] | None = None
        self._carried: tuple[Hits, FaceTree, Hits] | None = None

    def run(self, frame: Frame, inputs: Inputs, job: Job) -> Hits:
        """Refinement alone traces no ray."""
        surfaces, casters = inputs[Surfaces], inputs[Casters]
        base, met = surfaces.unrefined, self._met
        if met is None or met[0] is not base or met[1] is not casters or met[2].view != frame.view:
            before = None if inputs.previous is None or met is None else met[2]
            unrefined = {Surfaces: base, Casters: casters}
            traced = dataclasses.replace(inputs, artifacts=unrefined, previous=before)
            met = self._met = (base, casters, self._primary.run(frame, traced, job))
        if surfaces.tree is None:
            return met[2]
        if self._carried is None or self._carried[0] is not met[2] or self._carried[1] is not surfaces.tree:
            self._carried = (met[2], surfaces.tree, located(met[2], surfaces.tree, self._workers, job))
        return self._carried[2]


def located(hits: Hits, tree: FaceTree, workers: Workers, job: Job | None = None) -> Hits:
    """Hits on the unrefined mesh, on the refined one."""
    count = len(hits.face)
    face, place = np.empty(count, np.int32), np.empty((2, count), np.float32)

    def carry(start: int, stop: int) -> None:
        tables = (tree.root, tree.part, tree.within)
        locate(start, stop, hits.face, hits.u, hits.v, *tables, face, place[0], place[1])

    workers.run(count, CHUNK, carry, job)
    behind = tuple((samples, located(rest, tree, workers, job)) for samples, rest in hits.behind)
    edges = hits.edges
    if edges is not None:
        edges = dataclasses.replace(edges, hits=located(edges.hits, tree, workers, job))
    return dataclasses.replace(hits, face=face, u=place[0], v=place[1], behind=behind, edges=edges)
