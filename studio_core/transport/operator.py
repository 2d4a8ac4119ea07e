"""Operators: kept rays of a pattern, or rays that somebody chose, and what they meet."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from studio_core.arrays import readonly
from studio_core.parallel import Checkpoints, Workers
from studio_core.scene.world_mesh import WorldMesh
from studio_core.shading.artifacts import Casters, Surfaces
from studio_core.transport.cells import CELLS
from studio_core.transport.coherence import coherent
from studio_core.transport.hits import BLACK, NOTHING, HitTable
from studio_core.transport.patterns import Pattern, variants_of
from studio_core.transport.rows import ARRAYS, Counts, Rows

F32 = npt.NDArray[np.float32]
I64 = npt.NDArray[np.int64]
Bools = npt.NDArray[np.bool_]

LIMIT = 96 << 20
VERSION = 1
"""Of what kept rows mean."""


class Transport(Rows):
    """Rays of a pattern, in the receivers' own frames.

    Rows stay as long as their object's mesh, whether they are wanted or not; where they would take more than
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
            missing = missing[coherent(mesh.positions[missing], mesh.normals[missing])]
            self._append(missing, variants_of(missing, self.pattern.variants))
        some = self.row_of[wanted].astype(np.int64)
        some.sort()
        made = self._trace(mesh, casters, some, self.pattern.directions, True, job)
        self._ended = True
        return made

    def keep_only(self, wanted: Bools) -> None:
        """Forgets the rows of vertices that are not among the wanted (V,) of the last update's meshes."""
        some = np.flatnonzero(wanted[self.rows])
        if len(some) < len(self.rows):
            self._keep(some)

    # -- to keep elsewhere -------------------------------------------------------------------------

    def key(self, casters: Casters) -> tuple[object, ...]:
        """What kept rows depend on: the pattern, the meshes, what stops light, where objects stand."""
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
        """Takes over rows that were kept under the same `key`, in place of all others.

        False, and nothing is changed, where they cannot be that.
        """
        mesh = surfaces.unrefined.mesh
        if not _fits(arrays, mesh, self._rays):
            return False
        self._turn_to(mesh, casters)
        self._clear_rows()
        rows = np.array(arrays["rows"], np.int64)
        self._append(rows, variants_of(rows, self.pattern.variants))
        self.table = HitTable(*(np.array(arrays[name]) for name in ("vertex", "cell", "distance")))
        self._look(mesh)
        self._epoch[:] = self._now
        return True


class RayTransport(Rows):
    """Rays that somebody chose, such as those of a view's lobes: `rays` of each row."""

    def _clear(self, vertices: int) -> None:
        super()._clear(vertices)
        self.directions: F32 = np.zeros((0, self._rays, 3), np.float32)
        self._order: I64 = np.zeros(0, np.int64)

    def _keep(self, some: I64) -> None:
        super()._keep(some)
        self.directions = self.directions[some]
        self._order = np.arange(len(some))
        self.variant = self._order.astype(np.int32)

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
        before: dict[str, npt.NDArray[Any]] = {name: getattr(self, name) for name in ARRAYS}
        table = self.table
        self._clear_rows()
        self._append(rows, np.arange(len(rows), dtype=np.int32))
        self._order = coherent(mesh.positions[rows], mesh.normals[rows])
        for name in ARRAYS:
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


__all__ = ["Counts", "RayTransport", "Rows", "Transport"]
