"""Triangulation of polygons in space, concave ones included."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

Ints = npt.NDArray[np.int64]
Points = npt.NDArray[np.float64]

LARGEST = 4096
"""Corners up to which a concave polygon is cut by ears; larger ones are fanned."""


def triangulate(points: Points, corners: Ints, sizes: Ints) -> tuple[Ints, Ints]:
    """Triangles of polygons: (T, 3) places in `corners`, and (T,) the polygon each came from.

    `corners` are indices into `points` (P, 3), polygon after polygon; `sizes` (≥ 3) says how many each
    has. A fan where it covers the polygon exactly once (every triangle turns as the polygon does), the
    fan from the next corner for the other quads, ear clipping else. Crossing polygons give triangles
    as well, with overlaps. Triangles come in the polygons' order.
    """
    starts = np.cumsum(sizes) - sizes
    made: list[Ints] = []
    owners: list[Ints] = []
    for size in np.unique(sizes):
        which = np.flatnonzero(sizes == size)
        place = starts[which, None] + np.arange(size)
        triangles = _fan(place)
        if size > 3:
            corner = points[corners[place]]
            good = _turns_alike(corner)
            if size == 4:
                shifted = np.roll(np.arange(4), -1)
                again = ~good & _turns_alike(corner[:, shifted])
                triangles[again] = _fan(place[again][:, shifted])
                good |= again
            for index in np.flatnonzero(~good):
                if size <= LARGEST:
                    triangles[index] = place[index][_ears(_flat(corner[index]))]
        made.append(triangles.reshape(-1, 3))
        owners.append(np.repeat(which, size - 2))
    if not made:
        return np.zeros((0, 3), np.int64), np.zeros(0, np.int64)
    owner = np.concatenate(owners)
    order = np.argsort(owner, kind="stable")
    return np.concatenate(made)[order], owner[order]


def _fan(place: Ints) -> Ints:
    """(N, n − 2, 3) triangles around the first of (N, n) corners."""
    first = np.broadcast_to(place[:, :1], place[:, 2:].shape)
    return np.stack([first, place[:, 1:-1], place[:, 2:]], axis=2)


def _newell(corner: Points) -> Points:
    """(..., 3) normals, twice the area long, of polygons (..., n, 3) (Newell's method)."""
    moved = corner - corner[..., :1, :]
    total: Points = np.cross(moved, np.roll(moved, -1, axis=-2)).sum(axis=-2)
    return total


def _turns_alike(corner: Points) -> npt.NDArray[np.bool_]:
    """Which of (N, n, 3) polygons have a fan of triangles that all turn with the polygon's normal."""
    edges = corner[:, 1:] - corner[:, :1]
    crosses = np.cross(edges[:, :-1], edges[:, 1:])
    normal = _newell(corner)
    turns = np.einsum("nki,ni->nk", crosses, normal)
    slack = 1e-9 * np.einsum("ni,ni->n", normal, normal)
    made: npt.NDArray[np.bool_] = (turns >= -slack[:, None]).all(axis=1)
    return made


def _flat(corner: Points) -> Points:
    """(n, 2) of a polygon (n, 3) seen along its normal, counter-clockwise."""
    normal = _newell(corner)
    drop = int(np.argmax(np.abs(normal)))
    keep = [(drop + 1) % 3, (drop + 2) % 3]
    flat = corner[:, keep].copy()
    if normal[drop] < 0:
        flat[:, 0] *= -1
    return flat


def _ears(flat: Points) -> Ints:
    """(n − 2, 3) triangles of a counter-clockwise simple polygon (n, 2) by ear clipping (Meisters 1975).

    Where no ear is left, as in polygons that cross themselves, the corner that comes nearest is cut.
    """
    ring = list(range(len(flat)))
    made: list[tuple[int, int, int]] = []
    at = 0
    while len(ring) > 3:
        fallback, widest = at % len(ring), -np.inf
        for step in range(len(ring)):
            i = (at + step) % len(ring)
            a, b, c = ring[i - 1], ring[i], ring[(i + 1) % len(ring)]
            turn = _turn(flat[a], flat[b], flat[c])
            if turn > widest:
                fallback, widest = i, turn
            if turn > 0 and not _holds(flat, ring, a, b, c):
                break
        else:
            i = fallback
        made.append((ring[i - 1], ring[i], ring[(i + 1) % len(ring)]))
        del ring[i]
        at = i
    made.append((ring[0], ring[1], ring[2]))
    return np.array(made, dtype=np.int64)


def _turn(a: Points, b: Points, c: Points) -> float:
    return float((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]))


def _holds(flat: Points, ring: list[int], a: int, b: int, c: int) -> bool:
    """Whether another corner lies in the triangle a, b, c (corners at the same place do not count)."""
    others = flat[ring]
    p, q, r = flat[a], flat[b], flat[c]
    inside = np.ones(len(others), bool)
    for start, end in ((p, q), (q, r), (r, p)):
        (dx, dy), (x, y) = end - start, (others - start).T
        inside &= dx * y - dy * x >= 0
    for corner in (p, q, r):
        inside &= (others != corner).any(axis=1)
    return bool(inside.any())
