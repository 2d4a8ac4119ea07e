"""What of a room is solid, straight from its numbers; and where a mesh says so itself."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from studio_core.scene.room_shape import BAR, BAR_DEPTH, LEAF, PROUD, SASH, SLAB, RoomShape

F64 = npt.NDArray[np.float64]


def inside(points: F64, polygon: F64) -> npt.NDArray[np.bool_]:
    """Whether points (N, 2) lie in a polygon, by the crossings of a ray."""
    found = np.zeros(len(points), bool)
    for a, b in zip(polygon, np.roll(polygon, -1, axis=0), strict=True):
        straddles = (a[1] > points[:, 1]) != (b[1] > points[:, 1])
        rise = b[1] - a[1] if b[1] != a[1] else 1.0
        found ^= straddles & (points[:, 0] < a[0] + (points[:, 1] - a[1]) / rise * (b[0] - a[0]))
    return found


def solid(shape: RoomShape, points: F64) -> npt.NDArray[np.bool_]:
    """Whether points (N, 3) are in floor, ceiling, wall, frame, leaf or skirting."""
    plan = np.array(shape.corners)
    flat, y = points[:, [0, 2]], points[:, 1]
    in_outer, in_inner = inside(flat, shape.rim(shape.thickness)), inside(flat, plan)
    covered = in_outer | in_inner
    found = covered & (y > -SLAB) & (y < 0)
    if shape.ceiling:
        found |= covered & (shape.height < y) & (y < shape.height + SLAB)
    wall = in_outer & ~in_inner & (y > 0) & (y < shape.height)
    board = np.zeros(len(points), bool)
    if shape.baseboard:
        board = in_inner & ~inside(flat, shape.rim(-PROUD)) & (y > 0) & (y < shape.baseboard)
    for one in shape.placed():
        a, b = plan[one.wall], plan[(one.wall + 1) % len(plan)]
        way = (b - a) / np.hypot(*(b - a))
        along, out = (flat - a) @ way, (flat - a) @ np.array([way[1], -way[0]])
        within = (one.start < along) & (along < one.end) & (out > -PROUD) & (out < shape.thickness)
        hole = within & (out > 0) & (one.low < y) & (y < one.high)
        if one.kind != "opening":
            depth = min(BAR_DEPTH if one.kind == "window" else LEAF, shape.thickness / 2)
            kept = np.abs(out - shape.thickness / 2) < depth / 2
            if one.kind == "window":
                bar = min(BAR, (one.end - one.start) / 6, (one.high - one.low) / 6)
                sashes = max(1, round((one.end - one.start) / SASH))
                step = (one.end - one.start - bar) / sashes
                kept &= ((along - one.start) % step < bar) | (y < one.low + bar) | (y > one.high - bar)
            hole &= ~kept
        wall &= ~hole
        if one.low < shape.baseboard:
            board &= ~(within & (out < 0))
    return np.asarray(found | wall | board)


def winding(positions: F64, faces: npt.NDArray[np.int64], points: F64) -> F64:
    """How often a closed mesh goes round each point: 1 in a solid, 0 outside (van Oosterom and Strackee)."""
    total = np.zeros(len(points))
    for face in faces:
        a, b, c = (positions[k] - points for k in face)
        la, lb, lc = (np.linalg.norm(v, axis=1) for v in (a, b, c))
        triple = np.einsum("ij,ij->i", a, np.cross(b, c))
        below = la * lb * lc + np.einsum("ij,ij->i", a, b) * lc
        below += np.einsum("ij,ij->i", b, c) * la + np.einsum("ij,ij->i", c, a) * lb
        total += 2 * np.arctan2(triple, below)
    return total / (4 * np.pi)
