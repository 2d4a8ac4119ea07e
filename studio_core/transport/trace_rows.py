"""Tracing receivers' rays: whole rows, or only the rays whose hit may be another since objects moved.

After a move a ray of a receiver that stayed is traced again when it had met a moved object, or when a moved
object now stands in its way (`transport.moved_rays`). All other rays keep their hit.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from studio_core.jit import call_address, kernel
from studio_core.kernels.packets import (
    DIRECTION,
    MASK,
    OPAQUE,
    ORIGIN,
    TFAR,
    clear_hits,
    new_packet,
)
from studio_core.kernels.radiance import surface_frame
from studio_core.transport.hits import BLACK, GONE, NO_OBJECT, NOTHING, half_bits
from studio_core.transport.moved_rays import TRACE, answer, ask
from studio_core.transport.settle import settle

F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]
I32 = npt.NDArray[np.int32]
I64 = npt.NDArray[np.int64]
U8 = npt.NDArray[np.uint8]
U16 = npt.NDArray[np.uint16]
U32 = npt.NDArray[np.uint32]
U64 = npt.NDArray[np.uint64]

BELOW = -0.1
"""Cosine with the geometric normal below which rays are not followed: shading normals of smooth, closed rooms
differ from geometric ones by less, and their rays must all meet something."""
COUNTS = 2
TRACED, ASKED = range(COUNTS)
"""Columns of counts: rays traced against the scene, and against one object alone."""


@kernel
def _prepare(
    v: int,
    column: int,
    local: bool,
    positions: F32,
    frames: F32,
    geometric: F32,
    inset: F32,
    epsilon: float,
    scratch: tuple[F32, F32, F64],
    axes: F64,
    origin: F64,
) -> bool:
    """Frame and start of a vertex' rays, relative to the mesh's origin; whether they are numbers."""
    normal, tangent, turned = scratch
    if local:
        for k in range(3):
            normal[k] = frames[v, k]
        for k in range(4):
            tangent[k] = frames[v, 3 + k]
        surface_frame(normal, tangent, turned)
    size = 0.0
    for k in range(3):
        for axis in range(3):
            axes[column, k, axis] = turned[k, axis] if local else (1.0 if k == axis else 0.0)
            size += abs(axes[column, k, axis])
        at = float(positions[v, k]) + epsilon * float(geometric[v, k]) + float(inset[v, k])
        origin[column, k] = at
        size += abs(at)
    return bool(size < np.inf)


@kernel
def _follow(
    intersect8: int,
    scene: int,
    shift: F64,
    first: int,
    count: int,
    which: I64,
    receiver: I64,
    geometric: F32,
    stream: I64,
    axes: F64,
    origin: F64,
    variant: I32,
    directions: F32,
    face_start: I64,
    corners: U32,
    turns: F32,
    vertex_offsets: I64,
    frames: F32,
    packet: F32,
    words: U32,
    valid: I32,
    word: U32,
    number: F32,
    marks: U8,
    vertex: U32,
    cell: U16,
    distance: U16,
    touched: npt.NDArray[np.bool_],
) -> int:
    """Traces the marked rays and writes what they meet; how many.

    A ray that a shading normal lets leave well into the surface itself meets nothing.
    """
    rays = directions.shape[1]
    row_of, ray_of, met = np.empty(8, np.int64), np.empty(8, np.int64), np.empty(8, np.int64)
    along = np.empty((8, 3))
    used, traced = 0, 0
    for column in range(count + 1):
        last = column == count
        for ray in range(1 if last else rays):
            if not last:
                if marks[column, ray] != TRACE:
                    continue
                row = which[first + column]
                p = variant[row]
                x, y, z = directions[p, ray, 0], directions[p, ray, 1], directions[p, ray, 2]
                size, clear = 0.0, 0.0
                for axis in range(3):
                    along[used, axis] = (
                        axes[column, 0, axis] * x + axes[column, 1, axis] * y + axes[column, 2, axis] * z
                    )
                    size += abs(along[used, axis])
                    clear += along[used, axis] * geometric[receiver[row], axis]
                    packet[ORIGIN + axis, used] = origin[column, axis] + shift[axis]
                    packet[DIRECTION + axis, used] = along[used, axis]
                packet[TFAR, used] = np.inf
                valid[used] = -1 if 0.0 < size < np.inf and clear > BELOW else 0
                row_of[used], ray_of[used] = row, ray
                used += 1
                traced += 1
            if used == 8 or (last and used > 0):
                for lane in range(used, 8):
                    valid[lane] = 0
                clear_hits(packet)
                call_address(intersect8, valid, scene, packet, 0)
                settle(
                    used,
                    row_of,
                    ray_of,
                    along,
                    packet,
                    words,
                    valid,
                    stream,
                    face_start,
                    corners,
                    turns,
                    vertex_offsets,
                    frames,
                    word,
                    number,
                    met,
                    vertex,
                    cell,
                    distance,
                    touched,
                )
                used = 0
    return traced


@kernel
def update_rows(
    start: int,
    stop: int,
    which: I64,
    state: I64,
    moved_start: I64,
    moved_items: I64,
    whole: npt.NDArray[np.bool_],
    local: bool,
    receiver: I64,
    variant: I32,
    stream: I64,
    directions: F32,
    positions: F32,
    frames: F32,
    geometric: F32,
    inset: F32,
    thing_of: I32,
    vertex_offsets: I64,
    shift: F64,
    epsilon: float,
    intersect8: int,
    occluded8: int,
    scene: int,
    face_start: I64,
    corners: U32,
    turns: F32,
    part_scene: I64,
    from_mesh: F64,
    centre: F64,
    radius: F64,
    vertex: U32,
    cell: U16,
    distance: U16,
    things_seen: U64,
    holes: npt.NDArray[np.bool_],
    black: U16,
    touched: npt.NDArray[np.bool_],
    counts: I64,
) -> None:
    """Brings rows which[start:stop] to the present; counts (COUNTS,) is added to.

    state[i] says what which[i] was last traced in: `whole` is everything to be traced, else the objects
    moved_items[moved_start[state]:moved_start[state + 1]] stood elsewhere.
    directions (P, N, 3) are in the receivers' frames if `local`, else in the world; variant and stream (R,)
    are the pattern and the chance of a row, receiver (R,) its vertex. frames (V, 8) and corners (slots, 6)
    are as in `settle`.
    part_scene, from_mesh (n, 3, 4), centre (n, 3) relative to the mesh's origin and radius are the objects
    alone; shift leads from the mesh's origin to the caster's centre.
    Of `holes` (R,) the rays that met what is GONE are traced too. things_seen (R,) gets a bit for each object
    that a row meets (its number mod 64), black (R,) how many rays met the inside of a closed part, touched
    (R,) whether a hit is another.
    """
    count = stop - start
    rays = directions.shape[1]
    packet, valid = new_packet()
    words = packet.view(np.uint32)
    words[MASK, :] = OPAQUE
    word = np.zeros(1, np.uint32)
    number = word.view(np.float32)
    scratch = (np.empty(3, np.float32), np.empty(4, np.float32), np.empty((3, 3)))
    marks = np.zeros((count, rays), np.uint8)
    axes, origin = np.empty((count, 3, 3)), np.empty((count, 3))
    good = np.empty(count, np.bool_)
    marked = np.zeros(count, np.bool_)
    pending = np.zeros(len(part_scene), np.bool_)
    moved_here = np.zeros(len(part_scene), np.bool_)
    before = np.int64(-1)
    for column in range(count):
        row = which[start + column]
        good[column] = _prepare(
            receiver[row], column, local, positions, frames, geometric, inset, epsilon, scratch, axes, origin
        )
        s = state[start + column]
        if s != before:  # what moved since
            moved_here[:] = False
            bits = np.uint64(0)
            for k in range(moved_start[s], moved_start[s + 1]):
                moved_here[moved_items[k]] = True
                pending[moved_items[k]] = True
                bits |= np.uint64(1) << np.uint64(moved_items[k] & 63)
            before = s
        if not good[column]:
            for ray in range(rays):
                vertex[row, ray], cell[row, ray], distance[row, ray] = (
                    NOTHING,
                    0,
                    half_bits(np.float32(np.inf), word, number),
                )
            continue
        if whole[s] or moved_here[thing_of[receiver[row]]]:
            marks[column, :] = TRACE
            marked[column] = True
        elif holes[row] or things_seen[row] & bits != np.uint64(0):
            for ray in range(rays):
                met = np.int64(vertex[row, ray])
                if met == NOTHING:
                    continue
                thing = np.int64(NO_OBJECT)
                if met != GONE:
                    thing = np.int64(cell[row, ray]) if met == BLACK else np.int64(thing_of[met])
                if thing >= NO_OBJECT or moved_here[thing]:
                    marks[column, ray] = TRACE
                    marked[column] = True
    for other in range(len(part_scene)):
        if not pending[other] or part_scene[other] == 0:
            continue
        found = 0
        for column in range(count):
            row = which[start + column]
            s = state[start + column]
            if not good[column] or whole[s]:
                continue
            for k in range(moved_start[s], moved_start[s + 1]):
                if moved_items[k] == other:
                    asked = ask(
                        row,
                        column,
                        local,
                        other,
                        centre,
                        radius,
                        epsilon,
                        axes,
                        origin,
                        variant,
                        directions,
                        distance,
                        word,
                        number,
                        marks,
                    )
                    found += asked
                    if asked > 0:
                        marked[column] = True
        if found > 0:
            counts[ASKED] += found
            answer(
                occluded8,
                part_scene[other],
                other,
                from_mesh,
                start,
                count,
                which,
                axes,
                origin,
                variant,
                directions,
                distance,
                epsilon,
                packet,
                valid,
                word,
                number,
                marks,
            )
    counts[TRACED] += _follow(
        intersect8,
        scene,
        shift,
        start,
        count,
        which,
        receiver,
        geometric,
        stream,
        axes,
        origin,
        variant,
        directions,
        face_start,
        corners,
        turns,
        vertex_offsets,
        frames,
        packet,
        words,
        valid,
        word,
        number,
        marks,
        vertex,
        cell,
        distance,
        touched,
    )
    for column in range(count):
        row = which[start + column]
        if not (marked[column] or whole[state[start + column]]):
            continue
        bits, inside = np.uint64(0), 0
        for ray in range(rays):
            met = np.int64(vertex[row, ray])
            if met == NOTHING:
                continue
            if met == BLACK:
                inside += 1
            thing = np.int64(cell[row, ray]) if met == BLACK else np.int64(thing_of[met])
            bits |= np.uint64(1) << np.uint64(thing & 63) if thing < NO_OBJECT else ~np.uint64(0)
        things_seen[row], black[row] = bits, inside
