"""Which corners of a mesh are one point, which faces are neighbours: welding, edges, parts, T-junctions."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]
Bools = npt.NDArray[np.bool_]

PAIR_LIMIT = 50_000_000


def tolerance(points: npt.NDArray[Any]) -> float:
    """Distance under which two points are one: 1e-6 of the box's diagonal, two float32 steps at least."""
    if not len(points):
        return 0.0
    low, high = points.min(axis=0).astype(np.float64), points.max(axis=0).astype(np.float64)
    step = float(np.finfo(np.float32).eps) * float(max(np.abs(low).max(), np.abs(high).max()))
    return max(1e-6 * float(np.linalg.norm(high - low)), 2 * step)


def components(count: int, a: Ints, b: Ints) -> Ints:
    """(count,) the lowest member of each node's connected part; nodes a[i] and b[i] are joined.

    Hooks roots to their smallest neighbour and shortens the paths, so the rounds grow with log(count).
    """
    label = np.arange(count, dtype=np.int64)
    while True:
        la, lb = label[a], label[b]
        apart = la != lb
        if not apart.any():
            return label
        a, b, la, lb = a[apart], b[apart], la[apart], lb[apart]
        np.minimum.at(label, np.maximum(la, lb), np.minimum(la, lb))
        while True:
            short = label[label]
            if np.array_equal(short, label):
                break
            label = short


def ranks(keys: Ints) -> tuple[Ints, Ints]:
    """First position of each distinct key, in order of first appearance, and each key's number there."""
    _, first, inverse = np.unique(keys, return_index=True, return_inverse=True)
    order = np.argsort(first, kind="stable")
    rank = np.empty_like(order)
    rank[order] = np.arange(len(order))
    return first[order], rank[inverse.reshape(-1)]


def cells(points: Floats, size: float, shift: npt.ArrayLike = 0.0) -> Ints:
    """A key per point: equal for points in one cell of a grid; 21 bits an axis, coarser where too few."""
    low = points.min(axis=0)
    extent = float((points.max(axis=0) - low).max())
    size = max(size, extent / 2**20, 1e-300)
    index = np.floor((points - low) / size + np.asarray(shift, np.float64)).astype(np.int64) + 1
    return _packed(index)


def _packed(index: Ints) -> Ints:
    return np.asarray((index[:, 0] << 42) | (index[:, 1] << 21) | index[:, 2])


def weld(positions: npt.NDArray[np.float32], near: float) -> tuple[Floats, Ints]:
    """Points (W, 3) and the point of every position: equal ones and those within `near` are one.

    Eight shifted grids of cell 2·near: positions closer than `near` on every axis share a cell of one of
    them, those further apart than 2√3·near never do (chains aside). Linear, whatever the clustering.
    """
    if not len(positions):
        return np.zeros((0, 3)), np.zeros(0, np.int64)
    clean = np.ascontiguousarray(positions, np.float32) + np.float32(0)  # -0 becomes 0
    _, first, exact = np.unique(clean.view("V12").reshape(-1), return_index=True, return_inverse=True)
    points = clean[first].astype(np.float64)
    joined: list[tuple[Ints, Ints]] = []
    if near > 0:
        for corner in range(8):
            key = cells(points, 2 * near, [0.5 * (corner >> axis & 1) for axis in range(3)])
            order = np.argsort(key, kind="stable")
            same = np.flatnonzero(key[order][1:] == key[order][:-1])
            joined.append((order[same], order[same + 1]))
    a = np.concatenate([pair[0] for pair in joined]) if joined else np.zeros(0, np.int64)
    b = np.concatenate([pair[1] for pair in joined]) if joined else np.zeros(0, np.int64)
    label = components(len(points), a, b)[exact.reshape(-1)]
    chosen, index = ranks(label)
    return clean[chosen].astype(np.float64), index


@dataclass(frozen=True)
class Edges:
    """Undirected edges of a triangle mesh. Half-edge 3·f + k goes from corner k to corner k + 1 of face f.

    ends (E, 2) low and high point; of (F, 3) the edge of each half-edge; count (E,) faces of an edge;
    order (3F,) half-edges sorted by edge; start (E,) where an edge's half-edges begin in `order`.
    """

    ends: Ints
    of: Ints
    count: Ints
    order: Ints
    start: Ints


