"""Kernels that trace given rays, eight at a time, through whichever tracer they are handed."""

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
    NORMAL,
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
Bools = npt.NDArray[np.bool_]


@kernel
def load_rays(
    packet: F32, valid: Any, origins: F32, directions: F32, tfar: F32, first: int, stop: int
) -> int:
    """Fills lanes with rays first … first+7; a ray that is not finite or has no direction is not traced."""
    traced = 0
    for lane in range(8):
        ray = first + lane
        valid[lane] = 0
        if ray >= stop:
            continue
        length = np.float32(0.0)
        size = np.float32(0.0)
        for axis in range(3):
            packet[ORIGIN + axis, lane] = origins[ray, axis]
            packet[DIRECTION + axis, lane] = directions[ray, axis]
            length += abs(directions[ray, axis])
            size += abs(origins[ray, axis])
        packet[TFAR, lane] = tfar[ray]
        if 0 < length < np.inf and size < np.inf and tfar[ray] >= 0:  # isfinite of a sum is folded away
            valid[lane] = -1
            traced += 1
    return traced


@kernel
def occluded_chunk(
    occluded8: int,
    scene: int,
    origins: F32,
    directions: F32,
    tfar: F32,
    mask: np.uint32,
    out: Bools,
    start: int,
    stop: int,
) -> None:
    """Writes out[start:stop]; start is a multiple of 8."""
    packet, valid = new_packet()
    packet.view(np.uint32)[MASK, :] = mask
    for first in range(start, stop, 8):
        if load_rays(packet, valid, origins, directions, tfar, first, stop):
            call_address(occluded8, valid, scene, packet, 0)
        for lane in range(min(8, stop - first)):
            out[first + lane] = valid[lane] != 0 and packet[TFAR, lane] < 0


@kernel
def closest_chunk(
    intersect8: int,
    scene: int,
    origins: F32,
    directions: F32,
    tnear: np.float32,
    tfar: F32,
    mask: np.uint32,
    face_start: npt.NDArray[np.int64],
    face_ids: npt.NDArray[np.int32],
    normals: F32,
    t: F32,
    ids: npt.NDArray[np.int32],
    uv: F32,
    normal: F32,
    front: Bools,
    start: int,
    stop: int,
) -> None:
    """Writes items start … stop of t, ids (object, face), uv, normal, front; start is a multiple of 8."""
    packet, valid = new_packet()
    words = packet.view(np.uint32)
    words[MASK, :] = mask
    for first in range(start, stop, 8):
        packet[TNEAR, :] = tnear
        clear_hits(packet)
        if load_rays(packet, valid, origins, directions, tfar, first, stop):
            call_address(intersect8, valid, scene, packet, 0)
        for lane in range(min(8, stop - first)):
            ray = first + lane
            t[ray], front[ray] = np.inf, False
            ids[ray, 0] = ids[ray, 1] = -1
            uv[ray, 0] = uv[ray, 1] = normal[ray, 0] = normal[ray, 1] = normal[ray, 2] = 0.0
            if valid[lane] == 0 or words[GEOMETRY, lane] == NO_HIT:
                continue
            item = np.int64(words[INSTANCE, lane])
            slot = face_start[item, np.int64(words[GEOMETRY, lane])] + np.int64(words[PRIMITIVE, lane])
            t[ray] = packet[TFAR, lane]
            ids[ray, 0], ids[ray, 1] = item, face_ids[slot]
            uv[ray, 0], uv[ray, 1] = packet[U, lane], packet[V, lane]
            x, y, z = packet[NORMAL, lane], packet[NORMAL + 1, lane], packet[NORMAL + 2, lane]
            # float64: squares of a tiny or huge face's normal leave the range of float32
            square, facing = 0.0, 0.0
            for axis in range(3):
                m = normals[item, axis]
                n = np.float64(m[0]) * x + np.float64(m[1]) * y + np.float64(m[2]) * z
                square += n * n
                facing += n * directions[ray, axis]
            scale = 1.0 / np.sqrt(square) if square > 0 else 0.0
            for axis in range(3):
                m = normals[item, axis]
                n = np.float64(m[0]) * x + np.float64(m[1]) * y + np.float64(m[2]) * z
                normal[ray, axis] = n * scale
            front[ray] = facing < 0
