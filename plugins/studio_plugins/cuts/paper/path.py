"""The paper's way from objects and light to shading: section V, put together.

`PaperPath` keeps self-visibility cuts, visibility cut fields and, per receiver, the cut of v_k (equation
(3)) that their product makes. After a translation nothing is traced but samples that receivers touch for
the first time, and only receivers are multiplied anew for which the moved object hides something, or hid
something where it was. Light and view cost no product.
"""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Hashable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from studio_core.kernels.directions import direction_set
from studio_core.kernels.light_tree import LightTree
from studio_core.kernels.raycast import RayCaster
from studio_core.kernels.visibility import lifted
from studio_core.parallel import Checkpoints, Workers
from studio_core.scene.world_mesh import WorldMesh
from studio_plugins.cuts.nodes import FLOATS, NodeBlock
from studio_plugins.cuts.paper import placement
from studio_plugins.cuts.paper.height_cuts import HIGHEST_K
from studio_plugins.cuts.paper.kept_products import KeptProducts
from studio_plugins.cuts.paper.placement import Placement, touch
from studio_plugins.cuts.paper.product import multiply, multiply_by_counters
from studio_plugins.cuts.paper.records import CutSizes
from studio_plugins.cuts.paper.settings import PaperCounts, PaperParams
from studio_plugins.cuts.paper.shading import irradiance_of, nodes_of
from studio_plugins.cuts.paper.svc import SelfVisibility
from studio_plugins.cuts.paper.vcf import VisibilityCutField

U8 = npt.NDArray[np.uint8]
I64 = npt.NDArray[np.int64]
F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]

CHUNK = 32  # receivers of a product
LIGHT_CHUNK = 256
BLOCK = 1024
"""Receivers in a block of nodes."""


@dataclass(eq=False)
class _Item:
    """One object as it is placed."""

    mesh: object
    identity: Hashable
    turned: Hashable
    sphere: F64
    own: SelfVisibility
    field: VisibilityCutField


