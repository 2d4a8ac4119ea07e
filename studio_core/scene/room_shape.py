"""What a room is made from: a floor plan, heights, which walls there are, and the openings in them.

A floor plan is seen from above with x to the right and z downwards (towards the viewer). Its corners run
clockwise in that picture; wall i goes from corner i to corner i + 1 and is numbered from 1 where people read
it. For a rectangle the walls are back, right, front and left. Lengths along a wall run to the right as seen
from inside.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
import numpy.typing as npt

from studio_core.params import param, param_infos
from studio_core.scene.polygon import area, clearance

Point = tuple[float, float]
OpeningKind = Literal["window", "door", "opening"]
KINDS: tuple[str, ...] = get_args(OpeningKind)
MOST_WALLS, MOST_OPENINGS = 64, 100
FARTHEST = 300.0  # metres: a hall
SLAB = 0.1  # metres: floor and ceiling
PROUD = 0.015  # metres that a skirting stands out
MARGIN = 0.02  # metres of wall left beside and above openings
LEAST = 0.1  # metres: openings that would be smaller are left out
BAR, BAR_DEPTH, SASH = 0.06, 0.06, 0.75  # metres: a window's frame, and about how wide a casement is
LEAF = 0.04  # metres: thickness of a door
_NEAR = 0.01  # metres between parts of a plan that do not meet
_STRAIGHT = 0.05  # sine of the least turn of a corner

F64 = npt.NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class Opening:
    """A hole in a wall: a window with a frame, a closed door, or a passage.

    `along` is where its middle is, in metres to the right of the wall's middle as seen from inside. Where a
    wall gets too short or too low an opening is moved and cut to fit; one that finds no room is left out
    until there is room again. Raises ValueError for a kind or wall that cannot be.
    """

    kind: OpeningKind = "window"
    wall: int = 0
    along: float = param(
        0.0, "Along", "Middle, to the right of the wall's middle", unit="m", low=-FARTHEST, high=FARTHEST
    )
    sill: float = param(0.9, "Sill", "Height of the lower edge", unit="m", low=0.0, high=FARTHEST)
    width: float = param(1.2, "Width", unit="m", low=LEAST, high=FARTHEST)
    height: float = param(1.4, "Height", unit="m", low=LEAST, high=FARTHEST)

    def __post_init__(self) -> None:
        if self.kind not in KINDS:
            raise ValueError(f"{self.kind!r} is no kind of opening: choose one of {', '.join(KINDS)}")
        if not isinstance(self.wall, int) or isinstance(self.wall, bool) or not 0 <= self.wall < MOST_WALLS:
            raise ValueError(f"an opening's wall is a number from 0 to {MOST_WALLS - 1}, not {self.wall!r}")
        for name, info in param_infos(type(self)).items():
            value = getattr(self, name)
            if not isinstance(value, int | float) or not info.low <= value <= info.high:  # NaN fits nowhere
                raise ValueError(
                    f"a {self.kind}'s {name} of {value!r} m does not fit: {info.low:g} to {info.high:g}"
                )
            object.__setattr__(self, name, float(value))


@dataclass(frozen=True)
class Placed:
    """An opening as it was made to fit: wall, range along it from its first corner, range of heights."""

    opening: int
    kind: OpeningKind
    wall: int
    start: float
    end: float
    low: float
    high: float


@dataclass(frozen=True)
class RoomShape:
    """Everything that a room's mesh follows from, as one hashable value. Metres.

    `corners` are (x, z) on the inner faces of the walls, `without` the walls that are left out. Thickness
    goes outwards. Raises ValueError, in a sentence, where no room can be made of it.
    """

    corners: tuple[Point, ...]
    height: float
    thickness: float
    ceiling: bool = True
    skirting: float = 0.0
    without: frozenset[int] = frozenset()
    openings: tuple[Opening, ...] = ()

    @property
    def baseboard(self) -> float:
        """Height of the skirting as it is made."""
        made = min(self.skirting, self.height / 2)
        return made if made >= 1e-3 else 0.0

    def check(self) -> None:
        """ValueError unless walls of this thickness can stand on this plan."""
        count = len(self.corners)
        if not 3 <= count <= MOST_WALLS:
            raise ValueError(f"a floor plan has 3 to {MOST_WALLS} corners, not {count}")
        plan = np.array(self.corners)
        if not np.isfinite(plan).all():
            raise ValueError("a floor plan's corners must be finite")
        if area(plan) < 0:
            raise ValueError("a floor plan's corners go clockwise as seen from above; these go the other way")
        if clearance(plan) < _NEAR or min(lengths(plan)) < _NEAR:
            raise ValueError("a floor plan's walls must not cross or touch each other")
        normals = outward(plan)
        before = np.roll(normals, 1, axis=0)
        turn = before[:, 0] * normals[:, 1] - before[:, 1] * normals[:, 0]
        straight = np.flatnonzero(np.abs(turn) < _STRAIGHT)
        if len(straight):
            raise ValueError(f"corner {straight[0] + 1} of the floor plan turns too little or comes back")
        for wall in self.without:
            if not 0 <= wall < count:
                raise ValueError(f"there is no wall {wall + 1}: the floor plan has {count}")
        if len(self.openings) > MOST_OPENINGS:
            raise ValueError(f"a room has at most {MOST_OPENINGS} openings, not {len(self.openings)}")
        for opening in self.openings:
            if opening.wall >= count:
                raise ValueError(
                    f"there is no wall {opening.wall + 1} for a {opening.kind}: the floor plan has {count}"
                )
        rims = [self.rim(offset) for offset in (0.0, self.thickness, *((-PROUD,) if self.baseboard else ()))]
        for wall in range(count):
            low, high = span(plan, rims, wall)
            if high - low < 2 * MARGIN:
                raise ValueError(f"wall {wall + 1} is too short for walls {self.thickness:g} m thick")
        for rim in rims[1:]:
            if clearance(rim) < _NEAR:
                raise ValueError(f"there is no place for walls {self.thickness:g} m thick on this floor plan")

    def rim(self, offset: float) -> F64:
        """(N, 2): the corners of the lines `offset` metres outside the inner faces of the walls there are.

        Lines of walls that are left out stay where they are, so that their neighbours end squarely there.
        """
        plan = np.array(self.corners)
        normals = outward(plan)
        far = np.array([0.0 if wall in self.without else offset for wall in range(len(plan))])
        before, far_before = np.roll(normals, 1, axis=0), np.roll(far, 1)
        turn = before[:, 0] * normals[:, 1] - before[:, 1] * normals[:, 0]
        x = (far_before * normals[:, 1] - far * before[:, 1]) / turn
        z = (far * before[:, 0] - far_before * normals[:, 0]) / turn
        return plan + np.stack([x, z], axis=1)

    def placed(self) -> tuple[Placed, ...]:
        """The openings that find room, as they are made; of two in each other's way the first one stays."""
        plan = np.array(self.corners)
        offsets = (0.0, self.thickness, *((-PROUD,) if self.baseboard else ()))
        rims = [self.rim(offset) for offset in offsets]
        long = lengths(plan)
        made: list[Placed] = []
        for number, opening in enumerate(self.openings):
            if opening.wall in self.without:
                continue
            first, last = span(plan, rims, opening.wall)
            first, last = first + MARGIN, last - MARGIN
            width = min(opening.width, last - first)
            start = min(max(long[opening.wall] / 2 + opening.along - width / 2, first), last - width)
            low = 0.0 if opening.sill < MARGIN else opening.sill
            high = min(opening.sill + opening.height, self.height - MARGIN)
            if width < LEAST or high - low < LEAST:
                continue
            one = Placed(number, opening.kind, opening.wall, start, start + width, low, high)
            if not any(_in_the_way(one, other) for other in made):
                made.append(one)
        return tuple(made)


