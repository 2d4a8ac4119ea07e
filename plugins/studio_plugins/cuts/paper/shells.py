"""Where a visibility cut field is sampled: concentric spheres, and the eight neighbours of a receiver.

Section V.A.1 and figure 4: n spheres around the centre of the object's bounding box, radii uniform from
0.2 r to 10 r (section VI; r is the radius of the sphere about that centre which holds the object), and on
each the same 6·m² places. The paper does not say how those lie; here they are the middles of the cells of
a cube whose faces are cut by equal angles, u = tan(π/4 · a), so that cells differ by 1.4 in width at most.
Cells lie along the axes of the world, so that a field only shifts with its object.

Interpolation (V.A.4) is linear between two spheres and bilinear between four cells of a sphere, across
edges of the cube into the next face; at a corner of the cube, where three cells meet, their weights fill
up for the fourth. The paper is silent about receivers nearer than 0.2 r or farther than 10 r. Nearer, the
innermost sphere is taken in the receiver's direction (in the sample room wrong by 5 % of the unhidden
light; taking such an object for transparent by 50 %). Farther, the outermost sphere is, and what it hides
is weakened by (10 r / d)², by which the solid angle of the object shrinks (wrong by 0.06 %; unweakened, or
transparent, by 0.4 %).
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from studio_core.jit import kernel
from studio_plugins.cuts.paper.operations import ONE

F64 = npt.NDArray[np.float64]
I32 = npt.NDArray[np.int32]
I64 = npt.NDArray[np.int64]

NEAREST, FARTHEST = 0.2, 10.0
"""Radii of the first and the last sphere, in radii of the object (section VI)."""
NEIGHBOURS = 8
WITHIN, INSIDE, BEYOND = 0, 1, 2
"""Where a receiver is: between the spheres, nearer than the first, farther than the last."""

_EIGHTH = math.pi / 4


@kernel
def cell_axis(face: int) -> int:
    """The axis that a face lies on: faces are +x −x +y −y +z −z."""
    return face >> 1


@kernel
def cell_point(face: int, column: int, row: int, m: int, out: F64) -> None:
    """The unit direction (3,) of a cell's middle; columns go along the next axis, rows the one after."""
    axis = cell_axis(face)
    u = math.tan(_EIGHTH * ((2 * column + 1) / m - 1))
    v = math.tan(_EIGHTH * ((2 * row + 1) / m - 1))
    scale = 1.0 / math.sqrt(1.0 + u * u + v * v)
    out[axis] = -scale if face & 1 else scale
    out[(axis + 1) % 3] = u * scale
    out[(axis + 2) % 3] = v * scale


@kernel
def _wrapped(face: int, column: int, row: int, m: int) -> int:
    """Number of a cell within a sphere, at most one step past one edge of its face."""
    if 0 <= column < m and 0 <= row < m:
        return (face * m + row) * m + column
    axis = face >> 1
    sign = -1 if face & 1 else 1
    # the cube in half cells: faces at ±m, middles of cells at odd places (m even) or even ones (m odd)
    if column < 0 or column >= m:
        other, beyond, kept, stays = (axis + 1) % 3, column, (axis + 2) % 3, 2 * row + 1 - m
    else:
        other, beyond, kept, stays = (axis + 2) % 3, row, (axis + 1) % 3, 2 * column + 1 - m
    turned = 2 * other + (1 if beyond < 0 else 0)
    edge = (m - 1) if sign > 0 else 0  # the last cell towards the face we came from
    along = (stays + m - 1) >> 1
    if kept == (other + 1) % 3:
        return (turned * m + edge) * m + along
    return (turned * m + along) * m + edge


