"""Where objects, their cuts and receivers are: tables for kernels, culling, and which samples are needed.

Kernels know objects by tables of addresses, a row an object:
selfs (O, 5): slots, starts, counts, data of its self-visibility, its first vertex;
fields (O, 4): table, starts, counts, data of its field;
spheres (O, 4): centre relative to the mesh' origin and radius, 0 for objects that hide nothing.

A receiver leaves out its own object, objects whose bounding sphere lies under its local horizon plane
(V.B), and those that only cover directions in which Ṽ_s is 0 (ours).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from studio_core.jit import carray, kernel, pointer
from studio_core.kernels.directions import direction_set
from studio_core.scene.world_mesh import WorldMesh
from studio_plugins.cuts.paper.height_cuts import bit_at, height_at, value_at
from studio_plugins.cuts.paper.shells import BEYOND, INSIDE, NEIGHBOURS, neighbours

U8 = npt.NDArray[np.uint8]
U16 = npt.NDArray[np.uint16]
I32 = npt.NDArray[np.int32]
I64 = npt.NDArray[np.int64]
F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]

COARSE = 7
"""Whether an object hides directions that count is asked of the 2^7 nodes of this level."""
MISSING, HORIZON, HIDDEN, USED, NEAR, FAR = range(6)
COUNTS = 6
"""Columns of counts: samples not traced yet; objects left out under the horizon, and as hiding nothing;
objects used, of these by receivers nearer than the first and farther than the last sphere."""

_HUGE = 1 << 40
_MARGIN = 1e-4


Arguments: TypeAlias = tuple[I64, F32, F32, I32, I64, I64, F64, int, int, int, bool, bool, F64]
"""What kernels over receivers get: points (P,), rows of positions, normals and object (V,); the tables."""


@dataclass(frozen=True)
class Placement:
    """The tables of the module; `owner` keeps their addresses alive."""

    selfs: I64
    fields: I64
    spheres: F64
    shells: int
    m: int
    k: int
    horizon: bool
    hidden: bool
    owner: object

    def arguments(self, points: I64, mesh: WorldMesh) -> Arguments:
        """For receivers `points` of a mesh, in the kernels' order."""
        receivers = (points, mesh.positions, mesh.normals, mesh.object)
        tables = (self.selfs, self.fields, self.spheres, self.shells, self.m, self.k)
        return (*receivers, *tables, self.horizon, self.hidden, coarse_cones(self.k))


@lru_cache(maxsize=8)
def coarse_cones(k: int) -> F64:
    """(2^7, 5): axis, cosine and sine of the half angle of the coarse nodes' cones."""
    cones = direction_set(k).cones
    nodes = slice(1 << COARSE, 2 << COARSE)
    cosine = cones.cos_half_angle[nodes].astype(np.float64)
    sine = np.sqrt(np.maximum(1 - cosine**2, 0))
    return np.column_stack([cones.axis[nodes].astype(np.float64), cosine, sine])


@kernel
def open_nodes(svc: U8, at: int, count: int, k: int, mask: U8) -> None:
    """mask[c] becomes 1 where Ṽ_s is not 0 everywhere below coarse node c."""
    mask[:] = 0
    shift = k - COARSE
    leaf = 0
    for item in range(count):
        span = 1 << height_at(svc, at, item)
        if value_at(svc, at, count, item) > 0:
            for c in range(leaf >> shift, ((leaf + span - 1) >> shift) + 1):
                mask[c] = 1
        leaf += span


@kernel
def hides_open(dx: float, dy: float, dz: float, radius: float, cones: F64, mask: U8) -> bool:
    """Whether a sphere at (dx, dy, dz) may hide directions below open coarse nodes."""
    square = dx * dx + dy * dy + dz * dz
    if square <= radius * radius:
        return True
    scale = 1.0 / math.sqrt(square)
    sine = radius * scale
    cosine = math.sqrt(1.0 - sine * sine)
    x, y, z = dx * scale, dy * scale, dz * scale
    for c in range(len(mask)):
        if mask[c]:
            along = x * cones[c, 0] + y * cones[c, 1] + z * cones[c, 2]
            if along >= cosine * cones[c, 3] - sine * cones[c, 4] - _MARGIN:
                return True
    return False


