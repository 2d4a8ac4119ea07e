"""Rows of receivers and what their rays meet: traced once, kept, and brought up to date where objects moved.

An operator belongs to the compute thread and changes in place. It remembers of every row where all objects
stood when the row was traced. So a cancelled update needs no undoing, rows that nobody wants wait until
somebody does, and what an undone move brings back is known already.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

from studio_core.parallel import Checkpoints, Workers
from studio_core.scene.nodes import NodeId
from studio_core.scene.shading_mesh import ShadingMesh
from studio_core.scene.transform import Transform
from studio_core.scene.world_mesh import WorldMesh
from studio_core.shading.artifacts import Casters
from studio_core.transport.face_corners import FaceCorners
from studio_core.transport.hits import BLACK, GONE, NO_OBJECT, HitTable
from studio_core.transport.trace_rows import ASKED, COUNTS, TRACED, update_rows

F32 = npt.NDArray[np.float32]
I32 = npt.NDArray[np.int32]
I64 = npt.NDArray[np.int64]
Bools = npt.NDArray[np.bool_]
Poses: TypeAlias = tuple[Transform | None, ...]
Shape: TypeAlias = tuple[NodeId, ShadingMesh, object]
"""An object, its mesh, and what casters know of it."""

NEVER = -1
RAYS_A_CHUNK = 1 << 12
ARRAYS = ("rows", "black", "touched", "_epoch", "_seen", "_holes", "variant", "_stream")
"""Names of what each row has."""


@dataclass(frozen=True)
class Counts:
    """What an update did for the wanted rows.

    rays traced against the scene, kept as they were, tested against a moved object alone; rows looked at.
    """

    rays: int = 0
    kept: int = 0
    tested: int = 0
    rows: int = 0


class Rows:
    """What both operators share: the rows' arrays, and whose poses each row was traced in.

    After an update: rows (R,) vertex numbers, row_of (V,) the row of each vertex or -1, table their hits,
    black (R,) how many of a row's rays met the inside of a closed part, touched (R,) rows of which a hit is
    another than when the update before ended. Of rows that were not wanted all this may be out of date:
    current (R,) tells.
    """

    def __init__(self, workers: Workers, rays: int, salt: int = 0) -> None:
        self._workers = workers
        self._rays = rays
        self._salt = salt  # tells the chances of one operator from those of another
        self._shapes: tuple[Shape, ...] = ()
        self._offsets: I64 = np.zeros(1, np.int64)
        self._poses: dict[int, Poses] = {}
        self._now = NEVER
        self._ended = True
        self._corners: FaceCorners | None = None
        self._clear(0)

    def _clear(self, vertices: int) -> None:
        self._poses, self._now = {}, NEVER
        self.row_of: I32 = np.full(vertices, -1, np.int32)
        self._clear_rows()

    def _clear_rows(self) -> None:
        self.row_of[:] = -1
        self.rows: I64 = np.zeros(0, np.int64)
        self.table = HitTable.empty(0, self._rays)
        self.black: npt.NDArray[np.uint16] = np.zeros(0, np.uint16)
        self.touched: Bools = np.zeros(0, np.bool_)
        self._epoch: I32 = np.zeros(0, np.int32)
        self._seen: npt.NDArray[np.uint64] = np.zeros(0, np.uint64)
        self._holes: Bools = np.zeros(0, np.bool_)  # rows that met what is there no more
        self.variant: I32 = np.zeros(0, np.int32)
        self._stream: I64 = np.zeros(0, np.int64)

    def __len__(self) -> int:
        return len(self.rows)

    @property
    def nbytes(self) -> int:
        """Bytes of all that is kept."""
        kept = sum(int(getattr(self, name).nbytes) for name in ARRAYS)
        return self.table.nbytes + int(self.row_of.nbytes) + kept

    @property
    def current(self) -> Bools:
        """(R,) which rows are what would be traced now."""
        return np.asarray((self._epoch == self._now) & ~self._holes)

    @property
    def share_back(self) -> F32:
        """(R,) the share of each row's rays that met the inside of a closed part."""
        return np.asarray(self.black / np.float32(self._rays), np.float32)

    # -- which rows, and of when -------------------------------------------------------------------

    def _turn_to(self, mesh: WorldMesh, casters: Casters) -> None:
        """To another state of the scene: rows stay of objects whose meshes do."""
        known = casters.meshes if len(casters.meshes) == len(mesh.objects) else (None,) * len(mesh.objects)
        shapes = tuple((p.node, p.mesh, key) for p, key in zip(mesh.objects, known, strict=True))
        place = {shape[0]: number for number, shape in enumerate(self._shapes)}
        stays = [
            at if at >= 0 and self._shapes[at][1] is shape[1] and self._shapes[at][2] == shape[2] else -1
            for at, shape in ((place.get(shape[0], -1), shape) for shape in shapes)
        ]
        if stays != list(range(len(self._shapes))) or len(self.row_of) != len(mesh):
            self._renumber(mesh, np.array(stays, np.int64))
        self._shapes, self._offsets = shapes, mesh.vertex_offsets
        poses = tuple(placed.transform for placed in mesh.objects)
        if poses == self._poses.get(self._now):
            return
        used = set(np.unique(self._epoch).tolist())
        self._poses = {epoch: kept for epoch, kept in self._poses.items() if epoch in used}
        same = [epoch for epoch, kept in self._poses.items() if kept == poses]
        self._now = same[0] if same else max(self._poses, default=NEVER) + 1
        self._poses[self._now] = poses

    def _renumber(self, mesh: WorldMesh, stays: I64) -> None:
        """To other objects: stays[new] is the number that an object had, or -1 for one that is new.

        Rays that met what is gone leave a hole, to be traced; what is new is as if it came from nowhere.
        """
        to = np.full(len(self.row_of), -1, np.int64)
        things = np.full(max(len(self._shapes), 1), -1, np.int64)
        numbers: list[int] = stays.tolist()
        for new, old in enumerate(numbers):
            if old >= 0:
                start = int(mesh.vertex_offsets[new])
                to[self._offsets[old] : self._offsets[old + 1]] = np.arange(
                    start, mesh.vertex_offsets[new + 1]
                )
                things[old] = new
        kept = np.flatnonzero(to[self.rows] >= 0)
        if not len(kept):
            self._clear(len(mesh))
            return
        self._keep(kept)
        self.rows = to[self.rows]
        self.row_of = np.full(len(mesh), -1, np.int32)
        self.row_of[self.rows] = np.arange(len(kept), dtype=np.int32)
        vertex, cell = self.table.vertex, self.table.cell
        lit, inside = vertex < len(to), vertex == BLACK
        found = np.where(lit, to[np.where(lit, vertex, 0)], vertex)
        met = np.where(inside & (cell < len(things)), things[np.minimum(cell, len(things) - 1)], -1)
        vertex[:] = np.where(lit & (found < 0) | inside & (met < 0), GONE, found)
        cell[inside] = np.where(met[inside] < 0, 0, np.minimum(met[inside], NO_OBJECT))
        self._holes |= (vertex == GONE).any(axis=1)
        self._look(mesh)
        self.touched[:], self._ended = True, False
        self._poses = {
            epoch: tuple(None if at < 0 else then[at] for at in numbers)
            for epoch, then in self._poses.items()
        }

    def _look(self, mesh: WorldMesh) -> None:
        """Finds out which objects each row meets, and how many rays the inside of one."""
        vertex = self.table.vertex
        inside, lit = vertex == BLACK, vertex < len(mesh)
        things = np.where(inside, self.table.cell, mesh.object[np.where(lit, vertex, 0)])
        bit = np.left_shift(np.uint64(1), things.astype(np.uint64) & np.uint64(63))
        self._seen = np.bitwise_or.reduce(np.where(lit | inside, bit, np.uint64(0)), axis=1)
        self._seen[(inside & (self.table.cell >= NO_OBJECT)).any(axis=1)] = ~np.uint64(0)
        self.black = inside.sum(axis=1).astype(np.uint16)

    def _states(self, epochs: I32) -> tuple[I64, I64, I64, Bools]:
        """Of each row the number of its state; where the moved objects of a state start; they; all to trace.

        Where more than half of the objects moved, keeping the rest is not worth asking.
        """
        distinct, state = np.unique(epochs, return_inverse=True)
        now = self._poses[self._now]
        moved: list[list[int]] = []
        whole = np.zeros(len(distinct), np.bool_)
        for number, epoch in enumerate(distinct.tolist()):
            then = self._poses.get(epoch)
            found = (
                [] if then is None else [i for i, (a, b) in enumerate(zip(then, now, strict=True)) if a != b]
            )
            whole[number] = then is None or 2 * len(found) > max(len(now), 4)
            moved.append([] if whole[number] else found)
        start = np.cumsum([0, *map(len, moved)], dtype=np.int64)
        items = np.array([i for one in moved for i in one], np.int64)
        return state.astype(np.int64).reshape(-1), start, items, whole

    def _keep(self, some: I64) -> None:
        """Only some of the rows."""
        for name in ARRAYS:
            setattr(self, name, getattr(self, name)[some])
        self.table = self.table[some]
        self.row_of[:] = -1
        self.row_of[self.rows] = np.arange(len(some), dtype=np.int32)

    def _append(self, vertices: I64, variant: I32) -> None:
        """Rows for vertices that have none, not traced yet."""
        count, old = len(vertices), len(self.rows)
        self.row_of[vertices] = np.arange(old, old + count, dtype=np.int32)
        fresh: dict[str, npt.NDArray[Any]] = {
            "rows": vertices,
            "black": np.zeros(count, np.uint16),
            "touched": np.ones(count, np.bool_),
            "_epoch": np.full(count, NEVER, np.int32),
            "_seen": np.zeros(count, np.uint64),
            "_holes": np.zeros(count, np.bool_),
            "variant": variant,
            "_stream": vertices + self._salt,
        }
        for name, values in fresh.items():
            setattr(self, name, np.concatenate([getattr(self, name), values]))
        more = HitTable.empty(count, self._rays)
        both = zip(self.table.arrays, more.arrays, strict=True)
        self.table = HitTable(*(np.concatenate(pair) for pair in both))

    # -- tracing -----------------------------------------------------------------------------------

    def _begin(self) -> None:
        """What is touched counts from the last update that was not cancelled."""
        if self._ended:
            self.touched[:] = False
        self._ended = False

    def _trace(
        self,
        mesh: WorldMesh,
        casters: Casters,
        some: I64,
        directions: F32,
        local: bool,
        job: Checkpoints | None,
    ) -> Counts:
        """Brings some of the rows up to date."""
        todo = some[(self._epoch[some] != self._now) | self._holes[some]]
        if not len(todo):
            return Counts(0, len(some) * self._rays)
        state, moved_start, moved_items, whole = self._states(self._epoch[todo])
        caster = casters.primary
        handles = caster.handles()
        self._corners = FaceCorners.of(mesh, handles)
        things = len(mesh.objects)
        part_scene, from_mesh = np.zeros(things, np.int64), np.zeros((things, 3, 4))
        centre, radius = np.zeros((things, 3)), np.zeros(things)
        for thing in np.unique(moved_items).tolist():
            part = caster.part(thing)
            part_scene[thing], radius[thing] = part.scene, part.radius
            from_mesh[thing, :, :3] = part.from_world[:, :3]
            from_mesh[thing, :, 3] = part.from_world[:, :3] @ mesh.origin + part.from_world[:, 3]
            centre[thing] = part.centre - mesh.origin
        shift = np.asarray(mesh.origin - handles.centre, np.float64)
        chunk = max(8, RAYS_A_CHUNK // self._rays)
        counts = np.zeros((-(-len(todo) // chunk), COUNTS), np.int64)
        table = self.table
        frames = np.zeros((len(mesh), 8), np.float32)
        frames[:, :3], frames[:, 3:7] = mesh.normals, mesh.tangents

        asked: tuple[Any, ...] = (
            *(todo, state, moved_start, moved_items, whole, local),
            *(self.rows, self.variant, self._stream, directions),
            *(mesh.positions, frames, mesh.geometric, mesh.inset),
            *(mesh.object, mesh.vertex_offsets, shift, handles.epsilon),
            *(handles.intersect8, handles.occluded8, handles.scene),
            *(handles.face_start, self._corners.table, handles.normals),
            *(part_scene, from_mesh, centre, radius),
            *(table.vertex, table.cell, table.distance.view(np.uint16)),
            *(self._seen, self._holes, self.black, self.touched),
        )

        kernel: Callable[..., None] = update_rows

        def body(start: int, stop: int) -> None:
            kernel(start, stop, *asked, counts[start // chunk])
            done = todo[start:stop]
            self._epoch[done], self._holes[done] = self._now, False

        try:
            self._workers.run(len(todo), chunk, body, job)
        finally:
            rays, tested = (int(counts[:, column].sum()) for column in (TRACED, ASKED))
            caster.count(rays + tested)
        return Counts(rays, len(some) * self._rays - rays, tested, len(todo))


__all__ = ["Counts", "Rows"]
