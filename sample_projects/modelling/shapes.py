"""Shapes that furniture is made of: rounded boxes, turned parts, swept bars, pillows, leaves.

All are in metres and face outwards; everything but `leaf`, `plane` and a `sweep` without caps is closed.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from .mesh import Array, Indices, Mesh, Point, facing, grid_faces, smoothed, unit


def rounded_box(
    size: Point,
    radius: float | Point,
    flat: int | tuple[int, int, int] = 4,
    arc: int = 2,
) -> Mesh:
    """A box centred at the origin whose edges are rounded by quarter (elliptic) arcs, exact normals.

    `flat` is the number of cells along each straight part, `arc` half the cells around each edge.
    """
    radii = np.array(radius if isinstance(radius, tuple) else (radius,) * 3, dtype=np.float64)
    half = np.array(size, dtype=np.float64) / 2
    radii = np.minimum(radii, half * 0.999)
    cells = flat if isinstance(flat, tuple) else (flat,) * 3
    bow = np.tan(np.linspace(math.pi / 4, 0, arc + 1))  # from the edge's middle to the flat part
    cores, bows = [], []
    for axis in range(3):
        core = np.linspace(-1, 1, cells[axis] + 1) * (half[axis] - radii[axis])
        cores.append(np.concatenate([np.full(arc, core[0]), core, np.full(arc, core[-1])]))
        bows.append(np.concatenate([-bow[:-1], np.zeros(cells[axis] + 1), bow[-2::-1]]))
    counts = [len(c) for c in cores]
    lattice = np.stack(np.meshgrid(*(np.arange(n) for n in counts), indexing="ij"), -1).reshape(-1, 3)
    on = ((lattice == 0) | (lattice == np.array(counts) - 1)).any(axis=1)
    number = np.full(len(lattice), -1, np.int64)
    number[on] = np.arange(on.sum())
    lattice = lattice[on]
    core = np.stack([cores[k][lattice[:, k]] for k in range(3)], 1)
    outward = unit(np.stack([bows[k][lattice[:, k]] for k in range(3)], 1))
    number = number.reshape(counts)
    faces = []
    for axis in range(3):
        for side in (0, -1):
            sheet = np.take(number, side, axis=axis)
            faces.append(sheet.ravel()[grid_faces(*sheet.shape)])
    return facing(core + radii * outward, outward / radii, np.concatenate(faces))


def box(size: Point) -> Mesh:
    """A box with sharp edges, centred at the origin."""
    points: list[Array] = []
    normals: list[Array] = []
    faces: list[Indices] = []
    for axis in range(3):
        u, v = (k for k in range(3) if k != axis)
        for side in (-1.0, 1.0):
            quad = np.zeros((4, 3))
            quad[:, axis] = side
            quad[:, u], quad[:, v] = (-1, 1, 1, -1), (-1, -1, 1, 1)
            first = 4 * len(points)
            points.append(quad * np.array(size) / 2)
            normals.append(np.tile(np.eye(3)[axis] * side, (4, 1)))
            faces.append(np.array([[0, 1, 2], [0, 2, 3]]) + first)
    return facing(np.concatenate(points), np.concatenate(normals), np.concatenate(faces))


def lathe(profile: Sequence[npt.ArrayLike], segments: int = 24) -> Mesh:
    """The solid of revolution about y of a profile (radius, height), listed bottom to top outside.

    `profile` is one or more smooth pieces, each starting where the last one ended; between pieces is a
    hard edge. Walking along it, the outside is on the right hand. Ends on the axis (radius 0) are closed.
    """
    angles = np.linspace(0, 2 * math.pi, segments, endpoint=False)
    ring = np.stack([np.cos(angles), np.zeros(segments), -np.sin(angles)], 1)
    points: list[Array] = []
    normals: list[Array] = []
    faces: list[Indices] = []
    uvs: list[Array] = []
    first = 0
    for piece in profile:
        line = np.asarray(piece, dtype=np.float64)
        steps = unit(np.diff(line, axis=0))
        along = np.concatenate([steps[:1], steps]) + np.concatenate([steps, steps[-1:]])
        out = unit(np.stack([along[:, 1], -along[:, 0]], 1))
        on_axis = line[:, 0] < 1e-9
        out[on_axis, 0] = 0
        out = unit(out)
        grid_points, grid_normals = _revolved(line, ring), _revolved(out, ring)
        index = np.arange(line.shape[0] * segments).reshape(-1, segments)
        index[on_axis] = index[on_axis, :1]  # one vertex a pole
        used, compact = np.unique(index, return_inverse=True)
        rows, columns = index.shape
        points.append(grid_points[used])
        normals.append(grid_normals[used])
        v = np.linspace(0, 1, len(line))
        uvs.append(np.stack([used % segments / segments, v[used // segments]], 1))
        faces.append(compact.ravel()[grid_faces(rows, columns, wrap=True)] + first)
        first += len(used)
    return facing(*(np.concatenate(part) for part in (points, normals, faces, uvs)))  # type: ignore[arg-type]


def _revolved(line: Array, ring: Array) -> Array:
    turned = line[:, None, :1] * ring[None]
    turned[..., 1] += line[:, None, 1]
    return np.asarray(turned.reshape(-1, 3))


def circle(count: int, width: float = 2.0, height: float = 2.0) -> Array:
    """A closed outline (count, 2), counterclockwise: an ellipse of these diameters."""
    angles = np.linspace(0, 2 * math.pi, count, endpoint=False)
    return np.stack([np.cos(angles) * width / 2, np.sin(angles) * height / 2], 1)


def rounded_rectangle(width: float, height: float, radius: float, arc: int = 2) -> Array:
    """A closed outline (n, 2), counterclockwise, with `arc` cells a corner."""
    corner = np.linspace(0, math.pi / 2, arc + 1)
    made = []
    for quarter, (x, y) in enumerate(((1, 1), (-1, 1), (-1, -1), (1, -1))):
        angles = corner + quarter * math.pi / 2
        centre = np.array([x * (width / 2 - radius), y * (height / 2 - radius)])
        made.append(centre + radius * np.stack([np.cos(angles), np.sin(angles)], 1))
    return np.concatenate(made)


def sweep(
    path: npt.ArrayLike,
    section: Array,
    scale: npt.ArrayLike = 1.0,
    up: Point = (0.0, 1.0, 0.0),
    round_ends: bool = True,
    closed: bool = False,
) -> Mesh:
    """A bar with the outline `section` (m, 2) along `path` (n, 3); `scale` is a number or (n,).

    The section's second axis starts near `up` and is carried along without twist (double reflection,
    Wang et al. 2008). Ends are rounded off and closed unless the path is `closed`.
    """
    line = np.asarray(path, dtype=np.float64)
    scales = np.broadcast_to(np.asarray(scale, dtype=np.float64), (len(line),)).copy()
    if closed:
        tangents = unit(np.roll(line, -1, axis=0) - np.roll(line, 1, axis=0))
    else:
        tangents = unit(np.gradient(line, axis=0))
        if round_ends:
            line, tangents, scales = _with_round_ends(line, tangents, scales, section)
    frame = _carried(line, tangents, np.array(up, dtype=np.float64))
    side = np.cross(frame, tangents)
    count, around = len(line), len(section)
    offsets = section[None, :, :1] * side[:, None] + section[None, :, 1:] * frame[:, None]
    points = line[:, None] + offsets * scales[:, None, None]
    if closed:
        faces = grid_faces(count, around, wrap=True)
        here, there = np.arange(around), (np.arange(around) + 1) % around
        end = (count - 1) * around
        seam = np.stack([end + here, end + there, there, end + here, there, here], 1)
        faces = np.concatenate([faces, seam.reshape(-1, 3)])
        flat_points = points.reshape(-1, 3)
        outward = (offsets / np.linalg.norm(offsets, axis=2, keepdims=True)).reshape(-1, 3)
        return smoothed(facing(flat_points, outward, faces))
    # The vertices of the shaft ring by ring, then the two caps: a rim (where it is sharp) and a pole each.
    shaft = points.reshape(-1, 3)
    rims = np.array([0, (count - 1) * around])[:, None] + np.arange(around)
    if not round_ends:
        rims = count * around + np.arange(2)[:, None] * (around + 1) + np.arange(around)
        caps = [points[0], line[:1], points[-1], line[-1:]]
        poles = rims[:, -1] + 1
    else:
        caps = [line[:1], line[-1:]]
        poles = count * around + np.arange(2)
    flat_points = np.concatenate([shaft, *caps])
    fans = [
        np.stack([np.full(around, pole), np.roll(rim, -1), rim], 1)
        for pole, rim in zip(poles, rims, strict=True)
    ]
    faces = np.concatenate([grid_faces(count, around, wrap=True), *fans])
    per_cap = len(flat_points) // 2 - len(shaft) // 2
    ends = np.repeat(np.stack([-tangents[0], tangents[-1]]), per_cap, axis=0)
    outward = np.concatenate([unit(offsets.reshape(-1, 3) + 1e-12), ends])
    return smoothed(facing(flat_points, outward, faces))


def _with_round_ends(
    line: Array, tangents: Array, scales: Array, section: Array
) -> tuple[Array, Array, Array]:
    reach = np.abs(section).max(axis=0).min()
    angles = np.array([0.15, 0.5, 0.8]) * math.pi / 2
    out, shrink = np.sin(angles)[::-1] * reach, np.cos(angles)[::-1]
    head = line[0] - tangents[0] * (out * scales[0])[:, None]
    tail = line[-1] + tangents[-1] * (out[::-1] * scales[-1])[:, None]
    return (
        np.concatenate([head, line, tail]),
        np.concatenate([np.repeat(tangents[:1], 3, 0), tangents, np.repeat(tangents[-1:], 3, 0)]),
        np.concatenate([shrink * scales[0], scales, shrink[::-1] * scales[-1]]),
    )


def _carried(line: Array, tangents: Array, up: Array) -> Array:
    start = up - tangents[0] * (up @ tangents[0])
    if np.linalg.norm(start) < 1e-6:
        spare = np.array([1.0, 0.0, 0.0]) if abs(tangents[0][0]) < 0.9 else np.array([0.0, 0.0, 1.0])
        start = spare - tangents[0] * (spare @ tangents[0])
    frame = [start / np.linalg.norm(start)]
    for k in range(len(line) - 1):
        step = line[k + 1] - line[k]
        square = float(step @ step)
        reflected = frame[k] - 2 / square * (step @ frame[k]) * step
        tangent = tangents[k] - 2 / square * (step @ tangents[k]) * step
        turn = tangents[k + 1] - tangent
        square = float(turn @ turn)
        if square > 1e-18:
            reflected = reflected - 2 / square * (turn @ reflected) * turn
        frame.append(reflected)
    return np.array(frame)


def pillow(width: float, height: float, thickness: float, cells: int = 10, pinch: float = 0.07) -> Mesh:
    """A stuffed pillow in the xy plane: two bulging sheets sewn along slightly hollow sides."""
    s = np.sin(np.linspace(-math.pi / 2, math.pi / 2, cells + 1))
    u, v = np.meshgrid(s, s, indexing="ij")
    x = width / 2 * u * (1 - pinch * (1 - v * v))
    y = height / 2 * v * (1 - pinch * (1 - u * u))
    bulge = thickness / 2 * ((1 - u * u) * (1 - v * v)) ** 0.42
    front = np.stack([x, y, bulge], -1).reshape(-1, 3)
    back = front * np.array([1.0, 1.0, -0.9])
    rim = np.isclose(np.maximum(np.abs(u), np.abs(v)).ravel(), 1.0)
    count = len(front)
    number = np.where(rim, np.arange(count), count + np.cumsum(~rim) - 1)
    points = np.concatenate([front, back[~rim]])
    sheet = grid_faces(cells + 1, cells + 1, radial=True)
    faces = np.concatenate([sheet, number[sheet][:, ::-1]])
    hint = np.concatenate([front * 0 + [0, 0, 1.0], back[~rim] * 0 + [0, 0, -1.0]])
    hint[:count][rim] = unit(front[rim] + 1e-9) * 1e-3
    return smoothed(facing(points, hint, faces))


def leaf(length: float, width: float, droop: float, fold: float, cells: int = 8, across: int = 4) -> Mesh:
    """An open leaf along +x from the origin, +y up: widest before its middle, folded and drooping."""
    t = np.linspace(0, 1, cells + 1)
    s = np.linspace(-1, 1, across + 1)
    tt, ss = np.meshgrid(t, s, indexing="ij")
    breadth = np.sin(math.pi * np.clip(tt, 0.004, 0.996) ** 0.8) ** 0.75 * width / 2
    bend = droop * tt
    x = length * (tt - 0.16 * bend**2 * tt)
    y = length * (-0.5 * bend * tt) + fold * np.abs(ss) ** 1.5 * breadth
    points = np.stack([x, y, ss * breadth], -1).reshape(-1, 3)
    faces = grid_faces(cells + 1, across + 1)
    return smoothed(facing(points, np.tile([0.0, 1.0, 0.0], (len(points), 1)), faces))


def plane(width: float, depth: float, cells: tuple[int, int] = (1, 1)) -> Mesh:
    """An open rectangle in y = 0, facing up, centred; uvs are metres."""
    x, z = np.meshgrid(
        np.linspace(-width / 2, width / 2, cells[0] + 1),
        np.linspace(depth / 2, -depth / 2, cells[1] + 1),
        indexing="ij",
    )
    points = np.stack([x, np.zeros_like(x), z], -1).reshape(-1, 3)
    uvs = np.stack([x + width / 2, depth / 2 - z], -1).reshape(-1, 2)
    faces = grid_faces(cells[0] + 1, cells[1] + 1)
    return facing(points, np.tile([0.0, 1.0, 0.0], (len(points), 1)), faces, uvs)


def leg(top: Point, foot: Point, thick: float, thin: float, around: int = 8, rings: int = 5) -> Mesh:
    """A round leg from `top` to `foot`, tapering from diameter `thick` to `thin`, level at both ends."""
    t = np.linspace(0, 1, rings)[:, None]
    path = np.array(top) * (1 - t) + np.array(foot) * t
    scale = np.interp(t[:, 0], [0, 0.2, 1], [thick, thick, thin])
    made = sweep(path, circle(around, 1.0, 1.0), scale, up=(0.0, 0.0, 1.0), round_ends=False)
    level, normals = made.positions.copy(), made.normals.copy()
    cap = around + 1
    for height, rim, end, up in (
        (top[1], slice(0, around), slice(-2 * cap, -cap), 1.0),
        (foot[1], slice(-2 * cap - around, -2 * cap), slice(-cap, None), -1.0),
    ):
        level[rim, 1] = level[end, 1] = height
        normals[end] = (0.0, up, 0.0)
    return replace(made, positions=level, normals=normals)
