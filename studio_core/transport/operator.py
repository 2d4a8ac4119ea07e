"""Rows of receivers and what their rays meet: traced once, kept, and brought up to date where objects moved.

An operator belongs to the compute thread and changes in place. It remembers of every row where all objects
stood when the row was traced. So a cancelled update needs no undoing, rows that nobody wants wait until
somebody does, and what an undone move brings back is known already.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

from studio_core.arrays import readonly
from studio_core.parallel import Checkpoints, Workers
from studio_core.scene.shading_mesh import ShadingMesh
from studio_core.scene.tessellate import morton_codes
from studio_core.scene.transform import Transform
from studio_core.scene.world_mesh import WorldMesh
from studio_core.shading.artifacts import Casters, Surfaces
from studio_core.transport.cells import CELLS
from studio_core.transport.hits import BLACK, NOTHING, HitTable
from studio_core.transport.patterns import Pattern, variants_of
from studio_core.transport.trace_rows import ASKED, COUNTS, TRACED, update_rows

F32 = npt.NDArray[np.float32]
I32 = npt.NDArray[np.int32]
I64 = npt.NDArray[np.int64]
Bools = npt.NDArray[np.bool_]
Poses: TypeAlias = tuple[Transform, ...]

NEVER = -1
RAYS_A_CHUNK = 1 << 12
LIMIT = 96 << 20
VERSION = 1
"""Of what kept rows mean."""
_ARRAYS = ("rows", "black", "touched", "_epoch", "_seen", "variant", "_stream")


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
        self._casters: tuple[object, ...] = ()
        self._meshes: tuple[ShadingMesh, ...] = ()
        self._poses: dict[int, Poses] = {}
        self._now = NEVER
        self._ended = True
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
        self.variant: I32 = np.zeros(0, np.int32)
        self._stream: I64 = np.zeros(0, np.int64)

    def __len__(self) -> int:
        return len(self.rows)

    @property
    def nbytes(self) -> int:
        """Bytes of all that is kept."""
        kept = sum(int(getattr(self, name).nbytes) for name in _ARRAYS)
        return self.table.nbytes + int(self.row_of.nbytes) + kept

    @property
    def current(self) -> Bools:
        """(R,) which rows are what would be traced now."""
        return np.asarray(self._epoch == self._now)

    @property
    def share_back(self) -> F32:
        """(R,) the share of each row's rays that met the inside of a closed part."""
        return np.asarray(self.black / np.float32(self._rays), np.float32)

    # -- which rows, and of when -------------------------------------------------------------------

    def _turn_to(self, mesh: WorldMesh, casters: Casters) -> None:
        """To another state of the scene; where its meshes are others, nothing is kept."""
        meshes = tuple(placed.mesh for placed in mesh.objects)
        same = len(meshes) == len(self._meshes) and all(
            a is b for a, b in zip(meshes, self._meshes, strict=True)
        )
        if not same or self._casters != casters.meshes or len(self.row_of) != len(mesh):
            self._clear(len(mesh))
            self._meshes, self._casters = meshes, casters.meshes
        poses = tuple(placed.transform for placed in mesh.objects)
        if poses == self._poses.get(self._now):
            return
        used = set(np.unique(self._epoch).tolist())
        self._poses = {epoch: kept for epoch, kept in self._poses.items() if epoch in used}
        known = [epoch for epoch, kept in self._poses.items() if kept == poses]
        self._now = known[0] if known else max(self._poses, default=NEVER) + 1
        self._poses[self._now] = poses

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
        for name in _ARRAYS:
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
        todo = some[self._epoch[some] != self._now]
        if not len(todo):
            return Counts(0, len(some) * self._rays)
        state, moved_start, moved_items, whole = self._states(self._epoch[todo])
        caster = casters.primary
        handles = caster.handles()
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

        asked: tuple[Any, ...] = (
            *(todo, state, moved_start, moved_items, whole, local),
            *(self.rows, self.variant, self._stream, directions),
            *(mesh.positions, mesh.normals, mesh.tangents, mesh.geometric, mesh.inset),
            *(mesh.object, mesh.face_offsets, mesh.faces, mesh.back_faces, shift, handles.epsilon),
            *(handles.intersect8, handles.occluded8, handles.scene),
            *(handles.face_start, handles.face_ids, handles.normals),
            *(part_scene, from_mesh, centre, radius),
            *(table.vertex, table.cell, table.distance.view(np.uint16)),
            *(self._seen, self.black, self.touched),
        )

        kernel: Callable[..., None] = update_rows

        def body(start: int, stop: int) -> None:
            kernel(start, stop, *asked, counts[start // chunk])
            self._epoch[todo[start:stop]] = self._now

        try:
            self._workers.run(len(todo), chunk, body, job)
        finally:
            rays, tested = (int(counts[:, column].sum()) for column in (TRACED, ASKED))
            caster.count(rays + tested)
        return Counts(rays, len(some) * self._rays - rays, tested, len(todo))


class Transport(Rows):
    """Rays of a pattern, in the receivers' own frames.

    Rows stay until the meshes change, whether they are wanted or not; where they would take more than
    `limit` bytes, those that are not wanted go.
    """

    def __init__(self, workers: Workers, pattern: Pattern, limit: int = LIMIT) -> None:
        super().__init__(workers, pattern.rays, int(pattern.key[:15], 16))
        self.pattern = pattern
        self._limit = limit

    def update(self, surfaces: Surfaces, casters: Casters, wanted: Bools, job: Checkpoints | None) -> Counts:
        """Rows of the wanted (V,) vertices of the unrefined meshes, up to date.

        Cancelled, it keeps what is done.
        """
        mesh = surfaces.unrefined.mesh
        self._turn_to(mesh, casters)
        self._begin()
        missing = np.flatnonzero(wanted & (self.row_of < 0))
        if len(missing):
            each = max(self.nbytes // max(len(self.rows), 1), 8 * self._rays)
            if (len(self.rows) + len(missing)) * each > self._limit:
                self._keep(np.flatnonzero(wanted[self.rows]))
            missing = missing[_coherent(mesh, missing)]
            self._append(missing, variants_of(missing, self.pattern.variants))
        some = self.row_of[wanted].astype(np.int64)
        some.sort()
        made = self._trace(mesh, casters, some, self.pattern.directions, True, job)
        self._ended = True
        return made

    # -- to keep elsewhere -------------------------------------------------------------------------

    def key(self, casters: Casters) -> tuple[object, ...]:
        """What kept rows depend on: the pattern, the meshes and what of them stops light, where objects stand."""
        return (VERSION, self.pattern.key, casters.meshes, casters.transforms)

    def to_arrays(self) -> dict[str, npt.NDArray[Any]]:
        """The rows that are up to date; for the poses of the last update."""
        some = np.flatnonzero(self.current)
        names = ("vertex", "cell", "distance")
        kept = dict(zip(names, self.table[some].arrays, strict=True))
        return {"rows": self.rows[some], **kept}

    def from_arrays(
        self, surfaces: Surfaces, casters: Casters, arrays: Mapping[str, npt.NDArray[Any]]
    ) -> bool:
        """Takes over rows that were kept under the same `key`, in place of all others; False where they cannot
        be that, and nothing has changed."""
        mesh = surfaces.unrefined.mesh
        if not _fits(arrays, mesh, self._rays):
            return False
        self._turn_to(mesh, casters)
        self._clear_rows()
        rows = np.array(arrays["rows"], np.int64)
        self._append(rows, variants_of(rows, self.pattern.variants))
        self.table = HitTable(*(np.array(arrays[name]) for name in ("vertex", "cell", "distance")))
        inside, lit = self.table.vertex == BLACK, self.table.vertex < len(mesh)
        things = np.where(inside, self.table.cell, mesh.object[np.where(lit, self.table.vertex, 0)])
        bits = np.where(
            lit | inside, np.left_shift(np.uint64(1), things.astype(np.uint64) & np.uint64(63)), 0
        )
        self._seen = np.bitwise_or.reduce(bits.astype(np.uint64), axis=1)
        self.black = inside.sum(axis=1).astype(np.uint16)
        self._epoch[:] = self._now
        return True


class RayTransport(Rows):
    """Rays that somebody chose, such as those of a view's lobes: `rays` of each row."""

    def _clear(self, vertices: int) -> None:
        super()._clear(vertices)
        self.directions: F32 = np.zeros((0, self._rays, 3), np.float32)
        self._order: I64 = np.zeros(0, np.int64)

    @property
    def nbytes(self) -> int:
        """Bytes of all that is kept."""
        return super().nbytes + self.directions.nbytes + self._order.nbytes

    def update(
        self, surfaces: Surfaces, casters: Casters, rows: I64, directions: F32, job: Checkpoints | None
    ) -> Counts:
        """Rows of vertices (R,) of the unrefined meshes, all different, in this order, up to date.

        directions (R, N, 3) are unit vectors in the world; one of length 0 meets nothing. A row is traced
        again where they differ or objects moved. Cancelled, it keeps what is done. ValueError where shapes do
        not fit.
        """
        if directions.shape != (len(rows), self._rays, 3):
            raise ValueError(f"expected directions of shape ({len(rows)}, {self._rays}, 3)")
        mesh = surfaces.unrefined.mesh
        self._turn_to(mesh, casters)
        self._begin()
        given = readonly(directions, np.float32)  # as patterns are: one kernel serves both
        found = self.row_of[rows].astype(np.int64)
        known = np.flatnonzero(found >= 0)
        same = known[(given[known] == self.directions[found[known]]).all(axis=(1, 2))]
        if not (len(same) == len(rows) == len(self.rows) and np.array_equal(found, np.arange(len(rows)))):
            self._reorder(mesh, rows.astype(np.int64), found, same)
            self.directions = given
        made = self._trace(mesh, casters, self._order, self.directions, False, job)
        self._ended = True
        return made

    def _reorder(self, mesh: WorldMesh, rows: I64, found: I64, same: I64) -> None:
        """Other rows, or other directions; what was found of the `same` stays."""
        before: dict[str, npt.NDArray[Any]] = {name: getattr(self, name) for name in _ARRAYS}
        table = self.table
        self._clear_rows()
        self._append(rows, np.arange(len(rows), dtype=np.int32))
        self._order = _coherent(mesh, rows)
        for name in _ARRAYS:
            if name != "variant":
                getattr(self, name)[same] = before[name][found[same]]
        for array, then in zip(self.table.arrays, table.arrays, strict=True):
            array[same] = then[found[same]]


def _fits(arrays: Mapping[str, npt.NDArray[Any]], mesh: WorldMesh, rays: int) -> bool:
    """Whether these can be hits of vertices of a mesh."""
    types = {"rows": np.int64, "vertex": np.uint32, "cell": np.uint16, "distance": np.float16}
    if arrays.keys() != types.keys() or any(arrays[name].dtype != kind for name, kind in types.items()):
        return False
    rows, vertex, cell = arrays["rows"], arrays["vertex"], arrays["cell"]
    if rows.ndim != 1 or any(arrays[n].shape != (len(rows), rays) for n in ("vertex", "cell", "distance")):
        return False
    lit, special = vertex < len(mesh), (vertex == NOTHING) | (vertex == BLACK)
    return bool(
        len(np.unique(rows)) == len(rows)
        and ((rows >= 0) & (rows < len(mesh))).all()
        and (lit | special).all()
        and (cell[lit] < CELLS).all()
        and (arrays["distance"] >= 0).all()
    )


def _coherent(mesh: WorldMesh, vertices: I64) -> I64:
    """An order of vertices in which neighbours look the same way from about the same place."""
    if not len(vertices):
        return np.zeros(0, np.int64)
    normals = mesh.normals[vertices]
    axis = np.abs(normals).argmax(axis=1)
    facing = 2 * axis + (np.take_along_axis(normals, axis[:, None], axis=1)[:, 0] < 0)
    return np.lexsort((morton_codes(mesh.positions[vertices].astype(np.float64)), facing))


__all__ = ["Counts", "RayTransport", "Rows", "Transport"]
