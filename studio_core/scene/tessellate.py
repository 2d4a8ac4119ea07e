"""Splitting faces until no edge exceeds a length, without T-junctions and without a search.

Every edge gets its points first: n equal pieces, n from its two welded ends alone, so the faces on both sides
agree. Then each face is filled for itself: cut from the inside of its longest side to the opposite corner,
again and again, the cut being an edge with points of its own; a face that is thinner than the target needs no
points inside and is laced up between its long side and the other two.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np

from studio_core.scene.bisection import lengths
from studio_core.scene.normals import NONE, Fan
from studio_core.scene.topology import Bools, Floats, Ints, counting, edges

SLACK = 1e-6
MIDDLE = 0.3  # cuts stay this share of a side away from its ends
THIN = 0.8  # faces lower than this share of the target are laced
TRIANGLE = 0.184  # mean area over edge² of the triangles that a large face ends in, measured


def segments(length: Floats, edge: float) -> Ints:
    """How many pieces an edge of that length is cut into."""
    return np.maximum(np.ceil(length / (edge * (1 - SLACK))), 1).astype(np.int64)


@dataclass
class _Sides:
    """Triangles (N, 3) by their sides: thread number and first and last position on it; `owner` (N,)."""

    thread: Ints
    start: Ints
    stop: Ints
    owner: Ints

    def __len__(self) -> int:
        return len(self.owner)

    def pick(self, rows: Ints | Bools) -> _Sides:
        return _Sides(self.thread[rows], self.start[rows], self.stop[rows], self.owner[rows])

    def turned(self, first: Ints) -> _Sides:
        """With side `first` (N,) leading."""
        order = (first[:, None] + np.arange(3)) % 3
        thread, start, stop = (np.take_along_axis(a, order, axis=1) for a in self.arrays())
        return _Sides(thread, start, stop, self.owner)

    def arrays(self) -> tuple[Ints, Ints, Ints]:
        return self.thread, self.start, self.stop

    @property
    def pieces(self) -> Ints:
        return np.asarray(np.abs(self.stop - self.start))

    @property
    def step(self) -> Ints:
        return np.asarray(np.sign(self.stop - self.start))


def _stacked(parts: list[_Sides]) -> _Sides:
    fields = ("thread", "start", "stop", "owner")
    return _Sides(*(np.concatenate([getattr(part, name) for part in parts]) for name in fields))


class _Filling:
    """Points, vertices and threads while faces are filled.

    A thread is an edge in n pieces as one face sees it: ends and the number before its first inner point in
    three numberings: points, front vertices, back vertices (NONE where a face has no back).
    """

    def __init__(self, mesh: Fan, edge: float) -> None:
        self.mesh, self.edge = mesh, edge
        self.points = mesh.points
        self.weld, self.normals, self.uvs = mesh.weld, mesh.normals, mesh.uvs
        self.slot, self.side = mesh.slot, mesh.side
        self.tail = self.head = self.before = np.zeros((0, 3), np.int64)
        self.count = np.zeros(0, np.int64)

    def sources(self) -> _Sides:
        """The faces of the source, every welded edge cut into its pieces, vertices shared where they were."""
        mesh = self.mesh
        corners = mesh.weld[mesh.faces]
        around = edges(corners)
        way = mesh.points[around.ends[:, 1]] - mesh.points[around.ends[:, 0]]
        count = segments(np.sqrt((way * way).sum(axis=1)), self.edge)
        before = self._points(around.ends[:, 0], around.ends[:, 1], count)
        of = around.of.reshape(-1)
        rising = (corners < np.roll(corners, -1, axis=1)).reshape(-1)
        ends = [(around.ends[of, 0], around.ends[of, 1], before[of])]
        for vertex in (mesh.faces, mesh.back):
            here, there = vertex.reshape(-1), np.roll(vertex, -1, axis=1).reshape(-1)
            low, high = np.where(rising, here, there), np.where(rising, there, here)
            ends.append((low, high, np.full(len(low), NONE, np.int64)))
        low = np.concatenate([ends[1][0], ends[2][0]])
        high = np.concatenate([ends[1][1], ends[2][1]])
        there = np.flatnonzero(low != NONE)
        _, first, number = np.unique(
            low[there] * (len(self.weld) + 1) + high[there], return_index=True, return_inverse=True
        )
        chosen = there[first]
        edge_of = np.tile(of, 2)[chosen]
        made = self._vertices(low[chosen], high[chosen], count[edge_of], before[edge_of])
        both = np.full(len(low), NONE, np.int64)
        both[there] = made[number.reshape(-1)]
        self.tail = np.stack([ends[k][0] for k in range(3)], axis=1)
        self.head = np.stack([ends[k][1] for k in range(3)], axis=1)
        self.before = np.stack([before[of], both[: len(of)], both[len(of) :]], axis=1)
        self.count = count[of]
        zero = np.zeros(len(of), np.int64)
        return _Sides(
            np.arange(len(of)).reshape(-1, 3),
            np.where(rising, zero, self.count).reshape(-1, 3),
            np.where(rising, self.count, zero).reshape(-1, 3),
            np.arange(len(corners)),
        )

    def at(self, thread: Ints, position: Ints) -> Ints:
        """(…, 3) point, front vertex and back vertex at a position 0…n of a thread."""
        where = position[..., None]
        inner = self.before[thread] + where
        made = np.where(where == 0, self.tail[thread], inner)
        made = np.where(where == self.count[thread][..., None], self.head[thread], made)
        return np.where(self.tail[thread] == NONE, NONE, made)

    def join(self, tail: Ints, head: Ints) -> Ints:
        """New threads (N,) between nodes (N, 3) inside faces."""
        way = self.points[tail[:, 0]] - self.points[head[:, 0]]
        count = segments(np.sqrt((way * way).sum(axis=1)), self.edge)
        before = np.full((len(tail), 3), NONE, np.int64)
        before[:, 0] = self._points(tail[:, 0], head[:, 0], count)
        before[:, 1] = self._vertices(tail[:, 1], head[:, 1], count, before[:, 0])
        rear = np.flatnonzero(tail[:, 2] != NONE)
        before[rear, 2] = self._vertices(tail[rear, 2], head[rear, 2], count[rear], before[rear, 0])
        made = len(self.count) + np.arange(len(tail))
        self.tail, self.head = np.concatenate([self.tail, tail]), np.concatenate([self.head, head])
        self.before = np.concatenate([self.before, before])
        self.count = np.concatenate([self.count, count])
        return made

    def _points(self, tail: Ints, head: Ints, count: Ints) -> Ints:
        row, share = _inner(count)
        start = self.points[tail[row]]
        made = start + share[:, None] * (self.points[head[row]] - start)
        before = len(self.points) + np.cumsum(count - 1) - count
        self.points = np.concatenate([self.points, made])
        return before

    def _vertices(self, tail: Ints, head: Ints, count: Ints, points_before: Ints) -> Ints:
        row, share = _inner(count)
        a, b, part = tail[row], head[row], share[:, None]
        normal = self.normals[a] + part * (self.normals[b] - self.normals[a])
        length = np.linalg.norm(normal, axis=1, keepdims=True)
        normal = np.where(length > 1e-9, normal / np.maximum(length, 1e-9), self.normals[a])
        before = len(self.weld) + np.cumsum(count - 1) - count
        self.normals = np.concatenate([self.normals, normal])
        self.uvs = np.concatenate([self.uvs, self.uvs[a] + part * (self.uvs[b] - self.uvs[a])])
        self.weld = np.concatenate([self.weld, points_before[row] + 1 + counting(count - 1)])
        self.slot = np.concatenate([self.slot, self.slot[a]])
        self.side = np.concatenate([self.side, self.side[a]])
        return before

    def bisect(self, faces: _Sides, corners: Floats) -> _Sides:
        """Each face cut to its third corner from the point of its leading side nearest that corner's foot."""
        along, out = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
        foot = (along * out).sum(axis=1) / (along * along).sum(axis=1)
        pieces = faces.pieces[:, 0]
        cut = np.clip(np.rint(pieces * np.clip(foot, MIDDLE, 1 - MIDDLE)), 1, pieces - 1).astype(np.int64)
        middle = faces.start[:, 0] + faces.step[:, 0] * cut
        made = self.join(self.at(faces.thread[:, 0], middle), self.at(faces.thread[:, 2], faces.start[:, 2]))
        zero, count = np.zeros(len(faces), np.int64), self.count[made]
        t, a, b = faces.arrays()
        left = _Sides(
            np.stack([t[:, 0], made, t[:, 2]], axis=1),
            np.stack([a[:, 0], zero, a[:, 2]], axis=1),
            np.stack([middle, count, b[:, 2]], axis=1),
            faces.owner,
        )
        right = _Sides(
            np.stack([t[:, 0], t[:, 1], made], axis=1),
            np.stack([middle, a[:, 1], count], axis=1),
            np.stack([b[:, 0], b[:, 1], zero], axis=1),
            faces.owner,
        )
        return _stacked([left, right])

    def lace(self, faces: _Sides, corners: Floats) -> _Sides:
        """Each face triangulated between its leading side and the other two; at least 3 pieces on that.

        All points between the ends A and B are put in order along A → B (the first of both chains in
        front, the last ones at the end, so that no triangle lies in one side); each adds a triangle with
        the last points of both chains before it.
        """
        t, a, b = faces.arrays()
        size = faces.pieces
        # Chain 0 is side 0 from A; chain 1 is side 2 backwards from A to the corner C, then side 1 from C.
        inner = np.stack([size[:, 0] - 1, size[:, 2], size[:, 1] - 1], axis=1)
        total = inner.sum(axis=1)
        face = np.repeat(np.arange(len(faces)), total)
        number = counting(total)
        part = (number >= inner[face, 0]).astype(np.int64) + (number >= inner[face, :2].sum(axis=1))
        number = number - np.where(part > 0, inner[face, 0], 0) - np.where(part > 1, inner[face, 1], 0)
        side = np.array([0, 2, 1])[part]
        back = part > 0
        begin, step = np.where(back, b[face, side], a[face, side]), faces.step[face, side]
        step = np.where(back, -step, step)
        before, here = begin + step * number, begin + step * (number + 1)
        thread = t[face, side]
        node = self.at(thread, here)
        chain = (part > 0).astype(np.int64)
        axis = corners[:, 1] - corners[:, 0]
        along = ((self.points[node[:, 0]] - corners[face, 0]) * axis[face]).sum(axis=1)
        along /= (axis * axis).sum(axis=1)[face]
        rank = np.where(part == 2, number + inner[face, 1], number)
        final = rank == np.where(chain == 0, inner[face, 0], inner[face, 1] + inner[face, 2]) - 1
        along = np.where(rank == 0, -2.0 + chain, np.where(final, 2.0, np.clip(along, 0, 1)))
        order = np.lexsort((rank, chain, along, face))
        face, thread, before, here, chain = (x[order] for x in (face, thread, before, here, chain))
        node = node[order]

        index = np.arange(len(face))
        first = np.concatenate([[0], np.cumsum(total)[:-1]])
        last = first + total - 1
        latest = [np.maximum.accumulate(np.where(chain == k, index, 0)) for k in (0, 1)]
        # After each point from the second on, a thread from the latest point of chain 0 to that of chain 1.
        whole = np.ones(len(face), bool)
        whole[first] = False
        lace = np.full(len(face), NONE, np.int64)
        lace[whole] = self.join(node[latest[0][whole]], node[latest[1][whole]])
        count = np.where(whole, self.count[lace], 0)
        zero = np.zeros(len(face), np.int64)

        def rows(chosen: Ints, sides: list[tuple[Ints, Ints, Ints]], owner: Ints) -> _Sides:
            t, a, b = (np.stack([side[k][chosen] for side in sides], axis=1) for k in range(3))
            return _Sides(t, a, b, faces.owner[owner])

        ahead, behind = (thread, before, here), (thread, here, before)
        there, previous = (lace, zero, count), np.maximum(index - 1, 0)
        returned = (lace[previous], count[previous], zero)
        second = first + 1
        inside = np.ones(len(face), bool)
        inside[first] = inside[second] = False
        low, high = np.flatnonzero(inside & (chain == 0)), np.flatnonzero(inside & (chain == 1))
        start = (thread[previous], before[previous], here[previous])  # A to the first point of chain 0
        end_low = (t[:, 0], b[:, 0] - faces.step[:, 0], b[:, 0])
        end_high = (t[:, 1], a[:, 1], a[:, 1] + faces.step[:, 1])
        closing = (lace[last], count[last], zero[last])
        each = np.arange(len(faces))
        return _stacked(
            [
                rows(second, [there, behind, start], face[second]),
                rows(low, [ahead, there, returned], face[low]),
                rows(high, [there, behind, returned], face[high]),
                rows(each, [end_low, end_high, closing], each),
            ]
        )


