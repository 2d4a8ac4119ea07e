"""Irradiance and nodes of vertices, kept while their visibility and the light stay as they are."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import numpy.typing as npt

from studio_core.kernels.light_tree import LightTree
from studio_core.parallel import Workers
from studio_core.scene.world_mesh import WorldMesh
from studio_core.shading.artifacts import Shapes
from studio_core.shading.job import Job
from studio_plugins.cuts.gather import MOST_NODES, gather_light, prefix_table
from studio_plugins.cuts.nodes import FLOATS, NodeBlock
from studio_plugins.cuts.shade import node_terms
from studio_plugins.cuts.store import VisibilityStore

F32 = npt.NDArray[np.float32]
I32 = npt.NDArray[np.int32]
I64 = npt.NDArray[np.int64]
Bools = npt.NDArray[np.bool_]

CHUNK = 128
NO_BLOCK = -1


@dataclasses.dataclass
class Gathered:
    """What is kept for V vertices.

    stamp (V,) is that of the record the light was summed from (0: none), glossy (V,) whether nodes were
    made, owner (V,) the number of the block that holds its nodes.
    """

    irradiance: F32
    stamp: I64
    glossy: Bools
    owner: I32
    blocks: dict[int, NodeBlock] = dataclasses.field(default_factory=dict)
    next_block: int = 0

    @staticmethod
    def blank(count: int) -> Gathered:
        """Nothing yet."""
        return Gathered(
            np.zeros((count, 3), np.float32),
            np.zeros(count, np.int64),
            np.zeros(count, np.bool_),
            np.full(count, NO_BLOCK, np.int32),
        )

    @property
    def nbytes(self) -> int:
        """Of nodes and tables."""
        own = self.irradiance.nbytes + self.stamp.nbytes + self.glossy.nbytes + self.owner.nbytes
        return own + sum(block.nbytes for block in self.blocks.values())

    def add(self, block: NodeBlock) -> None:
        """Another block, which from now on has the nodes of its points."""
        self.owner[block.points] = self.next_block
        self.blocks[self.next_block] = block
        self.next_block += 1

    def tidy(self) -> None:
        """Drops blocks that own nothing any more."""
        used = set(np.unique(self.owner).tolist())
        self.blocks = {number: block for number, block in self.blocks.items() if number in used}


class LightCache:
    """Sums the light of one environment over the records of a store; owned by the compute thread."""

    def __init__(self, workers: Workers) -> None:
        self.kept = Gathered.blank(0)
        self.gathered = 0
        self.nodes_looked_at = 0
        self._workers = workers
        self._light: tuple[Any, float] | None = None
        self._prefix: npt.NDArray[np.float64] | None = None

    def follow(self, count: int, tree: LightTree | None, tolerance: float) -> None:
        """Turn to so many vertices and this light; forgets what was summed under another."""
        if self._light is None or self._light[0] is not tree or self._light[1] != tolerance:
            self.kept = Gathered.blank(count)
            self._light = tree, tolerance
            self._prefix = prefix_table(tree) if tree is not None else None
        if count != len(self.kept.stamp):
            self.kept = Gathered.blank(count)

    def gather(self, store: VisibilityStore, mesh: WorldMesh, points: I64, glossy: Bools, job: Job) -> None:
        """Sums the light of those of the points whose record is another one, or that need nodes now.

        glossy (V,) says which vertices need nodes.
        """
        kept, prefix = self.kept, self._prefix
        if prefix is None:
            return
        start, length, stamp = store.sources()
        fresh = (kept.stamp[points] == stamp[points]) & (kept.glossy[points] | ~glossy[points])
        todo = points[~fresh]
        if not len(todo):
            return
        assert self._light is not None
        tolerance = self._light[1]
        floor = self._floor()
        found: dict[int, list[NodeBlock]] = {}

        def body(begin: int, stop: int) -> None:
            mine = []
            while begin < stop:
                out = np.empty(FLOATS * (MOST_NODES + 384 * (stop - begin)), np.float32)
                nodes = np.zeros(len(todo), np.int64) if False else counts
                done = gather_light(
                    begin,
                    stop,
                    todo,
                    mesh.normals,
                    glossy,
                    store.alive,
                    store.pool,
                    start,
                    length,
                    prefix,
                    tolerance,
                    floor,
                    kept.irradiance,
                    out,
                    nodes,
                )
                first = np.concatenate([[0], np.cumsum(counts[begin : begin + done])]).astype(np.int64)
                data = out[: FLOATS * int(first[-1])].copy()
                mine.append(NodeBlock(todo[begin : begin + done], first, data))
                begin += done
            found[begin] = mine

        counts = np.zeros(len(todo), np.int64)
        self._workers.run(len(todo), CHUNK, body, job)
        for number in sorted(found):
            for block in found[number]:
                kept.add(block)
        kept.stamp[todo] = stamp[todo]
        kept.glossy[todo] = glossy[todo]
        kept.tidy()
        self.gathered += len(todo)

    def _floor(self) -> float:
        """Irradiance below which nodes need not be finer: a share of what an open place gets."""
        assert self._prefix is not None
        luminance = np.array([0.2126, 0.7152, 0.0722])
        return 0.02 * float(self._prefix[-1, :3] @ luminance) / 4

    def shade(
        self, mesh: WorldMesh, shapes: Shapes, eye: F32, wanted: Bools, out_terms: F32, job: Job
    ) -> int:
        """Sets terms (V, T, 3) of the wanted vertices; how many nodes were looked at."""
        kept = self.kept
        numbers = sorted(kept.blocks)
        blocks = [kept.blocks[number] for number in numbers]
        looked = np.zeros(len(blocks), np.int64)

        def body(begin: int, stop: int) -> None:
            for index in range(begin, stop):
                block = blocks[index]
                most = int(np.diff(block.first).max(initial=1))
                looked[index] = node_terms(
                    0,
                    len(block.points),
                    numbers[index],
                    block.points,
                    block.first,
                    block.data,
                    kept.owner,
                    wanted,
                    most,
                    mesh.positions,
                    mesh.normals,
                    mesh.material,
                    eye,
                    shapes.address,
                    shapes.terms,
                    shapes.offset,
                    shapes.data,
                    out_terms,
                )

        self._workers.run(len(blocks), 4, body, job)
        return int(looked.sum())
