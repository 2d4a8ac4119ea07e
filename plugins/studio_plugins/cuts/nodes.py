"""Cut nodes of shading points: the light that arrives, as a few directions with an irradiance each.

Equation (3) of Iwasaki et al., B(x, ω_o) ≈ Σ_k l_k v_k f_r(ω_k, ω_o): node k of a point is the direction
ω_k in the point's shading frame and l_k v_k, what it adds to the irradiance. The exact path, the paper's
and traced lamps all make them; only the sum over BRDFs follows.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from studio_core.parallel import Workers
from studio_core.shading.artifacts import ShadingPoints, Shapes
from studio_core.shading.job import Job
from studio_plugins.cuts.shade import node_terms

F32 = npt.NDArray[np.float32]
I32 = npt.NDArray[np.int32]
I64 = npt.NDArray[np.int64]
Bools = npt.NDArray[np.bool_]

FLOATS = 6  # a node: x, y, z, red, green, blue
NO_BLOCK = -1
_BLOCKS_A_CHUNK = 2
_NO_TILT, _NO_TILTS = np.zeros(0, np.float32), np.zeros((0, 0, 0, 0), np.float32)


@dataclass(frozen=True)
class Detail:
    """What splitting the nodes of a block further needs.

    spread (N,) mean square angle of each node's light about its direction; cell (N,) the node of the tree of
    directions it stands for.
    """

    spread: F32
    cell: I32

    @property
    def nbytes(self) -> int:
        """Bytes of all arrays."""
        return self.spread.nbytes + self.cell.nbytes


@dataclass(frozen=True)
class NodeBlock:
    """The nodes of some points, as BRDF kernels read them.

    points (P,) rows of the mesh, -1 for none; first (P + 1,) number of each point's first node; data (6 N,):
    of a point with n nodes, from 6·first: x[n], y[n], z[n] (unit, in the shading frame of
    `kernels.radiance.surface_frame`), red[n], green[n], blue[n] (L·V·cosθ·Δω of the node).
    """

    points: I64
    first: I64
    data: F32
    detail: Detail | None = None

    @property
    def nbytes(self) -> int:
        """Bytes of all arrays."""
        own = self.points.nbytes + self.first.nbytes + self.data.nbytes
        return own + (self.detail.nbytes if self.detail is not None else 0)

    @property
    def most(self) -> int:
        """Nodes of the point that has most."""
        return int(np.diff(self.first).max(initial=1))


class NodeTable:
    """The nodes of V vertices from one light, changed in place.

    irradiance (V, 3); version (V,) grows whenever a vertex gets other nodes (0: it never had any).
    """

    def __init__(self, count: int) -> None:
        self.irradiance = np.zeros((count, 3), np.float32)
        self.version = np.zeros(count, np.int64)
        self.blocks: dict[int, NodeBlock] = {}
        self._owner = np.full(count, NO_BLOCK, np.int32)
        self._next = 0
        self._newest = 0

    def __len__(self) -> int:
        return len(self.version)

    @property
    def newest(self) -> int:
        """The newest version."""
        return self._newest

    def resized(self, count: int) -> NodeTable:
        """An empty table for another number of vertices, with versions that go on from here."""
        made = NodeTable(count)
        made._newest, made._next = self._newest, self._next
        return made

    def renumbered(self, count: int, to: I64) -> NodeTable:
        """For another numbering of the vertices: `to` (V,) is where each has gone, -1: it is no more."""
        made = self.resized(count)
        kept = np.flatnonzero(to >= 0)
        for name in ("irradiance", "version", "_owner"):
            getattr(made, name)[to[kept]] = getattr(self, name)[kept]
        made.blocks = {
            number: dataclasses.replace(block, points=np.where(block.points < 0, -1, to[block.points]))
            for number, block in self.blocks.items()
        }
        return made

    @property
    def nbytes(self) -> int:
        """Of nodes and tables."""
        own = self.irradiance.nbytes + self.version.nbytes + self._owner.nbytes
        return own + sum(block.nbytes for block in self.blocks.values())

    @property
    def nodes(self) -> int:
        """How many nodes the vertices have together."""
        total = 0
        for number, block in self.blocks.items():
            mine = (block.points >= 0) & (self._owner[block.points] == number)
            total += int(np.diff(block.first)[mine].sum())
        return total

    @property
    def owned(self) -> Bools:
        """(V,) which vertices have a block, be it of no nodes."""
        return np.asarray(self._owner != NO_BLOCK)

    def numbered(self) -> list[tuple[int, NodeBlock]]:
        """All blocks with their numbers, in order."""
        return sorted(self.blocks.items())

    @property
    def owner(self) -> I32:
        """(V,) number of the block that has each vertex' nodes, or NO_BLOCK; do not change."""
        return self._owner

    def drop(self, points: Bools) -> None:
        """These vertices have no nodes any more."""
        points = points & (self._owner != NO_BLOCK)
        if points.any():
            self._newest += 1
            self.version[points] = self._newest
            self._owner[points] = NO_BLOCK

    def replace(self, blocks: Sequence[NodeBlock]) -> None:
        """Blocks that from now on have the nodes of their points; irradiance is the caller's."""
        self._newest += 1
        for block in blocks:
            self._owner[block.points] = self._next
            self.version[block.points] = self._newest
            self.blocks[self._next] = block
            self._next += 1
        used = set(np.unique(self._owner).tolist())
        self.blocks = {number: block for number, block in self.blocks.items() if number in used}

    def shade(
        self,
        mesh: ShadingPoints,
        shapes: Shapes,
        eye: F32,
        wanted: Bools,
        out: F32,
        workers: Workers,
        job: Job,
        tilts: F32 | None = None,
    ) -> int:
        """Adds to terms (V, T, 3) of the wanted vertices, as seen from `eye`; how many nodes were looked at.

        The eye is relative to the mesh's origin. `tilts` (V, FIELDS, T, 3) are added to as well.
        """
        leaning = (
            (_NO_TILT, out, _NO_TILTS) if tilts is None or shapes.tilt is None else (shapes.tilt, out, tilts)
        )
        numbered = self.numbered()
        looked, rows = np.zeros(len(numbered), np.int64), shapes.rows(mesh)

        def body(begin: int, stop: int) -> None:
            for index in range(begin, stop):
                number, block = numbered[index]
                looked[index] = node_terms(
                    number,
                    block.points,
                    block.first,
                    block.data,
                    self._owner,
                    wanted,
                    block.most,
                    mesh.positions,
                    mesh.normals,
                    mesh.tangents,
                    rows,
                    eye,
                    shapes.address,
                    shapes.terms,
                    shapes.offset,
                    shapes.data,
                    *leaning,
                )

        workers.run(len(numbered), _BLOCKS_A_CHUNK, body, job)
        return int(looked.sum())


def starts(counts: I64) -> I64:
    """Where each of so many begins, and where the last ends."""
    return np.concatenate([[0], np.cumsum(counts)]).astype(np.int64)