def _inner(count: Ints) -> tuple[Ints, Floats]:
    """Row and share of the way of every inner point of edges in `count` pieces."""
    row = np.repeat(np.arange(len(count)), count - 1)
    return row, (counting(count - 1) + 1) / count[row]


def subdivide(mesh: Fan, edge: float) -> Fan:
    """Faces split until no edge is longer than `edge`; faces in the source's order, vertices appended."""
    if not len(mesh.faces):
        return mesh
    filling = _Filling(mesh, edge)
    active = filling.sources()
    done: list[_Sides] = []
    while len(active):
        pieces = active.pieces
        single = (pieces == 1).all(axis=1)
        done.append(active.pick(single))
        active = active.pick(~single)
        corners = filling.points[filling.at(active.thread, active.start)[:, :, 0]]
        way = np.roll(corners, -1, axis=1) - corners
        length = np.sqrt((way * way).sum(axis=2))
        first = np.where(active.pieces > 1, length, 0).argmax(axis=1)
        active = active.turned(first)
        corners = np.take_along_axis(corners, ((first[:, None] + np.arange(3)) % 3)[:, :, None], axis=1)
        longest = np.take_along_axis(length, first[:, None], axis=1)[:, 0]
        height = np.linalg.norm(np.cross(way[:, 0], way[:, 1]), axis=1) / longest
        thin = (height < THIN * edge) & (active.pieces[:, 0] > 2)
        fills = [
            fill(active.pick(rows), corners[rows])
            for fill, rows in ((filling.lace, thin), (filling.bisect, ~thin))
            if rows.any()
        ]
        active = _stacked(fills) if fills else active
    made = _stacked(done)
    node = filling.at(made.thread, made.start)
    order = np.lexsort((morton_codes(filling.points[node[:, :, 0]].mean(axis=1)), made.owner))
    node, owner = node[order], made.owner[order]
    return dataclasses.replace(
        mesh,
        points=filling.points,
        weld=filling.weld,
        normals=filling.normals,
        uvs=filling.uvs,
        slot=filling.slot,
        side=filling.side,
        faces=node[:, :, 1],
        back=node[:, :, 2],
        source=mesh.source[owner],
        slots=mesh.slots[owner],
    )