class PaperPath:
    """See the module. Used by one thread at a time; every method that computes can be cancelled.

    What was finished before a cancellation is kept, and nothing wrong is.
    """

    def __init__(self, workers: Workers, params: PaperParams | None = None) -> None:
        self.params = params or PaperParams()
        if not 10 <= self.params.k <= HIGHEST_K:
            raise ValueError(f"the paper's cuts have 2^10 to 2^{HIGHEST_K} directions, not 2^{self.params.k}")
        if self.params.shells < 2 or self.params.cells < 1 or self.params.threshold < 0:
            raise ValueError("a field needs two spheres or more of one cell or more, and no negative error")
        self._workers = workers
        self._directions = direction_set(self.params.k)
        self._items: list[_Item] = []
        self._mesh: WorldMesh | None = None
        self._shadow: RayCaster | None = None
        self._pending: dict[int, tuple[F64, VisibilityCutField]] = {}
        self._products = KeptProducts(0)
        self._done = PaperCounts()
        self._seconds = dict.fromkeys(("svc", "vcf", "product", "light", "concerned"), 0.0)

    # placing

    def place(self, mesh: WorldMesh, shadow: RayCaster, identities: Sequence[Hashable]) -> None:
        """Takes over where things are; cheap, what it costs is paid when receivers are asked for.

        `shadow` holds the objects of `mesh` in their order; identities[i] is equal for meshes that hide the
        same (geometry and which faces stop light). Cuts of meshes, rotations and scales that are gone are
        dropped.
        """
        if len(shadow) != len(mesh.objects) or len(identities) != len(mesh.objects):
            raise ValueError("the caster, the mesh and the identities must hold the same objects")
        before = self._items
        owns = {(item.mesh, item.identity, item.turned): item.own for item in before}
        fields = {(item.identity, item.turned): item.field for item in before}
        items = []
        for index, placed in enumerate(mesh.objects):
            part = shadow.part(index)
            turned = (placed.transform.rotation, placed.transform.scale)
            key = (identities[index], turned)
            own_key = (placed.mesh, *key)
            if key not in fields:
                fields[key] = VisibilityCutField(part.radius, self.params.shells, self.params.cells)
            if own_key not in owns:
                owns[own_key] = SelfVisibility(len(placed.mesh))
            radius = part.radius if part.scene else 0.0
            sphere = np.append(part.centre - mesh.origin, radius)
            items.append(_Item(placed.mesh, key[0], turned, sphere, owns[own_key], fields[key]))
        same = (
            self._mesh is not None
            and np.array_equal(self._mesh.origin, mesh.origin)
            and [item.mesh for item in before] == [item.mesh for item in items]
        )
        if same:
            for index, (old, new) in enumerate(zip(before, items, strict=True)):
                if old.field is not new.field or not np.array_equal(old.sphere, new.sphere):
                    self._pending.setdefault(index, (old.sphere, old.field))
                    self._products.drop(np.arange(mesh.vertex_offsets[index], mesh.vertex_offsets[index + 1]))
        self._items, self._mesh, self._shadow = items, mesh, shadow
        if not same:
            self._pending = {}
            self._products = KeptProducts(len(mesh))

    # results

    def irradiance(self, points: I64, tree: LightTree, job: Checkpoints | None = None) -> F32:
        """(P, 3): Σ_k l_k v_k at rows `points` of the mesh, equation (3) with a BRDF of 1."""
        numbers, values, sizes = self._cuts(points, tree, job)
        out = np.empty((len(points), 3), np.float32)
        started = time.perf_counter()

        def body(start: int, stop: int) -> None:
            irradiance_of(start, stop, points, numbers, values, sizes, tree.node_sum, tree.solid_angle, out)

        self._workers.run(len(points), LIGHT_CHUNK, body, job)
        self._seconds["light"] += time.perf_counter() - started
        return out

    def nodes(self, points: I64, tree: LightTree, job: Checkpoints | None = None) -> list[NodeBlock]:
        """The nodes of equation (3) at rows `points` of the mesh: ω_k and l_k v_k, in blocks of 1,024."""
        numbers, values, sizes = self._cuts(points, tree, job)
        assert self._mesh is not None
        normals, axis = self._mesh.normals, self._directions.cones.axis
        started = time.perf_counter()
        blocks = []
        for begin in range(0, len(points), BLOCK):
            part = slice(begin, begin + BLOCK)
            chosen = np.ascontiguousarray(points[part])
            first = np.concatenate([[0], np.cumsum(sizes[part])]).astype(np.int64)
            data = np.empty(FLOATS * int(first[-1]), np.float32)

            def body(
                start: int,
                stop: int,
                part: slice = part,
                chosen: I64 = chosen,
                first: I64 = first,
                data: F32 = data,
            ) -> None:
                nodes_of(
                    start,
                    stop,
                    chosen,
                    normals,
                    numbers[part],
                    values[part],
                    first,
                    tree.node_sum,
                    axis,
                    tree.solid_angle,
                    data,
                )

            self._workers.run(len(chosen), LIGHT_CHUNK, body, job)
            blocks.append(NodeBlock(chosen, first, data))
        self._seconds["light"] += time.perf_counter() - started
        return blocks

    def cut(self, point: int) -> tuple[I64, F32]:
        """Heap numbers and values v_k of the nodes of one receiver that has a product."""
        return self._products.cut(point)

    def made(self) -> int:
        """How many receivers have a product, as far as is known: a move may have outdated some."""
        return len(self._products.known)

    def sampled_fields(
        self, samples: int, rng: np.random.Generator, job: Checkpoints | None = None
    ) -> Iterator[tuple[CutSizes, int]]:
        """Of every field, the sizes of some random samples, which are not kept, and how many it has."""
        assert self._shadow is not None
        seen = set()
        for index, item in enumerate(self._items):
            part = self._shadow.part(index)
            if item.field in seen or not part.scene:
                continue
            seen.add(item.field)
            other = VisibilityCutField(item.field.radius, self.params.shells, self.params.cells)
            possible = len(other.table)
            chosen = np.sort(rng.choice(possible, min(samples, possible), replace=False)).astype(np.int64)
            occluded8 = self._shadow.handles().occluded8
            other.trace(chosen, part, occluded8, self._directions, self._workers, job)
            yield other.records.sizes, possible

    @property
    def counts(self) -> PaperCounts:
        """See `PaperCounts`."""
        owns = {id(item.own): item.own for item in self._items}.values()
        fields = {id(item.field): item.field for item in self._items}.values()
        return dataclasses.replace(
            self._done,
            svc=sum((own.records.sizes for own in owns), CutSizes()),
            vcf=sum((made.records.sizes for made in fields), CutSizes()),
            fields=len(fields),
            vcf_possible=sum(len(made.table) for made in fields),
            kept_bytes=sum(own.nbytes for own in owns)
            + sum(made.nbytes for made in fields)
            + self._products.nbytes,
            product_nodes=self._products.nodes,
            seconds=dict(self._seconds),
        )

    # making cuts

    def _cuts(self, points: I64, tree: LightTree, job: Checkpoints | None) -> tuple[I64, I64, I64]:
        """Addresses of numbers and values of the product of each point, and its size."""
        if tree.k < self.params.k:
            raise ValueError(f"the light has 2^{tree.k} leaves, the cuts 2^{self.params.k}")
        self.prepare(points, job)
        return self._products.addresses(points)

    def prepare(self, points: I64, job: Checkpoints | None = None) -> None:
        """Makes all cuts that `points` need; light adds little to it."""
        if self._mesh is None:
            raise ValueError("nothing is placed yet")
        self._settle(job)
        missing = self._products.without(points)
        if not len(missing):
            return
        self._trace_own(missing, job)
        self._touch(missing, np.ones(len(self._items), np.uint8), job)
        self._multiply(missing, job)

    def _settle(self, job: Checkpoints | None) -> None:
        """Drops the products of receivers for which a moved object hides something, or did."""
        if not self._pending:
            return
        pending = self._pending
        known = self._products.known
        started = time.perf_counter()
        only = np.zeros(len(self._items), np.uint8)
        only[list(pending)] = 1
        hit = self._touch(known, only, job)
        for index, (sphere, old) in pending.items():
            left = known[hit == 0]
            if not len(left):
                break
            items = list(self._items)
            items[index] = dataclasses.replace(items[index], sphere=sphere, field=old)
            alone = np.zeros(len(items), np.uint8)
            alone[index] = 1
            hit[hit == 0] = self._ask(left, alone, self._placement(items), job)[1]
        self._seconds["concerned"] += time.perf_counter() - started
        self._products.drop(known[hit == 1])
        self._pending = {}

    def _trace_own(self, points: I64, job: Checkpoints | None) -> None:
        assert self._mesh is not None
        assert self._shadow is not None
        mesh, shadow = self._mesh, self._shadow
        started = time.perf_counter()
        objects = mesh.object[points]
        for index in np.unique(objects).tolist():
            own = self._items[index].own
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
        self._seconds["svc"] += time.perf_counter() - started

    def _touch(self, points: I64, only: U8, job: Checkpoints | None) -> U8:
        """Traces the samples that points need of some objects; (P,) whether one of these hides anything."""
        counts, hit = self._ask(points, only, self._placement(self._items), job)
        if not counts[:, placement.MISSING].any():
            return hit
        assert self._shadow is not None
        started = time.perf_counter()
        occluded8 = self._shadow.handles().occluded8
        for index in np.flatnonzero(only).tolist():
            made, part = self._items[index].field, self._shadow.part(index)
            wanted = made.wanted()
            if len(wanted) and part.scene:
                rays = made.rays
                made.trace(wanted, part, occluded8, self._directions, self._workers, job)
                self._count_rays(made.rays - rays)
        self._seconds["vcf"] += time.perf_counter() - started
        return self._ask(points, only, self._placement(self._items), job)[1]

    def _count_rays(self, rays: int) -> None:
        assert self._shadow is not None
        self._shadow.count(rays)
        self._done = dataclasses.replace(self._done, rays=self._done.rays + rays)

    def _ask(self, points: I64, only: U8, placed: Placement, job: Checkpoints | None) -> tuple[I64, U8]:
        mesh = self._mesh
        assert mesh is not None
        counts = np.zeros((len(points), placement.COUNTS), np.int64)
        hit = np.zeros(len(points), np.uint8)
        arguments = placed.arguments(points, mesh)

        def body(start: int, stop: int) -> None:
            touch(start, stop, *arguments, only, counts, hit)

        self._workers.run(len(points), LIGHT_CHUNK, body, job)
        return counts, hit

    def _multiply(self, points: I64, job: Checkpoints | None) -> None:
        mesh = self._mesh
        assert mesh is not None
        started = time.perf_counter()
        counts = np.zeros((len(points), placement.COUNTS), np.int64)
        placed = self._placement(self._items)
        arguments = placed.arguments(points, mesh)
        size = self._directions.size
        made: dict[int, tuple[npt.NDArray[np.uint16], F32, npt.NDArray[np.int32]]] = {}
        merge = self.params.merge
        limit = np.float32(merge * merge * size if merge > 0 else -1)
        by = multiply_by_counters if self.params.operations == "counters" else multiply

        def body(start: int, stop: int) -> None:
            numbers = np.empty((stop - start) * size, np.uint16)
            values = np.empty((stop - start) * size, np.float32)
            sizes = np.empty(stop - start, np.int32)
            used = by(start, stop, *arguments, counts, limit, numbers, values, sizes)
            made[start] = numbers[:used].copy(), values[:used].copy(), sizes

        self._workers.run(len(points), CHUNK, body, job)
        if counts[:, placement.MISSING].any():
            raise RuntimeError("a sample was not traced before it was used")
        for start in sorted(made):
            numbers, values, sizes = made[start]
            self._products.put(points[start : start + len(sizes)], sizes, numbers, values)
        total = counts.sum(axis=0)
        self._done = dataclasses.replace(
            self._done,
            products=self._done.products + len(points),
            pairs_used=self._done.pairs_used + int(total[placement.USED]),
            pairs_under_horizon=self._done.pairs_under_horizon + int(total[placement.HORIZON]),
            pairs_hidden=self._done.pairs_hidden + int(total[placement.HIDDEN]),
            pairs_inside=self._done.pairs_inside + int(total[placement.NEAR]),
            pairs_beyond=self._done.pairs_beyond + int(total[placement.FAR]),
        )
        self._seconds["product"] += time.perf_counter() - started

    def _placement(self, items: Sequence[_Item]) -> Placement:
        assert self._mesh is not None
        selfs = np.zeros((len(items), 5), np.int64)
        fields = np.zeros((len(items), 4), np.int64)
        for index, item in enumerate(items):
            selfs[index, 0] = item.own.slots.ctypes.data
            selfs[index, 1:4] = item.own.records.addresses
            selfs[index, 4] = self._mesh.vertex_offsets[index]
            fields[index, 0] = item.field.table.ctypes.data
            fields[index, 1:] = item.field.records.addresses
        spheres = np.array([item.sphere for item in items]).reshape(-1, 4)
        p = self.params
        return Placement(selfs, fields, spheres, p.shells, p.cells, p.k, p.horizon, p.hidden, list(items))
