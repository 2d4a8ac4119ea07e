"""Eight rays at a time: embree's packet layout, shared by embree and by our own tracer.

A packet is a C-contiguous float32 array (22, 8), 32-byte aligned, whose rows are embree 4's `RTCRay8`
(rows 0–11) followed by `RTCHit8`; integer rows are read through `packet.view(np.uint32)`. A tracer is
called as `call_address(address, valid, scene, packet, 0)` with `valid` int32 (8,): −1 traced, 0 not.
Occlusion sets `tfar` of occluded rays to −inf; intersection sets `tfar`, `u`, `v`, `Ng` and the ids,
and leaves `geomID` at `NO_HIT` where nothing is hit.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from studio_core.jit import address_of, kernel

F32 = npt.NDArray[np.float32]
I32 = npt.NDArray[np.int32]

ORIGIN, TNEAR, DIRECTION, TIME, TFAR, MASK, RAY_ID, FLAGS = 0, 3, 4, 7, 8, 9, 10, 11
NORMAL, U, V, PRIMITIVE, GEOMETRY, INSTANCE, INSTANCE_PRIMITIVE = 12, 15, 16, 17, 18, 19, 20
ROWS = 22
NO_HIT = 0xFFFFFFFF
ALIGNMENT = 32

OPAQUE, SEE_THROUGH = 1, 2
"""Ray mask bits: which faces a ray can meet."""
EVERYTHING = 0xFFFFFFFF


@kernel
def new_packet() -> tuple[Any, Any]:
    """An empty packet and its valid mask, both aligned; allocate once a chunk, not once a packet."""
    floats = np.zeros(ROWS * 8 + 8, np.float32)
    skip = (-address_of(floats) % ALIGNMENT) // 4
    packet = floats[skip : skip + ROWS * 8].reshape((ROWS, 8))
    integers = np.zeros(16, np.int32)
    skip = (-address_of(integers) % ALIGNMENT) // 4
    return packet, integers[skip : skip + 8]


@kernel
def clear_hits(packet: F32) -> None:
    """Readies the hit rows for an intersection."""
    words = packet.view(np.uint32)
    for lane in range(8):
        words[GEOMETRY, lane] = NO_HIT
        words[PRIMITIVE, lane] = NO_HIT
        words[INSTANCE, lane] = NO_HIT
        words[INSTANCE_PRIMITIVE, lane] = NO_HIT
