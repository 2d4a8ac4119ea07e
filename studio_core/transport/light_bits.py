"""What points see of the samples of lights: traced once, kept as bits, mended after a move.

A pair of point and sample is traced again only where the point or the sample has moved, or where something
that moved was or is between them. What is still to be traced is kept as marks beside the bits, so an update
that was cancelled is gone on with by the next.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from studio_core.kernels.raycast import RayCaster
from studio_core.kernels.visibility import lifted
from studio_core.parallel import Checkpoints, Workers
from studio_core.scene.transform import Transform
from studio_core.scene.world_mesh import WorldMesh
from studio_core.shading.artifacts import Casters
from studio_core.transport.coherence import coherent
from studio_core.transport.light_kernels import mark_moved, repack, trace_pairs
from studio_core.transport.light_samples import LightSamples

F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]
I32 = npt.NDArray[np.int32]
I64 = npt.NDArray[np.int64]
U64 = npt.NDArray[np.uint64]

PAIRS_A_CHUNK = 1 << 15
_ALL = ~np.uint64(0)
_MARGIN = 1e-4  # of what is about an object


@dataclass(frozen=True, eq=False)
class LitPoints:
    """Vertices of a mesh, all of them or some: which object each belongs to, in which variant it looks."""

    origin: F64
    positions: F32
    normals: F32
    geometric: F32
    inset: F32
    object: I32
    variant: I32

    @staticmethod
    def of(mesh: WorldMesh, variant: I32, some: I64 | None = None) -> LitPoints:
        """All of a mesh, or those that are named; `variant` is that of each of them."""
        at = slice(None) if some is None else some
        return LitPoints(
            mesh.origin,
            np.ascontiguousarray(mesh.positions[at]),
            np.ascontiguousarray(mesh.normals[at]),
            np.ascontiguousarray(mesh.geometric[at]),
            np.ascontiguousarray(mesh.inset[at]),
            np.ascontiguousarray(mesh.object[at]),
            variant,
        )

    def __len__(self) -> int:
        return len(self.positions)


@dataclass(frozen=True, eq=False)
class Bounds:
    """Spheres (n, 4) about objects in the world, and boxes (n, 3, 4) that lead to where each is ±1."""

    spheres: F64
    boxes: F64

    @staticmethod
    def of(caster: RayCaster) -> Bounds:
        """Where a caster's objects are now; a box that nothing meets where there is nothing to meet."""
        spheres, boxes = np.zeros((len(caster), 4)), np.zeros((len(caster), 3, 4))
        for index in range(len(caster)):
            part = caster.part(index)
            spheres[index] = *part.centre, part.radius * (1 + _MARGIN)
            if part.scene:
                half = part.half + _MARGIN * part.half.sum() + caster.epsilon * part.scale
                boxes[index] = part.from_world / half[:, None]
            else:
                boxes[index, :, 3] = 1e9
        return Bounds(spheres, boxes)

    def boxes_about(self, origin: F64) -> F64:
        """The boxes, for points relative to an origin."""
        made = self.boxes.copy()
        made[:, :, 3] += made[:, :, :3] @ origin
        return made