@kernel
def bytes_at(address: int) -> U8:
    """The bytes at an address; whoever gave it knows how many."""
    made: U8 = carray(pointer(address), (_HUGE,), np.uint8)
    return made


@kernel
def u16_at(address: int) -> U16:
    """The numbers at an address."""
    made: U16 = carray(pointer(address), (_HUGE,), np.uint16)
    return made


@kernel
def f32_at(address: int) -> F32:
    """The numbers at an address."""
    made: F32 = carray(pointer(address), (_HUGE,), np.float32)
    return made


@kernel
def i32_at(address: int) -> I32:
    """The numbers at an address."""
    made: I32 = carray(pointer(address), (_HUGE,), np.int32)
    return made


@kernel
def i64_at(address: int) -> I64:
    """The numbers at an address."""
    made: I64 = carray(pointer(address), (_HUGE,), np.int64)
    return made


@kernel
def neighbours_of(
    point: F32,
    normal: F32,
    sphere: F64,
    horizon: bool,
    hidden: bool,
    cones: F64,
    mask: U8,
    shells: int,
    m: int,
    samples: I64,
    weights: I32,
    counts: I64,
) -> int:
    """Samples and weights of one object at a receiver; 0 where the object is left out."""
    dx, dy, dz = sphere[0] - point[0], sphere[1] - point[1], sphere[2] - point[2]
    if horizon and normal[0] * dx + normal[1] * dy + normal[2] * dz <= -sphere[3]:
        counts[HORIZON] += 1
        return 0
    if hidden and not hides_open(dx, dy, dz, sphere[3], cones, mask):
        counts[HIDDEN] += 1
        return 0
    count, place = neighbours(-dx, -dy, -dz, sphere[3], shells, m, samples, weights)
    counts[USED] += 1
    counts[NEAR] += 1 if place == INSIDE else 0
    counts[FAR] += 1 if place == BEYOND else 0
    return count


@kernel
def touch(
    start: int,
    stop: int,
    points: I64,
    positions: F32,
    normals: F32,
    object_of: I32,
    selfs: I64,
    fields: I64,
    spheres: F64,
    shells: int,
    m: int,
    k: int,
    horizon: bool,
    hidden: bool,
    cones: F64,
    only: U8,
    counts: I64,
    hit: U8,
) -> None:
    """Asks for the samples that points[start:stop] need of the objects in `only` (O,).

    Marks them −1 in their field's table, adds to counts (P, COUNTS), and sets hit (P,) where an object
    hides anything at all, or may: where a sample is not traced yet.
    """
    samples, weights = np.empty(NEIGHBOURS, np.int64), np.empty(NEIGHBOURS, np.int32)
    mask = np.empty(1 << COARSE, np.uint8)
    for row in range(start, stop):
        p = points[row]
        own = object_of[p]
        slot = i32_at(selfs[own, 0])[p - selfs[own, 4]]
        at = i64_at(selfs[own, 1])[slot]
        nodes = i32_at(selfs[own, 2])[slot]
        if hidden:
            open_nodes(bytes_at(selfs[own, 3]), at, nodes, k, mask)
        for i in range(len(spheres)):
            if i == own or only[i] == 0 or spheres[i, 3] <= 0:
                continue
            count = neighbours_of(
                positions[p],
                normals[p],
                spheres[i],
                horizon,
                hidden,
                cones,
                mask,
                shells,
                m,
                samples,
                weights,
                counts[row],
            )
            table = i32_at(fields[i, 0])
            sizes = i32_at(fields[i, 2])
            starts = i64_at(fields[i, 1])
            records = bytes_at(fields[i, 3])
            for item in range(count):
                entry = table[samples[item]]
                if entry <= 0:
                    table[samples[item]] = -1
                    counts[row, MISSING] += 1
                    hit[row] = 1
                elif sizes[entry - 1] > 1 or bit_at(records, starts[entry - 1], 1, 0) == 0:
                    hit[row] = 1
