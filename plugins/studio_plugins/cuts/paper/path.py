"""The paper's way from objects and light to shading: section V, put together.

`PaperPath` keeps self-visibility cuts, visibility cut fields and, per receiver, the cut of v_k (equation
(3)) that their product makes. After a translation nothing is traced but samples that receivers touch for
the first time, and only receivers are multiplied anew for which the moved object hides something, or hid
something where it was. Their product without it is kept, so that every further step of a drag multiplies
one field. Light and view cost no product.
"""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Hashable, Iterable, Sequence

import numpy as np
import numpy.typing as npt

from studio_core.kernels.directions import direction_set
from studio_core.kernels.light_tree import LightTree
from studio_core.kernels.raycast import RayCaster
from studio_core.parallel import Checkpoints, Workers
from studio_core.scene.world_mesh import WorldMesh
from studio_plugins.cuts.nodes import FLOATS, NodeBlock
from studio_plugins.cuts.paper import placement
from studio_plugins.cuts.paper.height_cuts import HIGHEST_K
from studio_plugins.cuts.paper.kept_products import KeptProducts
from studio_plugins.cuts.paper.product import multiply, multiply_by_counters
from studio_plugins.cuts.paper.records import CutSizes
from studio_plugins.cuts.paper.settings import PaperCounts, PaperParams
from studio_plugins.cuts.paper.shading import irradiance_of, nodes_of
from studio_plugins.cuts.paper.stores import PlacedCuts
from studio_plugins.cuts.paper.vcf import VisibilityCutField

U8 = npt.NDArray[np.uint8]
I64 = npt.NDArray[np.int64]
F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]

