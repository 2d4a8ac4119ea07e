"""Which rays a moved object may now stand in the way of.

First by reckoning, inside its bounding sphere, then by tracing against the object alone, in its own frame, no
farther than the ray reached before.
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
    local: bool,
    centre: F64,
    radius: float,
    epsilon: float,
    axes: F64,
    origin: F64,
    directions: F32,
    distance: U16,
    word: U32,
    marks: U8,
) -> int:
    """Marks the rays (N,) of a row that pass a sphere before they end; how many."""
    wx, wy, wz = centre[0] - origin[0], centre[1] - origin[1], centre[2] - origin[2]
    x = np.float32(axes[0, 0] * wx + axes[0, 1] * wy + axes[0, 2] * wz)
    y = np.float32(axes[1, 0] * wx + axes[1, 1] * wy + axes[1, 2] * wz)
    z = np.float32(axes[2, 0] * wx + axes[2, 1] * wy + axes[2, 2] * wz)
    if local and z + radius <= 0.0:  # below the horizon
        return 0
    outside = np.float32(wx * wx + wy * wy + wz * wz - radius * radius)
    found = 0
    for ray in range(len(directions)):
        if marks[ray] != KEEP:
            continue
        along = directions[ray, 0] * x + directions[ray, 1] * y + directions[ray, 2] * z
        depth = along * along - outside
        if outside > 0 and (depth < 0 or along < 0):
            continue
        reach = half_value(distance[ray], word) * _ROOM + np.float32(epsilon)
        if outside > 0 and along > reach and (along - reach) * (along - reach) > depth:
            continue
        marks[ray] = ASK
        found += 1
    return found


@kernel
def answer(
    occluded8: int,
    scene: int,
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
    marks: U8,
) -> None:
    """Traces the rays in question against one object: those that it stops are to be traced."""
    rays = directions.shape[1]
    column_of, ray_of = np.empty(8, np.int64), np.empty(8, np.int64)
    starts = np.empty((count, 3))
    for column in range(count):
        for axis in range(3):
            m = from_mesh[axis]
            o = origin[column]
            starts[column, axis] = m[0] * o[0] + m[1] * o[1] + m[2] * o[2] + m[3]
    used = 0
    for column in range(count + 1):
        last = column == count
        for ray in range(1 if last else rays):
            if not last:
                if marks[column, ray] != ASK:
                    continue
                row = which[first + column]
                d = directions[variant[row], ray]
                t = axes[column]
                dx = t[0, 0] * d[0] + t[1, 0] * d[1] + t[2, 0] * d[2]
                dy = t[0, 1] * d[0] + t[1, 1] * d[1] + t[2, 1] * d[2]
                dz = t[0, 2] * d[0] + t[1, 2] * d[1] + t[2, 2] * d[2]
                for axis in range(3):
                    m = from_mesh[axis]
                    packet[ORIGIN + axis, used] = starts[column, axis]
                    packet[DIRECTION + axis, used] = m[0] * dx + m[1] * dy + m[2] * dz
                packet[TFAR, used] = half_value(distance[row, ray], word) * _ROOM + np.float32(epsilon)
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
