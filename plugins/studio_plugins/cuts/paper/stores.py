"""All cuts of a scene where its objects stand, traced as they are asked for."""

from __future__ import annotations

import time
from collections.abc import Hashable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from studio_core.kernels.directions import direction_set
from studio_core.kernels.raycast import RayCaster
from studio_core.kernels.visibility import lifted
from studio_core.parallel import Checkpoints, Workers
from studio_core.scene.world_mesh import WorldMesh
from studio_plugins.cuts.paper.placement import COUNTS, MISSING, Placement, touch
from studio_plugins.cuts.paper.records import CutSizes
from studio_plugins.cuts.paper.settings import PaperParams
from studio_plugins.cuts.paper.svc import SelfVisibility
from studio_plugins.cuts.paper.vcf import VisibilityCutField

U8 = npt.NDArray[np.uint8]
I64 = npt.NDArray[np.int64]
F64 = npt.NDArray[np.float64]

CHUNK = 256  # receivers


@dataclass(eq=False)
class PlacedObject:
    """One object as it is placed; `turned` is its rotation and scale, sphere (4,) as in `placement`."""

    mesh: object
    identity: Hashable
    turned: Hashable
    sphere: F64
    own: SelfVisibility
    field: VisibilityCutField

    def same_place(self, sphere: F64, field: VisibilityCutField) -> bool:
        """Whether it hides what an object with this sphere and field hid."""
        return self.field is field and np.array_equal(self.sphere, sphere)