CHUNK = 32  # receivers of a product
LIGHT_CHUNK = 256
REST = 0.25
"""Share of the allowed error to which products without the moving objects are merged."""
BLOCK = 1024
"""Receivers in a block of nodes."""


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
        self._placed: PlacedCuts | None = None
        self._start_over(0)
        self._done = PaperCounts()
        self._seconds = dict.fromkeys(("product", "light", "concerned"), 0.0)

    @property
    def placed(self) -> PlacedCuts:
        """Objects and their cuts; ValueError before anything was placed."""
        if self._placed is None:
            raise ValueError("nothing is placed yet")
        return self._placed

    def place(self, mesh: WorldMesh, shadow: RayCaster, identities: Sequence[Hashable]) -> None:
        """Takes over where things are; cheap, what it costs is paid when receivers are asked for.

        `shadow` holds the objects of `mesh` in their order; identities[i] is equal for meshes that hide the
        same (geometry and which faces stop light). Cuts of meshes, rotations and scales that are gone are
        dropped.
        """
        before = self._placed
        self._placed = PlacedCuts(mesh, shadow, identities, self.params, self._workers, before)
        changed = None if before is None else self._placed.changed_since(before)
        if changed is None or before is None:
            self._start_over(len(mesh))
            return
        for index in changed:
            old = before.objects[index]
            self._pending.setdefault(index, (old.sphere, old.field))
            self._products.drop(np.arange(mesh.vertex_offsets[index], mesh.vertex_offsets[index + 1]))

    def _start_over(self, count: int) -> None:
        """No receiver has a product."""
        self._pending: dict[int, tuple[F64, VisibilityCutField]] = {}
        self._products = KeptProducts(count)
        # While objects are dragged: products without them, of the receivers that they concern.
        self._moving: frozenset[int] = frozenset()
        self._dragged: npt.NDArray[np.bool_] = np.zeros(count, np.bool_)
        self._rests = KeptProducts(count)

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
        mesh, axis = self.placed.mesh, self._directions.cones.axis
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
                    mesh.normals,
                    mesh.tangents,
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

    @property
    def counts(self) -> PaperCounts:
        """See `PaperCounts`."""
        owns, fields = ([], []) if self._placed is None else (self._placed.owns, self._placed.fields)
        stores = sum(own.nbytes for own in owns) + sum(made.nbytes for made in fields)
        tracing = {} if self._placed is None else self._placed.seconds
        return dataclasses.replace(
            self._done,
            svc=sum((own.records.sizes for own in owns), CutSizes()),
            vcf=sum((made.records.sizes for made in fields), CutSizes()),
            fields=len(fields),
            vcf_possible=sum(len(made.table) for made in fields),
            kept_bytes=stores + self._products.nbytes + self._rests.nbytes,
            product_nodes=self._products.nodes,
            rays=0 if self._placed is None else self._placed.rays,
            seconds={**tracing, **self._seconds},
        )

    def _cuts(self, points: I64, tree: LightTree, job: Checkpoints | None) -> tuple[I64, I64, I64]:
        """Addresses of numbers and values of the product of each point, and its size."""
        if tree.k < self.params.k:
            raise ValueError(f"the light has 2^{tree.k} leaves, the cuts 2^{self.params.k}")
        self.prepare(points, job)
        return self._products.addresses(points)

    def prepare(self, points: I64, job: Checkpoints | None = None) -> None:
        """Makes all cuts that `points` need; light adds little to it."""
        placed = self.placed
        self._settle(placed, job)
        missing = self._products.without(points)
        if not len(missing):
            return
        everything = np.ones(len(placed.objects), np.uint8)
        placed.trace_own(missing, job)
        placed.touch(missing, everything, job)
        again = missing[self._dragged[missing]]
        if len(again):
            moving = _flags(len(placed.objects), self._moving)
            self._multiply(self._rests.without(again), 1 - moving, self._rests, None, REST, job)
            self._multiply(again, moving, self._products, self._rests, 1.0, job)
            missing = missing[~self._dragged[missing]]
        self._multiply(missing, everything, self._products, None, 1.0, job)

    def _settle(self, placed: PlacedCuts, job: Checkpoints | None) -> None:
        """Drops the products of receivers for which a moved object hides something, or did."""
        objects = placed.objects
        pending = {i: was for i, was in self._pending.items() if not objects[i].same_place(*was)}
        if not pending:
            self._pending = {}
            return
        started = time.perf_counter()
        known = self._products.known
        hit = placed.touch(known, _flags(len(objects), pending), job)
        for index, (sphere, field) in pending.items():
            left = known[hit == 0]
            earlier = list(objects)
            earlier[index] = dataclasses.replace(objects[index], sphere=sphere, field=field)
            alone = _flags(len(objects), [index])
            hit[hit == 0] = placed.ask(left, alone, placed.placement(earlier), job)[1]
        if not self._moving.issuperset(pending):
            self._rests, self._moving = KeptProducts(len(self._dragged)), frozenset(pending)
            self._dragged[:] = False
        concerned = known[hit == 1]
        standing = ~np.isin(placed.mesh.object[concerned], list(self._moving))
        self._dragged[concerned[standing]] = True
        self._products.drop(concerned)
        self._pending = {}
        self._seconds["concerned"] += time.perf_counter() - started

    def _multiply(
        self,
        points: I64,
        only: U8,
        into: KeptProducts,
        base: KeptProducts | None,
        part: float,
        job: Checkpoints | None,
    ) -> None:
        """Products of objects `only` with Ṽ_s or with those of `base`, merged to `part` of the error."""
        if not len(points):
            return
        started = time.perf_counter()
        counts = np.zeros((len(points), placement.COUNTS), np.int64)
        arguments = self.placed.placement(self.placed.objects).arguments(points, self.placed.mesh)
        none = np.zeros(len(points), np.int64)
        numbers_at, values_at, sizes_at = (none, none, none - 1) if base is None else base.addresses(points)
        size = self._directions.size
        made: dict[int, tuple[npt.NDArray[np.uint16], F32, npt.NDArray[np.int32]]] = {}
        merge = part * self.params.merge
        limit = np.float32(merge * merge * size if merge > 0 else -1)
        by = multiply_by_counters if self.params.operations == "counters" else multiply

        def body(start: int, stop: int) -> None:
            numbers = np.empty((stop - start) * size, np.uint16)
            values = np.empty((stop - start) * size, np.float32)
            sizes = np.empty(stop - start, np.int32)
            used = by(
                start,
                stop,
                *arguments,
                counts,
                only,
                numbers_at,
                values_at,
                sizes_at,
                limit,
                numbers,
                values,
                sizes,
            )
            made[start] = numbers[:used].copy(), values[:used].copy(), sizes

        self._workers.run(len(points), CHUNK, body, job)
        if counts[:, placement.MISSING].any():
            raise RuntimeError("a sample was not traced before it was used")
        for start in sorted(made):
            numbers, values, sizes = made[start]
            into.put(points[start : start + len(sizes)], sizes, numbers, values)
        self._done = self._done.with_product(counts.sum(axis=0), 0 if into is self._rests else len(points))
        self._seconds["product"] += time.perf_counter() - started


def _flags(count: int, chosen: Iterable[int]) -> U8:
    flags = np.zeros(count, np.uint8)
    flags[list(chosen)] = 1
    return flags
