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
U64 = npt.NDArray[np.uint64]

DISTANT, SPOT, AREA = 0, 2, 3
BLOCK = 256
"""Vertices near each other whose rays to one sample are traced together."""
_ONE, _NONE = np.uint64(1), np.uint64(0)


@kernel
def light_at(
    kind: int, place: F64, axis: F64, cone: F64, x: float, y: float, z: float
) -> tuple[float, float, float, float]:
    """Unit direction from a place to a sample, and the share of its light that arrives there face on."""
    if kind == DISTANT:
        return place[0], place[1], place[2], 1.0
    dx, dy, dz = place[0] - x, place[1] - y, place[2] - z
    distance = max(np.sqrt(dx * dx + dy * dy + dz * dz), 1e-6)
    scale = 1.0 / distance
    dx, dy, dz = dx * scale, dy * scale, dz * scale
    weight = scale * scale
    if kind >= SPOT:
        cosine = -(dx * axis[0] + dy * axis[1] + dz * axis[2])
        if kind == AREA:
            weight *= max(cosine, 0.0)
        elif cone[1] - cone[0] < 1e-9:
            weight *= 1.0 if cosine >= cone[0] else 0.0
        else:
            t = min(max((cosine - cone[0]) / (cone[1] - cone[0]), 0.0), 1.0)
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
    axis: F64,
    cone: F64,
    shift: F64,
    shorten: float,
    todo: U64,
    seen: U64,
    counts: I64,
    start: int,
    stop: int,
) -> None:
    """Looks at all pairs that `todo` (V, W) marks of vertices order[start:stop]; their marks go.

    origins (V, 3) are where rays start, about the caster's centre, which lies at −`shift` from the mesh's
    origin. counts[v] gets the number of rays.
    """
    packet, valid = new_packet()
    packet.view(np.uint32)[MASK, :] = OPAQUE
    who = np.zeros((8, 2), np.int64)
    used = 0
    columns = len(kind)
    for first in range(start, stop, BLOCK):
        last = min(first + BLOCK, stop)
        for word in range(todo.shape[1]):
            marked = _NONE
            for at in range(first, last):
                v = order[at]
                marked |= todo[v, word]
                seen[v, word] &= ~todo[v, word]
            for column in range(word * 64, min(word * 64 + 64, columns)):
                bit = _ONE << np.uint64(column & 63)
                if not marked & bit:
                    continue
                kind_of, axis_of, cone_of = kind[column], axis[column], cone[column]
                for at in range(first, last):
                    v = order[at]
                    if not todo[v, word] & bit:
                        continue
                    target = place[variants[v], column]
                    x, y, z = float(positions[v, 0]), float(positions[v, 1]), float(positions[v, 2])
                    nx, ny, nz = float(normals[v, 0]), float(normals[v, 1]), float(normals[v, 2])
                    dx, dy, dz, weight = light_at(kind_of, target, axis_of, cone_of, x, y, z)
                    if not (weight > 0.0 and dx * nx + dy * ny + dz * nz > 0.0):
                        continue
                    ox, oy, oz = origins[v, 0], origins[v, 1], origins[v, 2]
                    far = np.float32(np.inf)
                    if kind_of != DISTANT:  # from where the ray starts
                        dx = target[0] + shift[0] - ox
                        dy = target[1] + shift[1] - oy
                        dz = target[2] + shift[2] - oz
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
                    who[used, 0], who[used, 1] = v, column
                    counts[v] += 1
                    used += 1
                    if used == 8:
                        _send(occluded8, scene, packet, valid, used, who, seen)
                        used = 0
            for at in range(first, last):
                todo[order[at], word] = _NONE
    if used > 0:
        _send(occluded8, scene, packet, valid, used, who, seen)


@kernel
def _meets(dx: float, dy: float, dz: float, far: float, x: float, y: float, z: float, sphere: F64) -> bool:
    """Whether the way from (x, y, z) along a unit direction as far as `far` passes a sphere (4,)."""
    cx, cy, cz, square = sphere[0] - x, sphere[1] - y, sphere[2] - z, sphere[3] * sphere[3]
    along = cx * dx + cy * dy + cz * dz
    apart = cx * cx + cy * cy + cz * cz
    if apart <= square:
        return True
    if along <= 0.0 or apart - along * along > square:
        return False
    return bool(along <= far or apart - 2.0 * along * far + far * far <= square)


@kernel
def mark_moved(
    positions: F32,
    normals: F32,
    kind: I8,
    variants: I32,
    place: F64,
    axis: F64,
    cone: F64,
    before: F64,
    now: F64,
    seen: U64,
    todo: U64,
    start: int,
    stop: int,
) -> None:
    """Marks pairs of vertices start … stop that something may have freed or hidden.

    before and now (M, 4) are spheres, centre and radius, about what has moved. What was not seen can only
    have been freed by what was in front of it, what was seen can only be hidden by what is there now.
    """
    columns = len(kind)
    for v in range(start, stop):
        variant = variants[v]
        x, y, z = float(positions[v, 0]), float(positions[v, 1]), float(positions[v, 2])
        nx, ny, nz = float(normals[v, 0]), float(normals[v, 1]), float(normals[v, 2])
        for column in range(columns):
            word, bit = column >> 6, _ONE << np.uint64(column & 63)
            if todo[v, word] & bit:
                continue
            target = place[variant, column]
            far = np.inf
            if kind[column] == DISTANT:
                dx, dy, dz = target[0], target[1], target[2]
                if dx * nx + dy * ny + dz * nz <= 0.0:
                    continue
            else:
                dx, dy, dz = target[0] - x, target[1] - y, target[2] - z
                if dx * nx + dy * ny + dz * nz <= 0.0:
                    continue
                far = max(np.sqrt(dx * dx + dy * dy + dz * dz), 1e-6)
                dx, dy, dz = dx / far, dy / far, dz / far
            spheres = now if seen[v, word] & bit else before
            for sphere in range(len(spheres)):
                if _meets(dx, dy, dz, far, x, y, z, spheres[sphere]):
                    todo[v, word] |= bit
                    break


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
    axis: F64,
    cone: F64,
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
                dx, dy, dz, weight = light_at(
                    kind[column], place[variant, column], axis[column], cone[column], x, y, z
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
