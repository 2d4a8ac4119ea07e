"""What a traced packet met, written into rows: a vertex, by chance one of three; its cell; the distance."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from studio_core.jit import kernel
from studio_core.kernels.packets import GEOMETRY, INSTANCE, NO_HIT, NORMAL, PRIMITIVE, TFAR, U, V
from studio_core.scene.shading_mesh import NO_BACK
from studio_core.transport.cells import cell_of
from studio_core.transport.hits import BLACK, NO_OBJECT, NOTHING, half_bits

F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]
I32 = npt.NDArray[np.int32]
I64 = npt.NDArray[np.int64]
U16 = npt.NDArray[np.uint16]
U32 = npt.NDArray[np.uint32]

_MIX = np.uint64(0x9E3779B97F4A7C15)
_BLEND = np.uint64(0xD1B54A32D192ED03)
_STIR = np.uint64(0xD6E8FEB86659FD93)
_HALF_WORD = np.uint64(32)


@kernel
def chance(stream: int, ray: int) -> float:
    """A number in [0, 1) of its own for every ray of every stream."""
    z = np.uint64(stream) * _MIX + np.uint64(ray + 1) * _BLEND
    z = (z ^ (z >> _HALF_WORD)) * _STIR
    z = (z ^ (z >> _HALF_WORD)) * _STIR
    return np.float64(z >> np.uint64(40)) * (1.0 / 16777216.0)


@kernel
def _far() -> np.float32:
    return np.float32(np.inf)


@kernel
def settle(
    used: int,
    row_of: I64,
    ray_of: I64,
    along: F64,
    packet: F32,
    words: U32,
    valid: I32,
    stream: I64,
    face_start: I64,
    corners: U32,
    turns: F32,
    vertex_offsets: I64,
    frames: F32,
    word: U32,
    number: F32,
    met: I64,
    vertex: U32,
    cell: U16,
    distance: U16,
    touched: npt.NDArray[np.bool_],
) -> None:
    """Writes what the rays of a packet met; `met` (8,) is scratch.

    corners (slots, 6): the front and the back vertices of each face in the order of the caster, counted
    within their object; frames (V, 8): normal and tangent of each vertex.
    """
    for lane in range(used):  # in two loops, so that reads of one lane do not wait for those of another
        met[lane] = NOTHING
        if valid[lane] != 0 and words[GEOMETRY, lane] != NO_HIT:
            thing = np.int64(words[INSTANCE, lane])
            slot = face_start[thing, np.int64(words[GEOMETRY, lane])] + np.int64(words[PRIMITIVE, lane])
            dx, dy, dz = along[lane, 0], along[lane, 1], along[lane, 2]
            facing = 0.0  # the sign of the world's normal along the ray: Ng · (Mᵀ d)
            for axis in range(3):
                turned = turns[thing, 0, axis] * dx + turns[thing, 1, axis] * dy + turns[thing, 2, axis] * dz
                facing += np.float64(packet[NORMAL + axis, lane]) * turned
            drawn = chance(stream[row_of[lane]], ray_of[lane])
            u, v = packet[U, lane], packet[V, lane]
            corner = (
                np.int64(drawn < u + v) + np.int64(drawn < v) + (np.int64(0) if facing < 0 else np.int64(3))
            )
            found = np.int64(corners[slot, corner])
            met[lane] = found + vertex_offsets[thing] if found != NO_BACK else np.int64(BLACK)
    for lane in range(used):
        row, ray = row_of[lane], ray_of[lane]
        found, seen, far = met[lane], 0, _far()
        if found != NOTHING:
            far = packet[TFAR, lane]
            if found == BLACK:
                thing = np.int64(words[INSTANCE, lane])
                seen = int(thing) if thing < NO_OBJECT else NO_OBJECT
            else:
                dx, dy, dz = along[lane, 0], along[lane, 1], along[lane, 2]
                nx, ny, nz = frames[found, 0], frames[found, 1], frames[found, 2]
                tx, ty, tz = frames[found, 3], frames[found, 4], frames[found, 5]
                sense = -frames[found, 6]
                seen = cell_of(
                    -(tx * dx + ty * dy + tz * dz),
                    sense * ((ny * tz - nz * ty) * dx + (nz * tx - nx * tz) * dy + (nx * ty - ny * tx) * dz),
                    -(nx * dx + ny * dy + nz * dz),
                )
        if vertex[row, ray] != found or cell[row, ray] != seen:
            touched[row] = True
            vertex[row, ray], cell[row, ray] = found, seen
        distance[row, ray] = half_bits(far, word, number)
