"""What tracing object by object starts from: directions in every object's frame, and the objects alone."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from studio_core.kernels.directions import DirectionSet, direction_set
from studio_core.kernels.raycast import RayCaster

F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]
I64 = npt.NDArray[np.int64]

BLOCKS = (4096, 512, 64, 8)
"""Sizes of the blocks of leaves that cones are put about."""


@dataclass(frozen=True, eq=False)
class Beams:
    """The 2^k directions as tracers want them, turned into the frames of objects.

    rows (R, S/8, 3, 8): packets of eight directions for each of R rotations, the first of which is none;
    axis (R, nodes, 3) of cones about blocks of 4096, 512, 64 and 8 leaves, one after the other; sine (nodes,)
    of their half angles; offset (4,) where each size starts.
    """

    k: int
    rows: F32
    axis: F32
    sine: F32
    offset: I64


def _blocks(directions: DirectionSet) -> tuple[F32, F32, I64]:
    """Axes and cosines of the cones about blocks of leaves, and where each size starts."""
    cones, size = directions.cones, directions.size
    rows, offsets, at = [], [], 0
    for block in BLOCKS:
        count = max(size // block, 1)
        offsets.append(at)
        rows.append(np.arange(count, 2 * count))
        at += count
    nodes = np.concatenate(rows)
    return cones.axis[nodes], cones.cos_half_angle[nodes], np.array(offsets, np.int64)


class BeamTable:
    """Keeps the directions turned for each rotation in use."""

    def __init__(self) -> None:
        self._k = 0
        self._row: dict[bytes, int] = {}
        self._rows = np.zeros((0, 0, 3, 8), np.float32)
        self._axes = np.zeros((0, 0, 3), np.float32)

    def __call__(self, k: int, rotations: F64) -> tuple[Beams, I64]:
        """Beams for the rotations world → object (n, 3, 3), and which row each object uses.

        Rows are changed in place by the next call.
        """
        directions = direction_set(k)
        axes, cosine, offset = _blocks(directions)
        turns = np.concatenate([np.eye(3)[None], np.asarray(rotations, np.float64).reshape(-1, 3, 3)])
        keys = [turn.tobytes() for turn in np.round(turns, 12) + 0.0]
        wanted = dict(zip(keys, turns, strict=True))
        if k != self._k or len(wanted) > len(self._rows):
            room = 2 * len(wanted)
            self._k, self._row = k, {}
            self._rows = np.empty((room, max(directions.size // 8, 1), 3, 8), np.float32)
            self._axes = np.empty((room, len(axes), 3), np.float32)
        self._row = {key: row for key, row in self._row.items() if key in wanted}
        free = sorted(set(range(1, len(self._rows))) - set(self._row.values()))
        for key, turn in wanted.items():
            if key not in self._row:
                row = 0 if key == keys[0] else free.pop()
                self._rows[row], self._axes[row] = _turned(directions.directions, axes, turn)
                self._row[key] = row
        sine = np.sqrt(np.maximum(1 - cosine.astype(np.float64) ** 2, 0)).astype(np.float32)
        sine = np.where(cosine < 0, np.float32(2), sine)  # over half a sphere is never skipped
        which = np.array([self._row[key] for key in keys[1:]], np.int64)
        return Beams(k, self._rows, self._axes, sine, offset), which


def _turned(directions: F32, axes: F32, rotation: F64) -> tuple[F32, F32]:
    turned = (directions.astype(np.float64) @ rotation.T).astype(np.float32)
    rows = np.ascontiguousarray(turned.reshape(-1, 8, 3).transpose(0, 2, 1))
    return rows, np.ascontiguousarray((axes.astype(np.float64) @ rotation.T).astype(np.float32))


@dataclass(frozen=True, eq=False)
class Parts:
    """All objects by themselves, as kernels want them.

    scene (n,) pointers (0: nothing to meet); from_mesh (n, 3, 4) affines from the mesh's coordinates into
    each object's frame about the middle of its box; turn (n, 3, 3) the same for directions; half (n, 3) and
    radius (n,) of box and sphere in that frame; epsilon lifts ray origins, in metres.
    """

    occluded8: int
    scene: I64
    from_mesh: F64
    turn: F64
    half: F64
    radius: F64
    epsilon: float


def parts_of(caster: RayCaster, origin: F64) -> Parts:
    """The parts of a caster for a mesh that is relative to `origin`."""
    parts = [caster.part(index) for index in range(len(caster))]
    from_mesh, turn = np.zeros((len(parts), 3, 4)), np.zeros((len(parts), 3, 3))
    for row, turned, part in zip(from_mesh, turn, parts, strict=True):
        row[:, :3] = part.from_world[:, :3]
        row[:, 3] = part.from_world[:, :3] @ origin + part.from_world[:, 3]
        turned[:] = part.from_world[:, :3] / part.scale
    return Parts(
        caster.handles().occluded8,
        np.array([part.scene for part in parts], np.int64),
        from_mesh,
        turn,
        np.array([part.half for part in parts], np.float64).reshape(-1, 3),
        np.array([part.radius * part.scale for part in parts], np.float64),
        caster.epsilon,
    )
