"""Cutting marked edges conformingly, for refinement where it is needed (Rivara's longest-edge patterns).

Rivara, Int. J. Numer. Meth. Eng. 20, 1984: within a face the longest edge is cut first; the remaining
quadrilateral gets its shorter diagonal.
"""

from __future__ import annotations

import dataclasses

import numpy as np

from studio_core.scene.normals import NONE, Fan
from studio_core.scene.topology import Bools, Floats, Ints, ranks

# Corners of a face turned so that edge 0 → 1 is the longest: 0, 1, 2 the corners, 3, 4, 5 the points on
# edges 0 → 1, 1 → 2, 2 → 0. For (1 → 2 cut, 2 → 0 cut, second diagonal): the triangles.
PATTERNS: dict[tuple[bool, bool, bool], tuple[tuple[int, int, int], ...]] = {
    (False, False, False): ((0, 3, 2), (3, 1, 2)),
    (False, False, True): ((0, 3, 2), (3, 1, 2)),
    (True, False, False): ((3, 1, 4), (0, 3, 2), (3, 4, 2)),
    (True, False, True): ((3, 1, 4), (0, 3, 4), (0, 4, 2)),
    (False, True, False): ((0, 3, 5), (3, 1, 2), (3, 2, 5)),
    (False, True, True): ((0, 3, 5), (3, 1, 5), (1, 2, 5)),
    (True, True, False): ((0, 3, 5), (3, 1, 4), (3, 4, 2), (3, 2, 5)),
    (True, True, True): ((0, 3, 5), (3, 1, 4), (3, 4, 5), (4, 2, 5)),
}


def lengths(points: Floats, corners: Ints) -> Floats:
    """(F, 3) length of the edge from corner k to corner k + 1; the same from either side, bit for bit."""
    ahead = np.roll(corners, -1, axis=1)
    way = points[np.maximum(corners, ahead)] - points[np.minimum(corners, ahead)]
    return np.asarray(np.sqrt((way * way).sum(axis=2)))


def longest(points: Floats, corners: Ints) -> Ints:
    """(F,) which edge is the longest; of equal ones the same edge in every face that has both."""
    length = lengths(points, corners)
    ahead = np.roll(corners, -1, axis=1)
    key = np.minimum(corners, ahead) * (int(corners.max(initial=0)) + 1) + np.maximum(corners, ahead)
    key = np.where(length == length.max(axis=1, keepdims=True), key, -1)
    return np.asarray(key.argmax(axis=1))