def morton_codes(points: Floats) -> Ints:
    """Morton order, ten bits an axis: neighbours in space become neighbours in memory."""
    low = points.min(axis=0)
    size = max(float((points.max(axis=0) - low).max()), 1e-300)
    cell = np.minimum((points - low) / size * 1024, 1023).astype(np.int64)
    code = np.zeros(len(points), np.int64)
    for bit in range(10):
        for axis in range(3):
            code |= (cell[:, axis] >> bit & 1) << (3 * bit + axis)
    return code


class Estimate:
    """How many vertices `subdivide` ends with, not doing it: exact on the source's edges, by area inside."""

    def __init__(self, mesh: Fan) -> None:
        corners = mesh.weld[mesh.faces]
        self.vertices = len(mesh.weld)
        self._length = lengths(mesh.points, corners)
        self.longest = float(self._length.max(initial=0.0))
        self._sides = 1 + (mesh.back[:, 0] != NONE)
        a, b, c = (mesh.points[corners[:, k]] for k in range(3))
        self._area = np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2
        ahead = np.roll(mesh.faces, -1, axis=1), np.roll(mesh.back, -1, axis=1)
        tails = np.concatenate([mesh.faces.reshape(-1), mesh.back.reshape(-1)])
        heads = np.concatenate([ahead[0].reshape(-1), ahead[1].reshape(-1)])
        there = np.flatnonzero(tails != NONE)
        low, high = np.minimum(tails, heads)[there], np.maximum(tails, heads)[there]
        _, first = np.unique(low * (self.vertices + 1) + high, return_index=True)
        self._rim = np.tile(self._length.reshape(-1), 2)[there[first]]

    def at(self, edge: float) -> float:
        """Vertices at a target edge; falls as `edge` grows, but for steps of the rounding."""
        if not len(self._rim):
            return float(self.vertices)
        on_edges = np.maximum(np.ceil(self._rim / edge), 1).sum() - len(self._rim)
        pieces = np.maximum(np.ceil(self._length / edge), 1)
        triangles = self._area / (TRIANGLE * edge * edge)
        inside = np.maximum((triangles - pieces.sum(axis=1) + 2) / 2, 0)
        inside = np.where((pieces > 1).any(axis=1), inside, 0)
        return float(self.vertices + on_edges + (inside * self._sides).sum())
