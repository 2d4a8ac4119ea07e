"""Kernels of `source_light`: which samples of lights a vertex sees, and the sums of their light.

Samples are those of `light_samples.LightSamples`, places relative to the origin of the mesh. Vertex v looks
at column c in variant[v]; bit c % 64 of word c // 64 of its row belongs to it.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from studio_core.jit import call_address, kernel
from studio_core.kernels.packets import DIRECTION, MASK, OPAQUE, ORIGIN, TFAR, new_packet
from studio_core.kernels.radiance import surface_frame
from studio_core.transport.cells import cell_of

F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]
I8 = npt.NDArray[np.int8]
I32 = npt.NDArray[np.int32]
I64 = npt.NDArray[np.int64]
U8 = npt.NDArray[np.uint8]
U64 = npt.NDArray[np.uint64]

DISTANT, SPOT, AREA = 0, 2, 3
BLOCK = 256
"""Vertices near each other whose rays to one sample are traced together."""
_ONE, _NONE = np.uint64(1), np.uint64(0)


@kernel
def arriving_from(
    kind: int, px: float, py: float, pz: float, lamp: F64, column: int, x: float, y: float, z: float
) -> tuple[float, float, float, float]:
    """Unit direction to a sample at p, and the share of its light that arrives at (x, y, z) face on.

    Rows of lamp (C, 5) are axis and cosines of cone and full cone. (Numbers, not views: these cost more.)
    """
    if kind == DISTANT:
        return px, py, pz, 1.0
    dx, dy, dz = px - x, py - y, pz - z
    scale = 1.0 / max(np.sqrt(dx * dx + dy * dy + dz * dz), 1e-6)
    dx, dy, dz = dx * scale, dy * scale, dz * scale
    weight = scale * scale
    if kind >= SPOT:
        cosine = -(dx * lamp[column, 0] + dy * lamp[column, 1] + dz * lamp[column, 2])
        outer, inner = lamp[column, 3], lamp[column, 4]
        if kind == AREA:
            weight *= max(cosine, 0.0)
        elif inner - outer < 1e-9:
            weight *= 1.0 if cosine >= outer else 0.0
        else:
            t = min(max((cosine - outer) / (inner - outer), 0.0), 1.0)
            weight *= t * t * (3.0 - 2.0 * t)
    return dx, dy, dz, weight


@kernel
def _send(
    occluded8: int,
    scene: int,
    packet: F32,
    valid: I32,
    used: int,
    who: I64,
    seen: U64,
) -> None:
    """Traces the first lanes; sets the bits of those that come through. `who` (8, 2): vertex and column."""
    for lane in range(8):
        valid[lane] = -1 if lane < used else 0
    call_address(occluded8, valid, scene, packet, 0)
    for lane in range(used):
        if packet[TFAR, lane] >= 0:
            seen[who[lane, 0], who[lane, 1] >> 6] |= _ONE << np.uint64(who[lane, 1] & 63)


@kernel
def trace_pairs(
    occluded8: int,
    scene: int,
    order: I32,
    origins: F32,
    positions: F32,
    normals: F32,
    kind: I8,
    variants: I32,
    place: F64,
    lamp: F64,
    shift: F64,
    shorten: float,
    todo: U64,
    seen: U64,
    start: int,
    stop: int,
) -> int:
    """Looks at all pairs that `todo` (V, W) marks of vertices order[start:stop]; their marks go.

    origins (V, 3) are where rays start, about the caster's centre, which lies at −`shift` from the mesh's
    origin. Gives the number of rays.
    """
    packet, valid = new_packet()
    packet.view(np.uint32)[MASK, :] = OPAQUE
    who = np.zeros((8, 2), np.int64)
    used, rays = 0, 0
    columns = len(kind)
    near = np.empty((BLOCK, 9), np.float32)
    marks, row = np.empty(BLOCK, np.uint64), np.empty(BLOCK, np.int32)
    for first in range(start, stop, BLOCK):
        count = min(BLOCK, stop - first)
        for i in range(count):
            v = order[first + i]
            row[i] = variants[v]
            for c in range(3):
                near[i, c], near[i, 3 + c], near[i, 6 + c] = positions[v, c], normals[v, c], origins[v, c]
        for word in range(todo.shape[1]):
            marked = _NONE
            for i in range(count):
                v = order[first + i]
                marks[i] = todo[v, word]
                todo[v, word] = _NONE
                seen[v, word] &= ~marks[i]
                marked |= marks[i]
            for column in range(word * 64, min(word * 64 + 64, columns)):
                bit = _ONE << np.uint64(column & 63)
                if not marked & bit:
                    continue
                kind_of = kind[column]
                for i in range(count):
                    if not marks[i] & bit:
                        continue
                    px, py, pz = place[row[i], column, 0], place[row[i], column, 1], place[row[i], column, 2]
                    x, y, z = float(near[i, 0]), float(near[i, 1]), float(near[i, 2])
                    nx, ny, nz = float(near[i, 3]), float(near[i, 4]), float(near[i, 5])
                    dx, dy, dz, weight = arriving_from(kind_of, px, py, pz, lamp, column, x, y, z)
                    if not (weight > 0.0 and dx * nx + dy * ny + dz * nz > 0.0):
                        continue
                    ox, oy, oz = near[i, 6], near[i, 7], near[i, 8]
                    far = np.float32(np.inf)
                    if kind_of != DISTANT:  # from where the ray starts
                        dx = px + shift[0] - ox
                        dy = py + shift[1] - oy
                        dz = pz + shift[2] - oz
                        length = np.sqrt(dx * dx + dy * dy + dz * dz)
                        if not (length > 0.0 and dx * nx + dy * ny + dz * nz > 0.0):
                            continue
                        dx, dy, dz = dx / length, dy / length, dz / length
                        far = np.float32(max(length - shorten, 0.0))
                    if not abs(ox) + abs(oy) + abs(oz) < np.inf:
                        continue
                    packet[ORIGIN, used], packet[ORIGIN + 1, used], packet[ORIGIN + 2, used] = ox, oy, oz
                    packet[DIRECTION, used] = dx
                    packet[DIRECTION + 1, used] = dy
                    packet[DIRECTION + 2, used] = dz
                    packet[TFAR, used] = far
                    who[used, 0], who[used, 1] = order[first + i], column
                    used += 1
                    rays += 1
                    if used == 8:
                        _send(occluded8, scene, packet, valid, used, who, seen)
                        used = 0
    if used > 0:
        _send(occluded8, scene, packet, valid, used, who, seen)
    return rays


@kernel
def _meet(x: F32, y: F32, z: F32, place: F32, px: float, py: float, pz: float, box: F64, out: U8) -> None:
    """Sets out (64,) where the way from p to a sample passes a box.

    `box` (3, 4) leads to a frame in which it reaches from −1 to 1. x, y, z are the way to the end, or the
    direction where `place` is 0. (No branches: this is vector code.)
    """
    ox = np.float32(box[0, 0] * px + box[0, 1] * py + box[0, 2] * pz + box[0, 3])
    oy = np.float32(box[1, 0] * px + box[1, 1] * py + box[1, 2] * pz + box[1, 3])
    oz = np.float32(box[2, 0] * px + box[2, 1] * py + box[2, 2] * pz + box[2, 3])
    xx, xy, xz = np.float32(box[0, 0]), np.float32(box[0, 1]), np.float32(box[0, 2])
    yx, yy, yz = np.float32(box[1, 0]), np.float32(box[1, 1]), np.float32(box[1, 2])
    zx, zy, zz = np.float32(box[2, 0]), np.float32(box[2, 1]), np.float32(box[2, 2])
    one, small = np.float32(1), np.float32(1e-12)
    for i in range(64):
        dx = xx * x[i] + xy * y[i] + xz * z[i]
        dy = yx * x[i] + yy * y[i] + yz * z[i]
        dz = zx * x[i] + zy * y[i] + zz * z[i]
        ix = one / (dx if abs(dx) > small else small)
        iy = one / (dy if abs(dy) > small else small)
        iz = one / (dz if abs(dz) > small else small)
        ax, bx = (-one - ox) * ix, (one - ox) * ix
        ay, by = (-one - oy) * iy, (one - oy) * iy
        az, bz = (-one - oz) * iz, (one - oz) * iz
        enters = max(max(min(ax, bx), min(ay, by)), max(min(az, bz), np.float32(0)))
        leaves = min(min(max(ax, bx), max(ay, by)), max(az, bz))
        out[i] |= (enters <= leaves) & ((enters <= one) | (place[i] == 0))


@kernel
def _packed(flags: U8) -> np.uint64:
    """64 flags, each 0 or 1, as bits."""
    found = np.uint64(0)
    for part in range(8):
        byte = np.uint64(0)
        for i in range(8):
            byte |= np.uint64(flags[8 * part + i]) << np.uint64(i)
        found |= byte << np.uint64(8 * part)
    return found


@kernel
def mark_moved(
    positions: F32,
    normals: F32,
    variants: I32,
    ends: F32,
    before: F64,
    now: F64,
    boxes_before: F64,
    boxes_now: F64,
    seen: U64,
    todo: U64,
    start: int,
    stop: int,
) -> None:
    """Marks pairs of vertices start … stop that something may have freed or hidden.

    ends (P, 4, 64 W) are places of samples, rows x, y, z and 1 or 0. before and now (M, 4) are spheres,
    centre and radius, about what has moved, and boxes (M, 3, 4) as in `_meet`. What was not seen can only
    have been freed by what was in front of it, what was seen can only be hidden by what is there now.
    """
    x, y, z, above = (
        np.empty(64, np.float32),
        np.empty(64, np.float32),
        np.empty(64, np.float32),
        np.empty(64, np.uint8),
    )
    was, becomes = np.empty(64, np.uint8), np.empty(64, np.uint8)
    moved = len(now)
    for v in range(start, stop):
        px, py, pz = positions[v, 0], positions[v, 1], positions[v, 2]
        nx, ny, nz = normals[v, 0], normals[v, 1], normals[v, 2]
        row = variants[v]
        visible = False
        for m in range(moved):
            b = nx * (before[m, 0] - px) + ny * (before[m, 1] - py) + nz * (before[m, 2] - pz)
            n = nx * (now[m, 0] - px) + ny * (now[m, 1] - py) + nz * (now[m, 2] - pz)
            visible |= b > -before[m, 3] or n > -now[m, 3]
        if not visible:  # all of it below the horizon
            continue
        for word in range(seen.shape[1]):
            first = word * 64
            place = ends[row, 3, first : first + 64]
            for i in range(64):
                one = place[i]
                x[i] = ends[row, 0, first + i] - one * px
                y[i] = ends[row, 1, first + i] - one * py
                z[i] = ends[row, 2, first + i] - one * pz
                above[i] = x[i] * nx + y[i] * ny + z[i] * nz > 0
                was[i] = 0
                becomes[i] = 0
            for m in range(moved):
                _meet(x, y, z, place, px, py, pz, boxes_before[m], was)
                _meet(x, y, z, place, px, py, pz, boxes_now[m], becomes)
            own = seen[v, word]
            todo[v, word] |= _packed(above) & ((own & _packed(becomes)) | (~own & _packed(was)))


@kernel
def repack(old: U64, source: I64, out: U64) -> None:
    """Bits of columns in another order: column c is what source[c] was, 1 where that is −1."""
    for v in range(len(out)):
        for column in range(len(source)):
            was = source[column]
            if was < 0 or (old[v, was >> 6] >> np.uint64(was & 63)) & _ONE:
                out[v, column >> 6] |= _ONE << np.uint64(column & 63)


@kernel
def sum_light(
    positions: F32,
    normals: F32,
    tangents: F32,
    kind: I8,
    variants: I32,
    place: F64,
    lamp: F64,
    light: F32,
    seen: U64,
    row: I32,
    count: I64,
    base: I64,
    incoming: F32,
    slot: I64,
    points: I64,
    irradiance: F32,
    functions: F32,
    start: int,
    stop: int,
) -> None:
    """Irradiance (V, 3) and functions (N, 3) from slot[v] on, of vertices points[start:stop].

    light (P, C, 3) is that of the samples with gains. A vertex of material row r has count[r] functions:
    k at cell c of the direction to the light is incoming[base[r] + c · count[r] + k].
    """
    axes = np.empty((3, 3))
    most = 0
    for r in range(len(count)):
        most = max(most, count[r])
    sums = np.zeros((most, 3))
    for at in range(start, stop):
        v = points[at]
        variant = variants[v]
        x, y, z = float(positions[v, 0]), float(positions[v, 1]), float(positions[v, 2])
        surface_frame(normals[v], tangents[v], axes)
        red, green, blue = 0.0, 0.0, 0.0
        own = count[row[v]] if slot[v] >= 0 else 0
        begin = base[row[v]] if own > 0 else 0
        for k in range(own):
            sums[k, 0] = sums[k, 1] = sums[k, 2] = 0.0
        for word in range(seen.shape[1]):
            bits = seen[v, word]
            column = word * 64 - 1
            while bits:
                column += 1
                here = bits & _ONE
                bits >>= _ONE
                if not here:
                    continue
                dx, dy, dz, weight = arriving_from(
                    kind[column],
                    place[variant, column, 0],
                    place[variant, column, 1],
                    place[variant, column, 2],
                    lamp,
                    column,
                    x,
                    y,
                    z,
                )
                cosine = axes[2, 0] * dx + axes[2, 1] * dy + axes[2, 2] * dz
                if cosine <= 0.0:
                    continue
                weight *= cosine
                r = weight * light[variant, column, 0]
                g = weight * light[variant, column, 1]
                b = weight * light[variant, column, 2]
                red += r
                green += g
                blue += b
                if own > 0:
                    lx = axes[0, 0] * dx + axes[0, 1] * dy + axes[0, 2] * dz
                    ly = axes[1, 0] * dx + axes[1, 1] * dy + axes[1, 2] * dz
                    first = begin + cell_of(lx, ly, cosine) * own
                    for k in range(own):
                        h = incoming[first + k]
                        sums[k, 0] += h * r
                        sums[k, 1] += h * g
                        sums[k, 2] += h * b
        irradiance[v, 0], irradiance[v, 1], irradiance[v, 2] = red, green, blue
        for k in range(own):
            for c in range(3):
                functions[slot[v] + k, c] = sums[k, c]
