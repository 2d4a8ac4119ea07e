"""Simple polygons in a plane: checks, and triangles that use every corner, also those on straight lines."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

F64 = npt.NDArray[np.float64]
Corner = tuple[float, float]
Triangle = tuple[int, int, int]

_FLAT = 1e-9  # of the squared size of the polygon: less area than that is a line


def area(points: npt.ArrayLike) -> float:
    """Signed area of a polygon (N, 2); positive counter-clockwise."""
    corners = np.asarray(points, np.float64)
    ahead = np.roll(corners, -1, axis=0)
    return float((corners[:, 0] * ahead[:, 1] - corners[:, 1] * ahead[:, 0]).sum() / 2)


def clearance(points: npt.ArrayLike) -> float:
    """Least distance between two sides (of N, 2) that do not meet in a corner; 0 where sides cross.

    Infinite for a triangle.
    """
    a = np.asarray(points, np.float64)
    b = np.roll(a, -1, axis=0)
    count = len(a)
    one, other = np.triu_indices(count, 2)
    apart = (other - one) % count != count - 1
    one, other = one[apart], other[apart]
    if not len(one):
        return float("inf")

    def side(p: F64, q: F64, r: F64) -> F64:
        d, e = q - p, r - p
        return np.asarray(d[:, 0] * e[:, 1] - d[:, 1] * e[:, 0])

    crossing = (side(a[one], b[one], a[other]) * side(a[one], b[one], b[other]) < 0) & (
        side(a[other], b[other], a[one]) * side(a[other], b[other], b[one]) < 0
    )
    if crossing.any():
        return 0.0
    pairs = ((a[one], other), (b[one], other), (a[other], one), (b[other], one))
    return min(float(_to_side(point, a[at], b[at]).min()) for point, at in pairs)


def _to_side(point: F64, a: F64, b: F64) -> F64:
    way = b - a
    share = ((point - a) * way).sum(axis=1) / np.maximum((way * way).sum(axis=1), 1e-300)
    nearest = a + np.clip(share, 0, 1)[:, None] * way
    return np.asarray(np.hypot(*(point - nearest).T))


def triangulate(points: Sequence[Sequence[float]]) -> list[Triangle]:
    """Counter-clockwise triangles that fill a simple counter-clockwise polygon (N, 2).

    Every corner is used and none is added, so that neighbours along a shared line stay joined. The best
    ears are cut first (Meisters 1975), then diagonals are flipped where that makes the triangles rounder
    (Lawson 1977). Raises ValueError when the polygon encloses nothing or crosses itself.
    """
    count = len(points)
    if count < 3:
        raise ValueError("a polygon needs three corners")
    mean = [sum(float(point[k]) for point in points) / count for k in (0, 1)]
    at = [(float(x) - mean[0], float(y) - mean[1]) for x, y in points]
    least = _FLAT * max(x * x + y * y for x, y in at)
    ring = list(range(count))
    quality = [_ear(at, ring, place, least) for place in range(count)]
    made: list[Triangle] = []
    while len(ring) > 3:
        best = max(ring, key=quality.__getitem__)
        if quality[best] <= 0:
            raise ValueError("a polygon must not cross itself")
        place = ring.index(best)
        made.append((ring[place - 1], best, ring[(place + 1) % len(ring)]))
        del ring[place]
        for near in ((place - 1) % len(ring), place % len(ring)):
            quality[ring[near]] = _ear(at, ring, near, least)
    if _ear(at, ring, 1, least) <= 0:
        raise ValueError("a polygon must enclose something")
    made.append((ring[0], ring[1], ring[2]))
    return _flipped(at, made)


def _ear(at: list[Corner], ring: list[int], place: int, least: float) -> float:
    """How round the triangle at a corner is, 0 where cutting it off would not leave a polygon."""
    count = len(ring)
    a, b, c = at[ring[place - 1]], at[ring[place]], at[ring[(place + 1) % count]]
    if _cross(a, b, c) <= least:
        return 0.0
    for step in range(2, count - 1):
        p = at[ring[(place + step) % count]]
        if _cross(a, b, p) >= -least and _cross(b, c, p) >= -least and _cross(c, a, p) >= -least:
            return 0.0
    return _roundness(a, b, c)


def _cross(a: Corner, b: Corner, c: Corner) -> float:
    """Twice the signed area."""
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])


def _roundness(a: Corner, b: Corner, c: Corner) -> float:
    """Area over the squares of the sides."""
    sides = 0.0
    for p, q in ((a, b), (b, c), (c, a)):
        x, y = p[0] - q[0], p[1] - q[1]
        sides += x * x + y * y
    return _cross(a, b, c) / sides if sides > 0 else 0.0


def _flipped(at: list[Corner], triangles: list[Triangle]) -> list[Triangle]:
    """Diagonals exchanged until no exchange makes the worse of the two triangles rounder."""
    made = list(triangles)
    for _ in range(len(made)):  # an ordinary plan needs few rounds: a bound against rounding
        owner = {(t[k], t[(k + 1) % 3]): (n, t[k - 1]) for n, t in enumerate(made) for k in range(3)}
        used: set[int] = set()
        for (a, b), (one, c) in owner.items():
            if a > b or (b, a) not in owner:
                continue
            other, d = owner[b, a]
            if one in used or other in used:
                continue
            now = min(_roundness(at[a], at[b], at[c]), _roundness(at[b], at[a], at[d]))
            new = min(_roundness(at[a], at[d], at[c]), _roundness(at[d], at[b], at[c]))
            if new > now + 1e-9:
                made[one], made[other] = (a, d, c), (d, b, c)
                used |= {one, other}
        if not used:
            break
    return made