def edges(faces: Ints) -> Edges:
    """The edges of faces (F, 3)."""
    tail, head = faces.reshape(-1), np.roll(faces, -1, axis=1).reshape(-1)
    low, high = np.minimum(tail, head), np.maximum(tail, head)
    span = int(faces.max()) + 1 if len(faces) else 1
    keys, of = np.unique(low * span + high, return_inverse=True)
    of = of.reshape(-1)
    count = np.bincount(of, minlength=len(keys))
    start = np.concatenate([[0], np.cumsum(count)[:-1]]).astype(np.int64) if len(keys) else count
    ends = np.stack([keys // span, keys % span], axis=1)
    return Edges(ends, of.reshape(-1, 3), count, np.argsort(of, kind="stable"), start)


def forward(faces: Ints) -> Bools:
    """(3F,) whether a half-edge goes from the lower to the higher point."""
    return (faces < np.roll(faces, -1, axis=1)).reshape(-1)


def partners(points: Floats, faces: Ints, made: Edges) -> Ints:
    """(3F,) the half-edge across each half-edge; -1 at borders and where faces cannot be paired.

    Two faces at an edge are a pair, whatever their winding. More are paired by angle where their windings
    alternate around the edge, so that solids that touch along edges or faces come apart.
    """
    found = np.full(3 * len(faces), -1, np.int64)
    two = made.start[made.count == 2]
    first, second = made.order[two], made.order[two + 1]
    found[first], found[second] = second, first
    many = np.flatnonzero((made.count > 2) & (made.count % 2 == 0))
    if not len(many):
        return found
    half = made.order[np.repeat(made.start[many], made.count[many]) + counting(made.count[many])]
    row = np.repeat(np.arange(len(many)), made.count[many])
    begin = np.concatenate([[0], np.cumsum(made.count[many])[:-1]])
    low = points[made.ends[many[row], 0]]
    axis = points[made.ends[many[row], 1]] - low
    axis /= np.linalg.norm(axis, axis=1, keepdims=True)
    out = points[np.roll(faces, 1, axis=1).reshape(-1)[half]] - low  # the corner across the edge
    out -= axis * (out * axis).sum(axis=1, keepdims=True)
    zero = out[begin][row]
    angle = np.arctan2((np.cross(zero, out) * axis).sum(axis=1), (zero * out).sum(axis=1)) % (2 * np.pi)
    step = np.round(angle / 1e-4).astype(np.int64) % round(2 * np.pi / 1e-4)
    ahead = forward(faces)[half]
    # The normal of a forward face looks to larger angles: matter lies between a backward face and the next
    # forward one. Of coincident faces the forward one comes first: contact, not matter of no thickness.
    order = np.lexsort((~ahead, step, row))
    half, ahead = half[order], ahead[order]
    following = np.arange(len(half)) + 1
    last = begin + made.count[many] - 1
    following[last] = begin
    proper = np.bincount(row, ahead == ahead[following], minlength=len(many)) == 0
    use = np.flatnonzero(~ahead & proper[row])
    found[half[use]], found[half[following[use]]] = half[following[use]], half[use]
    return found


def counting(counts: Ints) -> Ints:
    """0, 1, … counts[0] - 1, 0, 1, … for each count."""
    ends = np.cumsum(counts)
    return np.arange(int(ends[-1]) if len(ends) else 0) - np.repeat(ends - counts, counts)


def t_junctions(points: Floats, faces: Ints, made: Edges, near: float) -> tuple[Ints, Ints, Floats]:
    """Border points within `near` of the inside of a border edge: edge, point, and where on it (0…1).

    Edges are searched by classes of length, each in a grid of its own, so the cost follows the number of
    edges; a class that would compare more than PAIR_LIMIT pairs is left as it is.
    """
    border = np.flatnonzero(made.count == 1)
    rim = np.unique(made.ends[border])
    nothing = np.zeros(0, np.int64), np.zeros(0, np.int64), np.zeros(0)
    if not len(border):
        return nothing
    start, end = points[made.ends[border, 0]], points[made.ends[border, 1]]
    length = np.linalg.norm(end - start, axis=1)
    klass = np.frexp(length / max(float(length.max()), 1e-300))[1] // 2
    found: list[tuple[Ints, Ints]] = []
    for k in np.unique(klass):
        found += _near_edges(points[rim], start, end, length, np.flatnonzero(klass == k), near)
    if not found:
        return nothing
    edge = np.concatenate([pair[0] for pair in found])
    point = np.concatenate([pair[1] for pair in found])
    edge, point = np.divmod(np.unique(edge * len(rim) + point), len(rim))
    along = end[edge] - start[edge]
    offset = points[rim[point]] - start[edge]
    where = (along * offset).sum(axis=1) / (along * along).sum(axis=1)
    away = np.linalg.norm(offset - where[:, None] * along, axis=1)
    ends = made.ends[border[edge]]
    margin = near / length[edge]
    keep = (away <= near) & (where > margin) & (where < 1 - margin)
    keep &= (ends != rim[point][:, None]).all(axis=1)
    return border[edge[keep]], rim[point[keep]], where[keep]


def _near_edges(
    rim: Floats, start: Floats, end: Floats, length: Floats, chosen: Ints, near: float
) -> list[tuple[Ints, Ints]]:
    """Candidate (edge, rim point) pairs of the chosen edges of similar length: four samples an edge."""
    reach = float(length[chosen].max()) / 8 + near
    share = (np.arange(4) + 0.5) / 4
    samples = (start[chosen][:, None] + share[:, None] * (end - start)[chosen][:, None]).reshape(-1, 3)
    owner = np.repeat(chosen, 4)
    both = np.concatenate([rim, samples - reach, samples + reach])
    low = both.min(axis=0)
    size = max(2 * reach, float((both.max(axis=0) - low).max()) / 2**20)
    cell = _packed(np.floor((rim - low) / size).astype(np.int64))
    order = np.argsort(cell, kind="stable")
    cell = cell[order]
    first = np.floor((samples - reach - low) / size).astype(np.int64)
    last = np.floor((samples + reach - low) / size).astype(np.int64)
    spans: list[tuple[Ints, Ints, Ints]] = []
    for corner in range(8):
        pick = np.array([corner >> axis & 1 for axis in range(3)], bool)
        fresh = ~((first == last) & pick).any(axis=1)  # the same cell was visited by another corner
        wanted = _packed(np.where(pick, last, first)[fresh])
        begin, stop = np.searchsorted(cell, wanted, "left"), np.searchsorted(cell, wanted, "right")
        spans.append((owner[fresh], begin, stop - begin))
    if sum(int(count.sum()) for _, _, count in spans) > PAIR_LIMIT:
        return []
    return [
        (np.repeat(who, count), order[np.repeat(begin, count) + counting(count)])
        for who, begin, count in spans
    ]
