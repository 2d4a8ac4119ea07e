"""Which rays a moved object may now stand in the way of.

First by reckoning, inside its bounding sphere, then by tracing against the object alone, in its own frame, no
farther than the ray reached before. Kernels here index whole arrays: a view would be counted, by all threads
in one place.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from studio_core.jit import call_address, kernel
from studio_core.kernels.packets import DIRECTION, ORIGIN, TFAR
from studio_core.transport.hits import half_value

F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]
I32 = npt.NDArray[np.int32]
I64 = npt.NDArray[np.int64]
U8 = npt.NDArray[np.uint8]
U16 = npt.NDArray[np.uint16]
U32 = npt.NDArray[np.uint32]

KEEP, ASK, TRACE = 0, 1, 2
"""Marks of rays: as they were, in question, to be traced against the scene."""
_ROOM = np.float32(1.001)
"""Distances kept in float16 are off by 1/2048 at most."""


@kernel
def ask(
    row: int,
    column: int,
    local: bool,
    thing: int,
    centre: F64,
    radius: F64,
    epsilon: float,
    axes: F64,
    origin: F64,
    variant: I32,
    directions: F32,
    distance: U16,
    word: U32,
    number: F32,
    marks: U8,
) -> int:
    """Marks the rays of a row that pass an object's sphere before they end; how many."""
    wx = centre[thing, 0] - origin[column, 0]
    wy = centre[thing, 1] - origin[column, 1]
    wz = centre[thing, 2] - origin[column, 2]
    x = np.float32(axes[column, 0, 0] * wx + axes[column, 0, 1] * wy + axes[column, 0, 2] * wz)
    y = np.float32(axes[column, 1, 0] * wx + axes[column, 1, 1] * wy + axes[column, 1, 2] * wz)
    z = np.float32(axes[column, 2, 0] * wx + axes[column, 2, 1] * wy + axes[column, 2, 2] * wz)
    if local and z + radius[thing] <= 0.0:  # below the horizon
        return 0
    outside = np.float32(wx * wx + wy * wy + wz * wz - radius[thing] * radius[thing])
    found = 0
    p = variant[row]
    for ray in range(directions.shape[1]):
        along = directions[p, ray, 0] * x + directions[p, ray, 1] * y + directions[p, ray, 2] * z
        depth = along * along - outside
        if (outside > 0 and (depth < 0 or along < 0)) or marks[column, ray] != KEEP:
            continue
        reach = half_value(distance[row, ray], word, number) * _ROOM + np.float32(epsilon)
        if outside > 0 and along > reach and (along - reach) * (along - reach) > depth:
            continue
        marks[column, ray] = ASK
        found += 1
    return found


@kernel
def answer(
    occluded8: int,
    scene: int,
    thing: int,
    from_mesh: F64,
    first: int,
    count: int,
    which: I64,
    axes: F64,
    origin: F64,
    variant: I32,
    directions: F32,
    distance: U16,
    epsilon: float,
    packet: F32,
    valid: I32,
    word: U32,
    number: F32,
    marks: U8,
) -> None:
    """Traces the rays in question against one object: those that it stops are to be traced."""
    rays = directions.shape[1]
    column_of, ray_of = np.empty(8, np.int64), np.empty(8, np.int64)
    m = from_mesh[thing].copy()
    used = 0
    for column in range(count + 1):
        last = column == count
        for ray in range(1 if last else rays):
            if not last:
                if marks[column, ray] != ASK:
                    continue
                row = which[first + column]
                p = variant[row]
                x, y, z = directions[p, ray, 0], directions[p, ray, 1], directions[p, ray, 2]
                dx = axes[column, 0, 0] * x + axes[column, 1, 0] * y + axes[column, 2, 0] * z
                dy = axes[column, 0, 1] * x + axes[column, 1, 1] * y + axes[column, 2, 1] * z
                dz = axes[column, 0, 2] * x + axes[column, 1, 2] * y + axes[column, 2, 2] * z
                ox, oy, oz = origin[column, 0], origin[column, 1], origin[column, 2]
                for axis in range(3):
                    packet[ORIGIN + axis, used] = (
                        m[axis, 0] * ox + m[axis, 1] * oy + m[axis, 2] * oz + m[axis, 3]
                    )
                    packet[DIRECTION + axis, used] = m[axis, 0] * dx + m[axis, 1] * dy + m[axis, 2] * dz
                packet[TFAR, used] = half_value(distance[row, ray], word, number) * _ROOM + np.float32(
                    epsilon
                )
                valid[used] = -1
                column_of[used], ray_of[used] = column, ray
                used += 1
            if used == 8 or (last and used > 0):
                for lane in range(used, 8):
                    valid[lane] = 0
                call_address(occluded8, valid, scene, packet, 0)
                for lane in range(used):
                    marks[column_of[lane], ray_of[lane]] = TRACE if packet[TFAR, lane] < 0 else KEEP
                used = 0
