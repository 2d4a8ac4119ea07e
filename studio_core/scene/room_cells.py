"""A room as upright cells: the floor plan cut so that every cell is solid or empty over all of its area.

Cells are joined along whole edges of the plan, and every cell knows the heights at which it is solid. The
room's surface is then what lies between solid and empty: closed, and without T-junctions.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from studio_core.scene.room_shape import (
    BAR,
    BAR_DEPTH,
    LEAF,
    PROUD,
    SASH,
    SLAB,
    Placed,
    Point,
    RoomShape,
    along,
    outward,
    span,
)

FLOOR, WALLS, CEILING, SKIRTING, FRAMES = range(5)
"""Material slots."""

F64 = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Solid:
    """Heights between which a cell is solid, and the slots of what can be seen of it."""

    low: float
    high: float
    side: int
    top: int
    bottom: int


@dataclass(frozen=True)
class Cell:
    """A piece of the plan: its corners, clockwise as seen from above, and its solids from the lowest up."""

    corners: tuple[Point, ...]
    solids: tuple[Solid, ...]


@dataclass
class _Wall:
    """A wall that is there: its lines by offset, and the points on them at which cells meet."""

    start: F64
    way: F64
    normal: F64
    ends: dict[float, tuple[Point, Point]]
    first: float
    last: float
    known: dict[tuple[float, float], Point] = field(default_factory=dict)

    def at(self, offset: float, where: float) -> Point:
        """The point on the line at that offset; beyond the straight part it is the line's end."""
        if where <= self.first:
            return self.ends[offset][0]
        if where >= self.last:
            return self.ends[offset][1]
        if (offset, where) not in self.known:
            x, z = self.start + where * self.way + offset * self.normal
            self.known[offset, where] = (float(x), float(z))
        return self.known[offset, where]

    def line(self, offset: float, places: list[float]) -> list[Point]:
        """The points of a line at several places."""
        return [self.at(offset, where) for where in places]


def cells(shape: RoomShape) -> list[Cell]:
    """The cells of a room; the shape must have passed its `check`."""
    plan = np.array(shape.corners)
    ways, normals = along(plan), outward(plan)
    proud = -PROUD if shape.baseboard else 0.0
    rims = {offset: shape.rim(offset) for offset in (proud, 0.0, shape.thickness)}
    base = (Solid(-SLAB, 0.0, FLOOR, FLOOR, FLOOR),)
    roof = shape.height + SLAB
    above = (Solid(shape.height, roof, CEILING, CEILING, CEILING),) if shape.ceiling else ()
    placed = shape.placed()
    made: list[Cell] = []
    border: list[Point] = []
    for number in range(len(plan)):
        after = (number + 1) % len(plan)
        if number in shape.without:
            border += _gap(plan[number], ways[number], number, after, rims, proud)
            continue
        low, high = span(plan, list(rims.values()), number)
        ends = {
            offset: (_point(plan[number], rim[number]), _point(plan[after], rim[after]))
            for offset, rim in rims.items()
        }
        wall = _Wall(plan[number], ways[number], normals[number], ends, low, high)
        holes = sorted((one for one in placed if one.wall == number), key=lambda one: one.start)
        top = roof if shape.ceiling else shape.height
        made += _wall_cells(wall, shape, holes, top)
        runs, skirted = _skirting(wall, shape, holes, proud)
        made += [Cell(run, (*_skirt(shape.baseboard), *above)) for run in runs]
        border += skirted
    return [Cell(tuple(_distinct(border)), (*base, *above)), *made]


def _point(corner: F64, place: F64) -> Point:
    return (float(place[0]), float(place[1]))


def _skirt(height: float) -> tuple[Solid, ...]:
    return (
        Solid(-SLAB, 0.0, FLOOR, FLOOR, FLOOR),
        Solid(0.0, height, SKIRTING, SKIRTING, FLOOR),
    )


def _gap(corner: F64, way: F64, number: int, after: int, rims: dict[float, F64], proud: float) -> list[Point]:
    """The floor's edge where a wall is left out; the ends of its neighbours may stand on it."""
    edge = [_point(corner, rims[proud][number]), _point(corner, rims[proud][after])]
    first, last = (float((np.array(point) - corner) @ way) for point in edge)
    others = {_point(corner, rim[at]) for rim in rims.values() for at in (number, after)} - set(edge)
    found = sorted((float((np.array(point) - corner) @ way), point) for point in others)
    return [edge[0], *(point for where, point in found if first < where < last), edge[1]]


def _distinct(points: list[Point]) -> list[Point]:
    return [point for k, point in enumerate(points) if point != points[k - 1]]