@kernel
def neighbours(
    x: float, y: float, z: float, radius: float, shells: int, m: int, samples: I64, weights: I32
) -> tuple[int, int]:
    """Fills samples and weights (8,) for a receiver at (x, y, z) from the centre; returns count and place.

    Sample s of a field: sphere s // (6 m²), then face, row and column. Weights are in units of 1 / `ONE`,
    add up to `ONE` (less for receivers farther than the last sphere), and are positive.
    """
    distance = math.sqrt(x * x + y * y + z * z)
    spacing = (FARTHEST - NEAREST) / (shells - 1)
    at = (distance / radius - NEAREST) / spacing
    place, total = WITHIN, float(ONE)
    if at < 0:
        place, at = INSIDE, 0.0
    elif at > shells - 1:
        place = BEYOND
        far = FARTHEST * radius / distance
        total *= far * far
        at = shells - 1.0
    inner = min(int(at), shells - 2)
    outward = at - inner
    ax, ay, az = abs(x), abs(y), abs(z)
    if ax >= ay and ax >= az:
        face, major, u, v = (0 if x >= 0 else 1), ax, y, z
    elif ay >= az:
        face, major, u, v = (2 if y >= 0 else 3), ay, z, x
    else:
        face, major, u, v = (4 if z >= 0 else 5), az, x, y
    major = max(major, 1e-300)
    a = (math.atan(u / major) / _EIGHTH + 1) * 0.5 * m - 0.5
    b = (math.atan(v / major) / _EIGHTH + 1) * 0.5 * m - 0.5
    column, row = math.floor(a), math.floor(b)
    right, below = a - column, b - row
    corner = 1.0
    for step in range(4):
        c, r = column + (step & 1), row + (step >> 1)
        if (c < 0 or c >= m) and (r < 0 or r >= m):
            missing = (right if step & 1 else 1 - right) * (below if step >> 1 else 1 - below)
            corner = 1.0 / (1.0 - missing)
    count, given = 0, 0
    cells = 6 * m * m
    for shell in range(2):
        share = outward if shell else 1 - outward
        for step in range(4):
            c, r = column + (step & 1), row + (step >> 1)
            if (c < 0 or c >= m) and (r < 0 or r >= m):
                continue
            part = (right if step & 1 else 1 - right) * (below if step >> 1 else 1 - below) * corner
            weight = int(total * share * part + 0.5)
            if weight > 0:
                samples[count] = (inner + shell) * cells + _wrapped(face, c, r, m)
                weights[count] = weight
                given += weight
                count += 1
    # what rounding left over goes to the heaviest
    heaviest = 0
    for item in range(count):
        if weights[item] > weights[heaviest]:
            heaviest = item
    if count > 0:
        weights[heaviest] += int(total + 0.5) - given
    return count, place


@kernel
def sample_point(sample: int, radius: float, shells: int, m: int, out: F64) -> None:
    """Where a sample is, from the centre: (3,)."""
    cells = 6 * m * m
    shell, cell = sample // cells, sample % cells
    face, row, column = cell // (m * m), (cell // m) % m, cell % m
    cell_point(face, column, row, m, out)
    length = radius * (NEAREST + (FARTHEST - NEAREST) * shell / (shells - 1))
    for axis in range(3):
        out[axis] *= length


def sample_points(samples: I64, radius: float, shells: int, m: int) -> F64:
    """(N, 3): where samples are, from the centre of their object."""
    points = np.empty((len(samples), 3))
    for row, sample in enumerate(samples.tolist()):
        sample_point(sample, radius, shells, m, points[row])
    return points


def receivers(points: F64, radius: float, shells: int, m: int) -> tuple[I64, I32, I64]:
    """Neighbours (P, 8), −1 where there are fewer, their weights (P, 8) and the place of each receiver (P,).

    Points (P, 3) are seen from the centre of the object.
    """
    samples = np.full((len(points), NEIGHBOURS), -1, np.int64)
    weights = np.zeros((len(points), NEIGHBOURS), np.int32)
    places = np.empty(len(points), np.int64)
    for row, (x, y, z) in enumerate(np.asarray(points, np.float64).tolist()):
        _, places[row] = neighbours(x, y, z, radius, shells, m, samples[row], weights[row])
    return samples, weights, places
