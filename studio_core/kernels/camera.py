"""Samples of a picture: their directions, and what they see first.

A picture of W × H pixels has n × n samples in each; sample s belongs to pixel s // n² (row by row from the
top left) and lies at (s % n², from the top left) in it. A pinhole is 16 numbers: W, n, tangent of half the
angle across and up, H, then the 3×3 rotation world from camera, row by row, then TOP and WHOLE: the picture
is rows TOP … TOP + H − 1 of one that has WHOLE rows, to which the angles belong.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from studio_core.jit import call_address, kernel
from studio_core.kernels.packets import (
    DIRECTION,
    GEOMETRY,
    INSTANCE,
    MASK,
    NO_HIT,
    ORIGIN,
    PRIMITIVE,
    TFAR,
    TNEAR,
    U,
    V,
    clear_hits,
    new_packet,
)

F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]
I32 = npt.NDArray[np.int32]
I64 = npt.NDArray[np.int64]

PINHOLE = 16
TOP, WHOLE = 14, 15
TILE_WIDTH, TILE_HEIGHT = 4, 2
COHERENT = 1 << 16  # RTC_RAY_QUERY_FLAG_COHERENT


@kernel
def sample_direction(pinhole: F64, sample: int, out: F32) -> None:
    """The unit world direction of a sample."""
    width, n = int(pinhole[0]), int(pinhole[1])
    pixel, inner = sample // (n * n), sample % (n * n)
    x = (pixel % width) * n + inner % n
    y = (int(pinhole[TOP]) + pixel // width) * n + inner // n
    a = ((x + 0.5) / (width * n) * 2 - 1) * pinhole[2]
    b = (1 - (y + 0.5) / (pinhole[WHOLE] * n) * 2) * pinhole[3]
    scale = 1.0 / np.sqrt(a * a + b * b + 1.0)
    a, b, c = a * scale, b * scale, -scale
    for axis in range(3):
        row = 5 + 3 * axis
        out[axis] = pinhole[row] * a + pinhole[row + 1] * b + pinhole[row + 2] * c


@kernel
def sample_directions(pinhole: F64, samples: I64, out: F32) -> None:
    """Directions (N, 3) of the named samples."""
    for i in range(len(samples)):
        sample_direction(pinhole, samples[i], out[i])


@kernel
def sample_at(x: int, y: int, columns: int, n: int) -> int:
    """The sample in column x and row y of the grid of all samples, which is `columns` wide."""
    return ((y // n) * (columns // n) + x // n) * n * n + (y % n) * n + x % n


@kernel
def coherent_arguments() -> Any:
    """RTCIntersectArguments that say the rays of a packet stay together; our own tracer ignores them.

    Embree then follows one frustum where it would follow eight rays: half the time, the same hits.
    """
    words = np.zeros(16, np.int32)  # flags, features, then pointers to nothing
    words[0], words[1] = COHERENT, -1
    return words


@kernel
def tiles_across(pinhole: F64) -> int:
    """Packets of 4 × 2 samples in a row of them."""
    return (int(pinhole[0]) * int(pinhole[1]) + TILE_WIDTH - 1) // TILE_WIDTH


@kernel
def tiles_down(pinhole: F64) -> int:
    """Rows of packets."""
    return (int(pinhole[4]) * int(pinhole[1]) + TILE_HEIGHT - 1) // TILE_HEIGHT


@kernel
def first_hits(
    intersect8: int,
    scene: int,
    eye: F32,
    pinhole: F64,
    face_start: I64,
    face_ids: I32,
    face_offsets: I64,
    tiles: I64,
    face: I32,
    u: F32,
    v: F32,
    distance: F32,
    compact: bool,
    start: int,
    stop: int,
) -> None:
    """What the samples of some tiles see from `eye` (relative to the caster's centre).

    The picture's grid of samples is cut into tiles of 4 × 2, one packet each, numbered row by row. Done
    are tiles[start:stop], or tiles start … stop−1 where `tiles` is empty. face gets face_offsets[object] +
    the object's face, or −1; u, v weigh the face's second and third corner; distance is inf where nothing
    is hit. A tile's results depend on nothing but the tile. They go to where the samples are in the picture,
    or, `compact`, to 8 places for each tile, row by row.
    """
    packet, valid = new_packet()
    words = packet.view(np.uint32)
    words[MASK, :] = np.uint32(0xFFFFFFFF)
    for axis in range(3):
        packet[ORIGIN + axis, :] = eye[axis]
    arguments = coherent_arguments()
    n = int(pinhole[1])
    columns, rows = int(pinhole[0]) * n, int(pinhole[4]) * n
    right, up = 2 * pinhole[2] / columns, 2 * pinhole[3] / (int(pinhole[WHOLE]) * n)
    above = int(pinhole[TOP]) * n
    turn = pinhole[5:].astype(np.float32)
    across = tiles_across(pinhole)
    place = np.empty(8, np.int64)
    for index in range(start, stop):
        tile = tiles[index] if len(tiles) else index
        left, top = (tile % across) * TILE_WIDTH, (tile // across) * TILE_HEIGHT
        for lane in range(8):
            # beyond the picture's last column or row the packet is filled with rays that nobody asks for
            x, y = left + lane % TILE_WIDTH, top + lane // TILE_WIDTH
            a = np.float32((x + 0.5) * right - pinhole[2])
            b = np.float32(pinhole[3] - (above + y + 0.5) * up)
            c = np.float32(-1) / np.sqrt(a * a + b * b + np.float32(1))
            a, b = -a * c, -b * c
            packet[DIRECTION, lane] = turn[0] * a + turn[1] * b + turn[2] * c
            packet[DIRECTION + 1, lane] = turn[3] * a + turn[4] * b + turn[5] * c
            packet[DIRECTION + 2, lane] = turn[6] * a + turn[7] * b + turn[8] * c
            packet[TNEAR, lane] = np.float32(0)
            packet[TFAR, lane] = np.float32(np.inf)
            inside = x < columns and y < rows
            valid[lane] = -1 if inside else 0
            if compact:
                place[lane] = 8 * index + lane if inside else -1
            else:
                place[lane] = sample_at(x, y, columns, n) if inside else -1
        clear_hits(packet)
        call_address(intersect8, valid, scene, packet, arguments)
        for lane in range(8):
            s = place[lane]
            if s < 0:
                continue
            if words[GEOMETRY, lane] == NO_HIT:
                face[s], u[s], v[s], distance[s] = -1, 0.0, 0.0, np.float32(np.inf)
                continue
            item = words[INSTANCE, lane]
            found = face_start[item, words[GEOMETRY, lane]] + words[PRIMITIVE, lane]
            face[s] = face_offsets[item] + face_ids[found]
            u[s], v[s], distance[s] = packet[U, lane], packet[V, lane], packet[TFAR, lane]


@kernel
def tiles_in(pinhole: F64, boxes: I64) -> I64:
    """Numbers, rising, of the tiles that touch any of the boxes (N, 4) of samples: left, top, right, bottom.

    Right and bottom are the first that are no longer in; a box may reach beyond the picture.
    """
    across, down = tiles_across(pinhole), tiles_down(pinhole)
    touched = np.zeros(across * down, np.bool_)
    for box in range(len(boxes)):
        if boxes[box, 0] >= boxes[box, 2] or boxes[box, 1] >= boxes[box, 3]:
            continue
        left = max(boxes[box, 0] // TILE_WIDTH, 0)
        right = min(-(-boxes[box, 2] // TILE_WIDTH), across)
        top = max(boxes[box, 1] // TILE_HEIGHT, 0)
        bottom = min(-(-boxes[box, 3] // TILE_HEIGHT), down)
        for row in range(top, bottom):
            for column in range(left, right):
                touched[row * across + column] = True
    return np.flatnonzero(touched)


@kernel
def pixels_of(pinhole: F64, tiles: I64) -> I64:
    """The pixels, rising, of which a sample lies in one of the tiles."""
    width, n, height = int(pinhole[0]), int(pinhole[1]), int(pinhole[4])
    across = tiles_across(pinhole)
    touched = np.zeros(width * height, np.bool_)
    for index in range(len(tiles)):
        left, top = (tiles[index] % across) * TILE_WIDTH, (tiles[index] // across) * TILE_HEIGHT
        for y in range(top, min(top + TILE_HEIGHT, height * n)):
            for x in range(left, min(left + TILE_WIDTH, width * n)):
                touched[(y // n) * width + x // n] = True
    return np.flatnonzero(touched)
