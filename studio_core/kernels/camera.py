"""Samples of a picture: their directions, and what they see first.

A picture of W × H pixels has n × n samples in each; sample s belongs to pixel s // n² (row by row from the
top left) and lies at (s % n², from the top left) in it. A pinhole is 14 numbers: W, n, tangent of half the
angle across and up, pixels up, then the 3×3 rotation world from camera, row by row.
"""

from __future__ import annotations

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

PINHOLE = 14


@kernel
def sample_direction(pinhole: F64, sample: int, out: F32) -> None:
    """The unit world direction of a sample."""
    width, n = int(pinhole[0]), int(pinhole[1])
    pixel, inner = sample // (n * n), sample % (n * n)
    x = (pixel % width) * n + inner % n
    y = (pixel // width) * n + inner // n
    a = ((x + 0.5) / (width * n) * 2 - 1) * pinhole[2]
    b = (1 - (y + 0.5) / (pinhole[4] * n) * 2) * pinhole[3]
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
def first_hits(
    intersect8: int,
    scene: int,
    eye: F32,
    pinhole: F64,
    face_start: I64,
    face_ids: I32,
    face_offsets: I64,
    face: I32,
    u: F32,
    v: F32,
    distance: F32,
    start: int,
    stop: int,
) -> None:
    """What samples start … stop−1 see from `eye` (relative to the caster's centre).

    face gets face_offsets[object] + the object's face, or −1; u, v weigh the face's second and third
    corner; distance is inf where nothing is hit.
    """
    packet, valid = new_packet()
    words = packet.view(np.uint32)
    words[MASK, :] = np.uint32(0xFFFFFFFF)
    along = np.empty(3, np.float32)
    for axis in range(3):
        packet[ORIGIN + axis, :] = eye[axis]
    for first in range(start, stop, 8):
        used = min(8, stop - first)
        for lane in range(8):
            valid[lane] = -1 if lane < used else 0
            sample_direction(pinhole, min(first + lane, stop - 1), along)
            for axis in range(3):
                packet[DIRECTION + axis, lane] = along[axis]
            packet[TNEAR, lane] = np.float32(0)
            packet[TFAR, lane] = np.float32(np.inf)
        clear_hits(packet)
        call_address(intersect8, valid, scene, packet, 0)
        for lane in range(used):
            s = first + lane
            if words[GEOMETRY, lane] == NO_HIT:
                face[s], u[s], v[s], distance[s] = -1, 0.0, 0.0, np.float32(np.inf)
                continue
            item = words[INSTANCE, lane]
            place = face_start[item, words[GEOMETRY, lane]] + words[PRIMITIVE, lane]
            face[s] = face_offsets[item] + face_ids[place]
            u[s], v[s], distance[s] = packet[U, lane], packet[V, lane], packet[TFAR, lane]