class LightBits:
    """Bits (V, W) of points and columns of samples; `seen` is right after every `update` that returns.

    Owned by the compute thread.
    """

    def __init__(self, workers: Workers) -> None:
        self._workers = workers
        self._caster: RayCaster | None = None
        self._transforms: tuple[Transform, ...] = ()
        self._bounds = Bounds(np.zeros((0, 4)), np.zeros((0, 3, 4)))
        self._keys: tuple[tuple[object, int], ...] = ()
        self._rows = 0
        self._order = np.zeros(0, np.int32)
        self.seen: U64 = np.zeros((0, 0), np.uint64)
        self._todo: U64 = np.zeros((0, 0), np.uint64)

    @property
    def nbytes(self) -> int:
        """Memory of what is kept."""
        return self.seen.nbytes + self._todo.nbytes + self._order.nbytes

    def update(
        self, points: LitPoints, casters: Casters, samples: LightSamples, job: Checkpoints | None = None
    ) -> tuple[int, int]:
        """Follows objects and samples; how many pairs were traced and how many were kept.

        `points` belong to the meshes of `casters.primary`, which are what stops light. Where the caster is
        another one, everything is traced.
        """
        caster, relative = casters.primary, samples.relative(points.origin)
        count, words = len(points), -(-len(samples) // 64)
        if caster is not self._caster or count != len(self.seen) or samples.rows != self._rows:
            self.seen = np.zeros((count, words), np.uint64)
            self._todo = np.full((count, words), _ALL)
            self._caster, self._rows, self._keys = caster, samples.rows, samples.keys
            self._order = coherent(points.positions, points.normals).astype(np.int32)
            self._transforms = casters.transforms
            self._bounds = Bounds.of(caster)
        else:
            self._follow_samples(samples)
            self._follow_objects(points, casters, samples, relative)
        return self._trace(points, samples, relative, job)

    def _follow_samples(self, samples: LightSamples) -> None:
        """Columns that are still what they were keep their bits; others are marked."""
        if samples.keys == self._keys:
            return
        starts, at = {}, 0
        for group in self._keys:
            starts[group] = at
            at += group[1]
        source = np.concatenate(
            [
                np.zeros(0, np.int64),
                *(starts[g] + np.arange(g[1]) if g in starts else np.full(g[1], -1) for g in samples.keys),
            ]
        ).astype(np.int64)
        shape = (len(self.seen), -(-len(source) // 64))
        seen, todo = np.zeros(shape, np.uint64), np.zeros(shape, np.uint64)
        repack(self.seen, source, seen)
        repack(self._todo, source, todo)
        self.seen, self._todo, self._keys = seen, todo, samples.keys

    def _follow_objects(self, points: LitPoints, casters: Casters, samples: LightSamples, place: F64) -> None:
        """Marks what a move may have changed. Never stopped halfway: marks and transforms belong together."""
        pairs = enumerate(zip(casters.transforms, self._transforms, strict=True))
        moved = [index for index, (now, before) in pairs if now != before]
        if not moved:
            return
        shift = np.append(points.origin, 0.0)
        bounds = Bounds.of(casters.primary)
        before, now = (b.spheres[moved] - shift for b in (self._bounds, bounds))
        boxes = [b.boxes_about(points.origin)[moved] for b in (self._bounds, bounds)]
        self._todo[np.isin(points.object, moved)] = _ALL
        if len(samples):
            ends = np.zeros((samples.rows, 4, 64 * self.seen.shape[1]), np.float32)
            ends[:, :, : len(samples)] = place.transpose(0, 2, 1)
            self._workers.run(
                len(points),
                max(64, PAIRS_A_CHUNK // len(samples)),
                lambda start, stop: mark_moved(
                    points.positions,
                    points.normals,
                    points.variant,
                    ends,
                    before,
                    now,
                    boxes[0],
                    boxes[1],
                    self.seen,
                    self._todo,
                    start,
                    stop,
                ),
            )
        self._transforms, self._bounds = casters.transforms, bounds

    def _trace(
        self, points: LitPoints, samples: LightSamples, place: F64, job: Checkpoints | None
    ) -> tuple[int, int]:
        assert self._caster is not None
        todo = self._order[self._todo[self._order].any(axis=1)] if len(samples) else self._order[:0]
        with np.errstate(invalid="ignore", over="ignore"):
            origins = lifted(self._caster, points.positions + points.origin, points.geometric, points.inset)
        handles = self._caster.handles()
        counts: list[int] = []
        shift = points.origin - self._caster.centre
        gap = 4 * self._caster.epsilon

        def body(start: int, stop: int) -> None:
            traced = trace_pairs(
                handles.occluded8,
                handles.scene,
                todo,
                origins,
                points.positions,
                points.normals,
                samples.kind,
                points.variant,
                place,
                samples.lamp,
                shift,
                gap,
                self._todo,
                self.seen,
                start,
                stop,
            )
            counts.append(traced)

        self._workers.run(len(todo), max(64, PAIRS_A_CHUNK // max(len(samples), 1)), body, job)
        rays = sum(counts)
        self._caster.count(rays)
        return rays, len(points) * len(samples) - rays
