"""The mesh of a room: the faces between what is solid and what is empty, closed, with uvs in metres."""

from __future__ import annotations

import dataclasses
from collections import defaultdict
from collections.abc import Iterator, Sequence
from itertools import pairwise
from weakref import WeakValueDictionary

import numpy as np

from studio_core.scene.geometry import Geometry
from studio_core.scene.polygon import triangulate
from studio_core.scene.room_cells import Cell, Solid, cells
from studio_core.scene.room_shape import Placed, Point, RoomShape

_Face = tuple[Point, Point, float, float, int]  # upright: from left to right as seen from its front


def room_geometry(shape: RoomShape) -> Geometry:
    """The mesh of a room; rooms that are built alike share it as long as one of them lives.

    Normals are those of the faces, inside towards the room; uvs are metres: along walls and up, x and -z on
    floor and ceiling. Raises ValueError, in a sentence, when the shape cannot be built.
    """
    made = _known.get(shape)
    if made is None:
        shape.check()
        placed = sorted(shape.placed(), key=lambda one: (one.wall, one.start))
        holes = tuple(dataclasses.replace(one, opening=0) for one in placed)
        alike = (dataclasses.replace(shape, openings=()), holes)
        made = _alike.get(alike)
        if made is None:
            made = _alike[alike] = _built(cells(shape))
        _known[shape] = made
    return made


_known: WeakValueDictionary[RoomShape, Geometry] = WeakValueDictionary()
"""Pure results, remembered while they live, so that a node that is copied or undone keeps its mesh."""
_alike: WeakValueDictionary[tuple[RoomShape, tuple[Placed, ...]], Geometry] = WeakValueDictionary()
"""The same by what is built: a window that is pushed on where its wall ends changes nothing."""


def _built(parts: Sequence[Cell]) -> Geometry:
    upright = list(_upright(parts))
    levels: dict[Point, set[float]] = defaultdict(set)
    for left, right, low, high, _ in upright:
        for point in (left, right):
            levels[point] |= {low, high}
    flat = [(part, level, up, slot) for part in parts for level, up, slot in _flat(part)]
    for part, level, _, _ in flat:
        for point in part.corners:
            levels[point].add(level)
    mesh = _Mesh()
    for face in upright:
        mesh.wall(*face, levels)
    fills = {part.corners: triangulate(part.corners) for part, *_ in flat}
    for part, level, up, slot in flat:
        mesh.level(part.corners, fills[part.corners], level, up, slot)
    return mesh.geometry()


def _flat(part: Cell) -> Iterator[tuple[float, bool, int]]:
    """Heights at which a cell begins or ends to be solid: height, whether it faces up, slot."""
    for k, solid in enumerate(part.solids):
        if solid.high <= solid.low:
            continue
        if k == 0 or part.solids[k - 1].high < solid.low:
            yield solid.low, False, solid.bottom
        if k + 1 == len(part.solids) or part.solids[k + 1].low > solid.high:
            yield solid.high, True, solid.top


def _upright(parts: Sequence[Cell]) -> Iterator[_Face]:
    """Faces on the edges of cells, where one of two neighbours is solid and the other empty."""
    edges: dict[tuple[Point, Point], Cell] = {}
    for part in parts:
        for k, corner in enumerate(part.corners):
            edges[part.corners[k - 1], corner] = part
    for (a, b), part in edges.items():
        other = edges.get((b, a))
        if other is not None and (b, a) < (a, b):
            continue  # seen from the other side already
        yield from _between(part, () if other is None else other.solids, a, b)


def _between(part: Cell, others: tuple[Solid, ...], a: Point, b: Point) -> Iterator[_Face]:
    ends = {end for solid in (*part.solids, *others) for end in (solid.low, solid.high)}
    heights = sorted(ends)
    found: list[_Face] = []
    for low, high in pairwise(heights):
        mine, theirs = _slot(part.solids, low, high), _slot(others, low, high)
        if (mine is None) == (theirs is None):
            continue
        # Cells run clockwise as seen from above: from outside an edge a → b, a is on the right.
        face = (b, a, low, high, mine) if mine is not None else (a, b, low, high, theirs)
        left, right, _, _, slot = face
        assert slot is not None
        if found and found[-1][:2] == (left, right) and found[-1][3] == low and found[-1][4] == slot:
            low = found.pop()[2]
        found.append((left, right, low, high, slot))
    yield from found


def _slot(solids: tuple[Solid, ...], low: float, high: float) -> int | None:
    return next((solid.side for solid in solids if solid.low <= low and high <= solid.high), None)


class _Mesh:
    """Positions, normals and uvs as they are collected; every face has corners of its own."""

    def __init__(self) -> None:
        self.positions: list[tuple[float, float, float]] = []
        self.normals: list[tuple[float, float, float]] = []
        self.uvs: list[tuple[float, float]] = []
        self.faces: list[tuple[int, int, int]] = []
        self.slots: list[int] = []

    def wall(
        self,
        left: Point,
        right: Point,
        low: float,
        high: float,
        slot: int,
        levels: dict[Point, set[float]],
    ) -> None:
        """An upright rectangle with corners wherever others have one on its left and right edges."""
        x, z = right[0] - left[0], right[1] - left[1]
        length = float(np.hypot(x, z))
        x, z = x / length, z / length
        start = len(self.positions)
        chains: list[list[int]] = []
        for point in (left, right):
            heights = sorted(y for y in levels[point] if low <= y <= high)
            chains.append(list(range(len(self.positions), len(self.positions) + len(heights))))
            self.positions += [(point[0], y, point[1]) for y in heights]
            self.uvs += [(point[0] * x + point[1] * z, y) for y in heights]
        self.normals += [(-z, 0.0, x)] * (len(self.positions) - start)
        one, other = chains
        i = j = 0
        while i + 1 < len(one) or j + 1 < len(other):
            climbs = j + 1 == len(other) or (
                i + 1 < len(one)
                and self.positions[one[i + 1]][1] + self.positions[one[i]][1]
                <= self.positions[other[j + 1]][1] + self.positions[other[j]][1]
            )
            if climbs:
                self.faces.append((one[i], other[j], one[i + 1]))
                i += 1
            else:
                self.faces.append((one[i], other[j], other[j + 1]))
                j += 1
            self.slots.append(slot)

    def level(
        self, corners: Sequence[Point], fill: Sequence[tuple[int, int, int]], y: float, up: bool, slot: int
    ) -> None:
        """A piece of floor or ceiling."""
        start, side = len(self.positions), 1.0 if up else -1.0
        self.positions += [(x, y, z) for x, z in corners]
        self.normals += [(0.0, side, 0.0)] * len(corners)
        self.uvs += [(x, -side * z) for x, z in corners]
        # (x, z) runs counter-clockwise in numbers, which is clockwise seen from above.
        self.faces += [(start + a, start + c, start + b) if up else (start + a, start + b, start + c)
                       for a, b, c in fill]  # fmt: skip
        self.slots += [slot] * len(fill)

    def geometry(self) -> Geometry:
        return Geometry(
            np.array(self.positions, np.float32),
            np.array(self.faces, np.uint32),
            np.array(self.normals, np.float32),
            np.array(self.uvs, np.float32),
            np.array(self.slots, np.uint16),
        )
