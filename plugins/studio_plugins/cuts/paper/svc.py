"""Self-visibility cuts: section V.A.1, Ṽ_s(x, ω) = V_s(x, ω) · cosθ at the vertices of each object.

Rays in all directions above a vertex' horizon are traced against the vertex' own object alone; the leaves
hold V_s cosθ, and are clustered (`height_cuts.cut_of_leaves`). A cut belongs to a vertex, a rotation and a
scale: it moves along when its object is translated, and instances that are turned alike share it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from studio_core.jit import kernel
from studio_core.kernels.directions import DirectionSet
from studio_core.kernels.raycast import CasterPart
from studio_core.kernels.visibility import trace_points
from studio_core.parallel import Checkpoints, Workers
from studio_plugins.cuts.paper.height_cuts import cut_of_leaves, put_heights, put_values
from studio_plugins.cuts.paper.records import Records

U8 = npt.NDArray[np.uint8]
U64 = npt.NDArray[np.uint64]
I32 = npt.NDArray[np.int32]
I64 = npt.NDArray[np.int64]
F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]

CHUNK = 32  # vertices: a checkpoint every 20 milliseconds or so


@dataclass(frozen=True)
class OwnFrame:
    """The directions and their packets' cones as an object's own frame sees them."""

    directions: F32
    axes: F32
    sines: F32

    @staticmethod
    def of(part: CasterPart, directions: DirectionSet) -> OwnFrame:
        """Turned as the part is."""
        turn = (part.from_world[:, :3] / part.scale).T
        axes, sines = directions.packet_cones
        return OwnFrame(_turned(directions.directions, turn), _turned(axes, turn), sines)


def _turned(vectors: F32, turn: F64) -> F32:
    return np.ascontiguousarray(vectors.astype(np.float64) @ turn, np.float32)


@kernel
def cut_vertices(
    words: U64,
    normals: F32,
    directions: F32,
    k: int,
    threshold: np.float32,
    data: U8,
    lengths: I64,
    counts: I32,
) -> tuple[int, int]:
    """Writes the cuts of V_s cosθ of vertices (n,); returns bytes written and nodes that are leaves."""
    size = len(directions)
    leaves = np.empty(size, np.float32)
    means, spreads = np.empty(2 * size, np.float32), np.empty(2 * size, np.float32)
    heights, values = np.empty(size, np.uint8), np.empty(size, np.float32)
    at, at_leaves = 0, 0
    for row in range(len(words)):
        x, y, z = normals[row, 0], normals[row, 1], normals[row, 2]
        for word in range(size >> 6):
            bits = words[row, word]
            for lane in range(64):
                j = (word << 6) + lane
                cosine = x * directions[j, 0] + y * directions[j, 1] + z * directions[j, 2]
                seen = (bits >> np.uint64(lane)) & np.uint64(1)
                leaves[j] = min(max(cosine, np.float32(0)), np.float32(1)) if seen else np.float32(0)
        count = cut_of_leaves(leaves, k, threshold, means, spreads, heights, values)
        for node in range(count):
            at_leaves += 1 if heights[node] == 0 else 0
        end = put_values(values, count, data, put_heights(heights, count, data, at))
        lengths[row], counts[row] = end - at, count
        at = end
    return at, at_leaves


class SelfVisibility:
    """The self-visibility cuts of one mesh in one rotation and scale; they are traced when asked for."""

    def __init__(self, vertices: int) -> None:
        self.slots: I32 = np.full(vertices, -1, np.int32)
        """(V,) number of each vertex' record, −1 where it was never asked for."""
        self.records = Records()
        self.rays = 0

    def trace(
        self,
        rows: I64,
        origins: F64,
        normals: F64,
        part: CasterPart,
        occluded8: int,
        directions: DirectionSet,
        threshold: float,
        workers: Workers,
        job: Checkpoints | None = None,
    ) -> None:
        """Makes the cuts of vertices `rows` of the mesh; ray origins and unit normals (n, 3) in the world.

        What is not finite sees nothing. Nothing is kept when it is cancelled.
        """
        frame = OwnFrame.of(part, directions)
        inward = part.from_world
        whole = np.isfinite(np.concatenate([origins, normals], axis=1)).all(axis=1, keepdims=True)
        origins, normals = np.where(whole, origins, 0.0), np.where(whole, normals, 0.0)
        starts = (origins @ inward[:, :3].T + inward[:, 3]).astype(np.float32)
        upward = (normals @ (inward[:, :3] / part.scale).T).astype(np.float32)
        done: dict[int, tuple[I64, I32, int, U8, int]] = {}
        most = directions.size * 5 // 2 + 2

        def body(start: int, stop: int) -> None:
            count = stop - start
            words = np.full((count, directions.size // 64), np.uint64(0xFFFFFFFFFFFFFFFF), np.uint64)
            rays = np.zeros((count, 2), np.int64)
            if part.scene:
                trace_points(
                    occluded8,
                    part.scene,
                    starts[start:stop],
                    upward[start:stop],
                    frame.directions,
                    frame.axes,
                    frame.sines,
                    words,
                    rays,
                    0,
                    count,
                )
            data = np.empty(count * most, np.uint8)
            lengths, counts = np.empty(count, np.int64), np.empty(count, np.int32)
            used, leaves = cut_vertices(
                words,
                upward[start:stop],
                frame.directions,
                directions.k,
                np.float32(threshold),
                data,
                lengths,
                counts,
            )
            done[start] = lengths, counts, leaves, data[:used].copy(), int(rays[:, 0].sum())

        workers.run(len(rows), CHUNK, body, job)
        self.slots[rows] = self._keep([done[start] for start in sorted(done)])

    def _keep(self, made: Sequence[tuple[I64, I32, int, U8, int]]) -> I64:
        first = len(self.records)
        for lengths, counts, leaves, data, rays in made:
            self.records.append(lengths, counts, leaves, data)
            self.rays += rays
        return np.arange(first, len(self.records))

    @property
    def nbytes(self) -> int:
        """Bytes kept."""
        return self.records.nbytes + self.slots.nbytes