class PlacedCuts:
    """The objects of a mesh in a caster, each with its self-visibility and its field.

    What earlier ones had is taken over where mesh, rotation and scale are the same.
    """

    def __init__(
        self,
        mesh: WorldMesh,
        shadow: RayCaster,
        identities: Sequence[Hashable],
        params: PaperParams,
        workers: Workers,
        before: PlacedCuts | None = None,
    ) -> None:
        if len(shadow) != len(mesh.objects) or len(identities) != len(mesh.objects):
            raise ValueError("the caster, the mesh and the identities must hold the same objects")
        self.mesh, self.shadow, self.params = mesh, shadow, params
        self._workers, self._directions = workers, direction_set(params.k)
        self.rays: int = 0 if before is None else before.rays
        self.seconds: dict[str, float] = {"svc": 0.0, "vcf": 0.0} if before is None else before.seconds
        old = [] if before is None else before.objects
        owns = {(item.mesh, item.identity, item.turned): item.own for item in old}
        fields = {(item.identity, item.turned): item.field for item in old}
        self.objects: list[PlacedObject] = []
        for index, placed in enumerate(mesh.objects):
            part = shadow.part(index)
            turned = (placed.transform.rotation, placed.transform.scale)
            key = (identities[index], turned)
            own_key = (placed.mesh, *key)
            if key not in fields:
                fields[key] = VisibilityCutField(part.radius, params.shells, params.cells)
            if own_key not in owns:
                owns[own_key] = SelfVisibility(len(placed.mesh))
            radius = part.radius if part.scene else 0.0
            sphere = np.append(part.centre - mesh.origin, radius)
            self.objects.append(PlacedObject(placed.mesh, key[0], turned, sphere, owns[own_key], fields[key]))

    def changed_since(self, before: PlacedCuts) -> list[int] | None:
        """Objects that are elsewhere or hide something else than before; None where the mesh is another."""
        if not np.array_equal(before.mesh.origin, self.mesh.origin):
            return None
        if [item.mesh for item in before.objects] != [item.mesh for item in self.objects]:
            return None
        pairs = enumerate(zip(before.objects, self.objects, strict=True))
        return [index for index, (old, new) in pairs if not new.same_place(old.sphere, old.field)]

    @property
    def owns(self) -> list[SelfVisibility]:
        """All self-visibility, each once."""
        return list({id(item.own): item.own for item in self.objects}.values())

    @property
    def fields(self) -> list[VisibilityCutField]:
        """All fields, each once."""
        return list({id(item.field): item.field for item in self.objects}.values())

    def trace_own(self, points: I64, job: Checkpoints | None) -> None:
        """Makes the self-visibility cuts that `points` lack."""
        mesh, shadow = self.mesh, self.shadow
        started = time.perf_counter()
        objects = mesh.object[points]
        for index in np.unique(objects).tolist():
            own = self.objects[index].own
            chosen = points[objects == index]
            rows = chosen - mesh.vertex_offsets[index]
            lacking = own.slots[rows] < 0
            if not lacking.any():
                continue
            chosen, rows = chosen[lacking], rows[lacking]
            world = mesh.positions[chosen] + mesh.origin
            origins = lifted(shadow, world, mesh.geometric[chosen], mesh.inset[chosen])
            rays = own.rays
            own.trace(
                rows,
                shadow.centre + origins.astype(np.float64),
                mesh.normals[chosen].astype(np.float64),
                shadow.part(index),
                shadow.handles().occluded8,
                self._directions,
                self.params.threshold,
                self._workers,
                job,
            )
            self._count_rays(own.rays - rays)
        self.seconds["svc"] += time.perf_counter() - started

    def touch(self, points: I64, only: U8, job: Checkpoints | None) -> U8:
        """Traces the samples that points need of some objects; (P,) whether one of these hides anything."""
        counts, hit = self.ask(points, only, self.placement(self.objects), job)
        if not counts[:, MISSING].any():
            return hit
        started = time.perf_counter()
        occluded8 = self.shadow.handles().occluded8
        for index in np.flatnonzero(only).tolist():
            made, part = self.objects[index].field, self.shadow.part(index)
            wanted = made.wanted()
            if len(wanted) and part.scene:
                rays = made.rays
                made.trace(wanted, part, occluded8, self._directions, self._workers, job)
                self._count_rays(made.rays - rays)
        self.seconds["vcf"] += time.perf_counter() - started
        return self.ask(points, only, self.placement(self.objects), job)[1]

    def _count_rays(self, rays: int) -> None:
        self.shadow.count(rays)
        self.rays += rays

    def ask(self, points: I64, only: U8, placed: Placement, job: Checkpoints | None) -> tuple[I64, U8]:
        """What `placement.touch` says of points: counts (P, COUNTS) and hit (P,)."""
        counts = np.zeros((len(points), COUNTS), np.int64)
        hit = np.zeros(len(points), np.uint8)
        arguments = placed.arguments(points, self.mesh)

        def body(start: int, stop: int) -> None:
            touch(start, stop, *arguments, only, counts, hit)

        self._workers.run(len(points), CHUNK, body, job)
        return counts, hit

    def sampled_fields(
        self, samples: int, rng: np.random.Generator, job: Checkpoints | None = None
    ) -> Iterator[tuple[CutSizes, int]]:
        """Of every field, the sizes of some random samples, which are not kept, and how many it has."""
        seen = set()
        for index, item in enumerate(self.objects):
            part = self.shadow.part(index)
            if item.field in seen or not part.scene:
                continue
            seen.add(item.field)
            other = VisibilityCutField(item.field.radius, self.params.shells, self.params.cells)
            possible = len(other.table)
            chosen = np.sort(rng.choice(possible, min(samples, possible), replace=False)).astype(np.int64)
            occluded8 = self.shadow.handles().occluded8
            other.trace(chosen, part, occluded8, self._directions, self._workers, job)
            yield other.records.sizes, possible

    def placement(self, items: Sequence[PlacedObject]) -> Placement:
        """The tables of objects, at these places or others; new ones after every tracing."""
        selfs = np.zeros((len(items), 5), np.int64)
        fields = np.zeros((len(items), 4), np.int64)
        for index, item in enumerate(items):
            selfs[index, 0] = item.own.slots.ctypes.data
            selfs[index, 1:4] = item.own.records.addresses
            selfs[index, 4] = self.mesh.vertex_offsets[index]
            fields[index, 0] = item.field.table.ctypes.data
            fields[index, 1:] = item.field.records.addresses
        spheres = np.array([item.sphere for item in items]).reshape(-1, 4)
        p = self.params
        return Placement(selfs, fields, spheres, p.shells, p.cells, p.k, p.horizon, p.hidden, list(items))