def split(mesh: Fan, cut: Bools, share: Floats) -> tuple[Fan, Ints]:
    """Every face with cut edges split. cut, share (F, 3): for edge k → k + 1, from its *lower* point.

    A cut face's longest edge must be cut. Children stand where their parent stood. Returns the mesh and,
    for each new vertex, the two ends (N, 2) it lies between; old vertices and points keep their numbers.
    """
    corners = mesh.weld[mesh.faces]
    active = np.flatnonzero(cut.any(axis=1))
    ahead = np.roll(corners, -1, axis=1)
    # Points on cut edges, one for each welded edge.
    face, side = np.nonzero(cut)
    low = np.minimum(corners[face, side], ahead[face, side])
    high = np.maximum(corners[face, side], ahead[face, side])
    first, number = ranks(low * (len(mesh.points) + 1) + high)
    part = share[face, side]
    start = mesh.points[low[first]]
    points = np.concatenate([mesh.points, start + part[first, None] * (mesh.points[high[first]] - start)])
    point = np.full(cut.shape, NONE, np.int64)
    point[face, side] = len(mesh.points) + number
    # Vertices on cut edges, one for each pair of vertices, front and back alike.
    rising = (corners < ahead)[face, side]
    tails = np.concatenate([mesh.faces[face, side], mesh.back[face, side]])
    heads = np.concatenate([mesh.faces[face, (side + 1) % 3], mesh.back[face, (side + 1) % 3]])
    rising, part, on = np.tile(rising, 2), np.tile(part, 2), np.tile(len(mesh.points) + number, 2)
    lower, upper = np.where(rising, tails, heads), np.where(rising, heads, tails)
    there = np.flatnonzero(tails != NONE)
    fresh, vertex = ranks(lower[there] * (len(mesh.weld) + 1) + upper[there])
    chosen = there[fresh]
    ends = np.stack([lower[chosen], upper[chosen]], axis=1)
    made = np.full(len(tails), NONE, np.int64)
    made[there] = len(mesh.weld) + vertex
    middle = np.full((2, *cut.shape), NONE, np.int64)
    middle[0, face, side], middle[1, face, side] = made[: len(face)], made[len(face) :]

    parent, codes = _children(points, corners[active], point[active])
    rows = active[parent]

    def child(corner: Ints, mid: Ints) -> Ints:
        return np.asarray(np.take_along_axis(np.concatenate([corner, mid], axis=1)[rows], codes, axis=1))

    kept = np.flatnonzero(~cut.any(axis=1))
    order = np.argsort(np.concatenate([kept, rows]), kind="stable")
    origin = np.concatenate([kept, rows])[order]
    made_mesh = dataclasses.replace(
        mesh,
        points=points,
        weld=np.concatenate([mesh.weld, on[chosen]]),
        normals=np.concatenate([mesh.normals, _unit_between(mesh.normals, ends, part[chosen])]),
        uvs=np.concatenate([mesh.uvs, _lerp(mesh.uvs, ends, part[chosen])]),
        slot=np.concatenate([mesh.slot, mesh.slot[ends[:, 0]]]),
        side=np.concatenate([mesh.side, mesh.side[ends[:, 0]]]),
        faces=np.concatenate([mesh.faces[kept], child(mesh.faces, middle[0])])[order],
        back=np.concatenate([mesh.back[kept], child(mesh.back, middle[1])])[order],
        source=mesh.source[origin],
        slots=mesh.slots[origin],
    )
    return made_mesh, ends


def _lerp(values: Floats, ends: Ints, share: Floats) -> Floats:
    start = values[ends[:, 0]]
    return np.asarray(start + share[:, None] * (values[ends[:, 1]] - start))


def _unit_between(normals: Floats, ends: Ints, share: Floats) -> Floats:
    made = _lerp(normals, ends, share)
    length = np.linalg.norm(made, axis=1, keepdims=True)
    return np.where(length > 1e-9, made / np.maximum(length, 1e-9), normals[ends[:, 0]])


def _children(points: Floats, corners: Ints, point: Ints) -> tuple[Ints, Ints]:
    """Parent row and corner codes (see PATTERNS) of the triangles that faces with cut edges become."""
    turn = longest(points, corners)
    place = (turn[:, None] + np.arange(3)) % 3
    six = np.concatenate(
        [np.take_along_axis(corners, place, axis=1), np.take_along_axis(point, place, axis=1)], axis=1
    )
    right, left = six[:, 4] != NONE, six[:, 5] != NONE

    def gap(a: Ints, b: Ints) -> Floats:
        way = points[a] - points[b]
        return np.asarray((way * way).sum(axis=1))

    # First diagonal 3-2; second 0-4, 1-5 or 4-5 by what is cut.
    a = np.where(right, np.where(left, six[:, 4], six[:, 0]), six[:, 1])
    b = np.where(right, np.where(left, six[:, 5], six[:, 4]), six[:, 5])
    second = gap(a, b) <= gap(six[:, 3], six[:, 2]) * (1 + 1e-9)
    parents: list[Ints] = []
    codes: list[Ints] = []
    for (is_right, is_left, is_second), triangles in PATTERNS.items():
        rows = np.flatnonzero((right == is_right) & (left == is_left) & (second == is_second))
        for triangle in triangles:
            local = np.array(triangle)
            parents.append(rows)
            codes.append((local % 3 + turn[rows, None]) % 3 + 3 * (local // 3))
    parent = np.concatenate(parents)
    order = np.argsort(parent, kind="stable")
    return parent[order], np.concatenate(codes)[order]
