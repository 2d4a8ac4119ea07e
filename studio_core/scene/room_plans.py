"""Floor plans that have a name, and what becomes of walls when a room gets another plan."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from studio_core.scene.room_shape import Opening, Point, outward

CORNERS: dict[str, tuple[int, int]] = {
    "back left": (-1, -1),
    "back right": (1, -1),
    "front right": (1, 1),
    "front left": (-1, 1),
}
"""The corners of a rectangle as seen from above: signs of x and z."""
_SAME = 1e-6  # of the size of a plan


def l_plan(
    width: float, depth: float, cut_width: float, cut_depth: float, corner: str = "front right"
) -> tuple[Point, ...]:
    """A rectangle without a piece at one of its `CORNERS`; its first wall is the one at the back.

    Raises ValueError unless something is left.
    """
    if not (0 < cut_width < width and 0 < cut_depth < depth):
        raise ValueError("what is cut from a room must be smaller than the room")
    if corner not in CORNERS:
        raise ValueError(f"a room has no corner {corner!r}: choose one of {', '.join(CORNERS)}")
    x, z = width / 2, depth / 2
    inner = (x - cut_width, z - cut_depth)
    base = [(-x, -z), (x, -z), (x, inner[1]), inner, (inner[0], z), (-x, z)]
    across, deep = CORNERS[corner]
    made = [(across * px, deep * pz) for px, pz in base]
    if across * deep < 0:  # a mirror image runs the other way round
        made.reverse()
    ahead = [*made[1:], made[0]]
    backs = [k for k in range(6) if made[k][1] == ahead[k][1] and ahead[k][0] > made[k][0]]
    first = min(backs, key=lambda k: made[k][1])
    return tuple(made[first:] + made[:first])


@dataclass(frozen=True)
class Cut:
    """What an L lacks of its rectangle, in metres."""

    corner: str
    width: float
    depth: float


def l_cut(plan: Sequence[Point]) -> Cut | None:
    """What a plan lacks of its box, if it is an L; None of any other plan."""
    points = np.array(plan, np.float64).reshape(-1, 2)
    if len(points) != 6:
        return None
    low, high = points.min(axis=0), points.max(axis=0)
    size = high - low
    middle = (low + high) / 2
    near = _SAME * float(size.max())
    missing = [
        (name, middle + np.array(signs) * size / 2)
        for name, signs in CORNERS.items()
        if np.hypot(*(points - (middle + np.array(signs) * size / 2)).T).min() > near
    ]
    if len(missing) != 1:
        return None
    name, corner = missing[0]
    inner = ((points > low + near) & (points < high - near)).all(axis=1)
    sides = np.abs(np.roll(points, -1, axis=0) - points)
    if inner.sum() != 1 or sides.min(axis=1).max() > near:
        return None
    cut = np.abs(points[inner][0] - corner)
    return Cut(name, float(cut[0]), float(cut[1]))


def carried(
    openings: Sequence[Opening], without: Sequence[int], before: Sequence[Point], after: Sequence[Point]
) -> tuple[tuple[Opening, ...], tuple[int, ...]]:
    """Openings and left-out walls of one plan on another: on the nearest wall that looks the same way.

    What looks a way that no wall of the new plan does goes to the nearest wall.
    """
    old, new = np.array(before, np.float64), np.array(after, np.float64)
    facing = outward(old) @ outward(new).T
    middles = [0.5 * (plan + np.roll(plan, -1, axis=0)) for plan in (old, new)]
    apart = np.hypot(*(middles[0][:, None] - middles[1][None]).transpose(2, 0, 1))
    far = apart + 1e6 * (facing < 0.9)
    goes = [int(wall) for wall in far.argmin(axis=1)]
    moved = tuple(dataclasses.replace(one, wall=goes[one.wall]) for one in openings)
    return moved, tuple(sorted({goes[wall] for wall in without}))