def _skirting(
    wall: _Wall, shape: RoomShape, holes: list[Placed], proud: float
) -> tuple[list[tuple[Point, ...]], list[Point]]:
    """Outlines of the runs of skirting along a wall, and the edge of the floor before them."""
    low, high = wall.first, wall.last
    cuts = [low, *(where for one in holes for where in (one.start, one.end)), high]
    if not proud:
        return [], wall.line(0.0, cuts)
    stops = [where for one in holes if one.low < shape.baseboard for where in (one.start, one.end)]
    bounds = [low, *stops, high]
    runs, border = [], []
    for k, (start, end) in enumerate(pairwise(bounds)):
        inner = [where for where in cuts if start <= where <= end]
        if k % 2 == 0:
            front = wall.line(proud, [start, end])
            runs.append(tuple(_distinct([*wall.line(0.0, inner), *reversed(front)])))
            border += front
        else:
            border += wall.line(0.0, inner)
    return runs, border


def _wall_cells(wall: _Wall, shape: RoomShape, holes: list[Placed], top: float) -> list[Cell]:
    """The cells of a wall: whole columns between openings; in openings layers for reveals and frame."""
    cap = CEILING if shape.ceiling else WALLS
    whole = (Solid(-SLAB, top, WALLS, cap, FLOOR),)
    made: list[Cell] = []
    before = wall.first
    depth: tuple[float, ...] = ()  # offsets of the layers of the opening on the left
    outer = shape.thickness
    for one in [*holes, None]:
        end = wall.last if one is None else one.start
        layers = () if one is None else _layers(one, outer)
        left = [wall.at(offset, before) for offset in depth]
        right = [wall.at(offset, end) for offset in layers]
        ring = [
            *(wall.at(0.0, end), wall.at(0.0, before), *left, wall.at(outer, before)),
            *(wall.at(outer, end), *reversed(right)),
        ]
        made.append(Cell(tuple(_distinct(ring)), whole))
        if one is None:
            break
        made += _opening_cells(wall, one, outer, layers, top, cap)
        before, depth = one.end, layers
    return made


def _layers(one: Placed, thickness: float) -> tuple[float, ...]:
    """Offsets of the faces of a frame or door leaf in the middle of a wall."""
    if one.kind == "opening":
        return ()
    depth = min(BAR_DEPTH if one.kind == "window" else LEAF, thickness / 2)
    return ((thickness - depth) / 2, (thickness + depth) / 2)


def _opening_cells(
    wall: _Wall, one: Placed, outer: float, layers: tuple[float, ...], top: float, cap: int
) -> list[Cell]:
    sill = FLOOR if one.low == 0 else WALLS
    below = Solid(-SLAB, one.low, WALLS, sill, FLOOR)
    lintel = Solid(one.high, top, WALLS, cap, WALLS)
    start, end = one.start, one.end

    def cell(near: float, far: float, cuts: tuple[list[float], list[float]], *more: Solid) -> Cell:
        """Between two lines; `cuts` are the places at which points lie on either."""
        front, back = wall.line(near, cuts[0]), wall.line(far, cuts[1])
        return Cell((*reversed(front), *back), (below, *more, lintel))

    ends = [start, end]
    if not layers:
        return [cell(0.0, outer, (ends, ends))]
    near, far = layers
    if one.kind == "door":
        leaf = Solid(one.low, one.high, FRAMES, FRAMES, FRAMES)
        return [
            cell(0.0, near, (ends, ends)),
            cell(near, far, (ends, ends), leaf),
            cell(far, outer, (ends, ends)),
        ]
    bar = min(BAR, (end - start) / 6, (one.high - one.low) / 6)
    sashes = max(1, round((end - start) / SASH))
    pane = (end - start - bar * (sashes + 1)) / sashes
    edges = [start + k * (pane + bar) for k in range(sashes + 1)]
    cuts = [start, *(where for edge in edges[1:] for where in (edge - pane, edge)), end]
    upright = Solid(one.low, one.high, FRAMES, FRAMES, FRAMES)
    lower = Solid(one.low, one.low + bar, FRAMES, FRAMES, FRAMES)
    upper = Solid(one.high - bar, one.high, FRAMES, FRAMES, FRAMES)
    frame = [
        cell(near, far, ([a, b], [a, b]), *((upright,) if k % 2 == 0 else (lower, upper)))
        for k, (a, b) in enumerate(pairwise(cuts))
    ]
    return [cell(0.0, near, (ends, cuts)), *frame, cell(far, outer, (cuts, ends))]