def _in_the_way(one: Placed, other: Placed) -> bool:
    return (
        one.wall == other.wall and one.start < other.end + MARGIN and other.start < one.end + MARGIN
    )  # side by side only: also a window above a door


def outward(plan: F64) -> F64:
    """(N, 2) unit normals of the walls, away from the room."""
    way = along(plan)
    return np.stack([way[:, 1], -way[:, 0]], axis=1)


def along(plan: F64) -> F64:
    """(N, 2) unit directions of the walls."""
    way = np.roll(plan, -1, axis=0) - plan
    return np.asarray(way / np.maximum(np.hypot(*way.T), 1e-300)[:, None])


def lengths(plan: F64) -> list[float]:
    """Lengths of the walls' inner faces."""
    return [float(length) for length in np.hypot(*(np.roll(plan, -1, axis=0) - plan).T)]


def span(plan: F64, rims: list[F64], wall: int) -> tuple[float, float]:
    """The part of a wall, from its first corner, where all its lines have length."""
    way, after = along(plan)[wall], (wall + 1) % len(plan)
    first = max(float((rim[wall] - plan[wall]) @ way) for rim in rims)
    last = min(float((rim[after] - plan[wall]) @ way) for rim in rims)
    return first, last


def wall_names(corners: Sequence[Point]) -> tuple[str, ...]:
    """`Back`, `Right`, `Front` or `Left`, whatever a wall is most; with a number where there are several."""
    most = [
        ("Right" if x > 0 else "Left") if abs(x) > abs(z) else ("Front" if z > 0 else "Back")
        for x, z in outward(np.array(corners, np.float64))
    ]
    return tuple(
        f"{name} {most[: wall + 1].count(name)}" if most.count(name) > 1 else name
        for wall, name in enumerate(most)
    )


def rectangle(width: float, depth: float) -> tuple[Point, ...]:
    """The corners of a rectangle about the origin, its back left one first."""
    x, z = width / 2, depth / 2
    return ((-x, -z), (x, -z), (x, z), (-x, z))


def stretched(plan: tuple[Point, ...], width: float, depth: float) -> tuple[Point, ...]:
    """A plan about the origin whose box is `width` × `depth`; ValueError when it has no extent."""
    made = np.array(plan, np.float64)
    if made.ndim != 2 or made.shape[1] != 2 or len(made) < 3 or not np.isfinite(made).all():
        raise ValueError("a floor plan is a list of at least three corners (x, z)")
    low, high = made.min(axis=0), made.max(axis=0)
    if not (high - low > 0).all() or not math.isfinite(float((high - low).max())):
        raise ValueError("a floor plan must have width and depth")
    placed = ((made - low) / (high - low) - 0.5) * (width, depth)
    return tuple((float(x), float(z)) for x, z in placed)
