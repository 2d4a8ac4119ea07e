"""Visibility cut fields: section V.A.1 and figure 4, the occlusion by one object at samples around it.

V_i(x_s, ω) is 0 where a ray from the sample meets the object and 1 elsewhere; two nodes merge only when
they are equal. Samples (`shells`) are traced when a receiver first touches them, and only in directions
that pass the object's sphere. A field belongs to a mesh, a rotation and a scale; translated objects and
instances that are turned alike use it where they stand.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from studio_core.jit import call_address, kernel
from studio_core.kernels.directions import DirectionSet
from studio_core.kernels.packets import DIRECTION, MASK, OPAQUE, ORIGIN, TFAR, new_packet
from studio_core.kernels.raycast import CasterPart
from studio_core.parallel import Checkpoints, Workers
from studio_plugins.cuts.paper.height_cuts import cut_of_bits, put_bits, put_heights
from studio_plugins.cuts.paper.records import Records
from studio_plugins.cuts.paper.shells import sample_point
from studio_plugins.cuts.paper.svc import OwnFrame

U8 = npt.NDArray[np.uint8]
U64 = npt.NDArray[np.uint64]
I32 = npt.NDArray[np.int32]
I64 = npt.NDArray[np.int64]
F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]

CHUNK = 64  # samples
WANTED = -1
_ALL = np.uint64(0xFFFFFFFFFFFFFFFF)
_MARGIN = 1e-4  # of the cones' angles: rays that graze the sphere


@kernel
def cones_meet(cosine: float, sine_a: float, sine_b: float) -> bool:
    """Whether two cones meet whose axes have this cosine between them; half angles below 90° by their sines.

    A sine above 1 is that of a cone that meets everything.
    """
    if sine_a >= 1 or sine_b >= 1:
        return True
    together = math.sqrt(1 - sine_a * sine_a) * math.sqrt(1 - sine_b * sine_b) - sine_a * sine_b
    return cosine >= together - _MARGIN


@kernel
def trace_sample(
    occluded8: int,
    scene: int,
    point: F64,
    own_point: F64,
    radius: float,
    directions: F32,
    own_axes: F32,
    sines: F32,
    packet: F32,
    valid: I32,
    words: U64,
) -> int:
    """Fills the visibility words (S / 64,) of a sample at `point` from the centre; returns rays traced.

    `own_point`, `directions` (S, 3) and the packets' axes are in the object's own frame; `radius` in
    lengths of `point`.
    """
    distance = math.sqrt(point[0] ** 2 + point[1] ** 2 + point[2] ** 2)
    sine = radius / distance if distance > radius else 2.0
    own = math.sqrt(own_point[0] ** 2 + own_point[1] ** 2 + own_point[2] ** 2)
    cx, cy, cz = 0.0, 0.0, 0.0
    if own > 0:
        cx, cy, cz = -own_point[0] / own, -own_point[1] / own, -own_point[2] / own
    for axis in range(3):
        packet[ORIGIN + axis, :] = own_point[axis]
    rays, groups = 0, len(words)
    for group in range(groups):
        words[group] = _ALL
        cosine = cx * own_axes[group, 0] + cy * own_axes[group, 1] + cz * own_axes[group, 2]
        if not cones_meet(cosine, sines[group], sine):
            continue
        bits = np.uint64(0)
        for part in range(8):
            node = groups + group * 8 + part
            cosine = cx * own_axes[node, 0] + cy * own_axes[node, 1] + cz * own_axes[node, 2]
            if not cones_meet(cosine, sines[node], sine):
                bits |= np.uint64(255) << np.uint64(8 * part)
                continue
            first = group * 64 + part * 8
            for lane in range(8):
                packet[DIRECTION, lane] = directions[first + lane, 0]
                packet[DIRECTION + 1, lane] = directions[first + lane, 1]
                packet[DIRECTION + 2, lane] = directions[first + lane, 2]
                packet[TFAR, lane] = np.inf
                valid[lane] = -1
            rays += 8
            call_address(occluded8, valid, scene, packet, 0)
            free = 0
            for lane in range(8):
                if packet[TFAR, lane] > 0:
                    free |= 1 << lane
            bits |= np.uint64(free) << np.uint64(8 * part)
        words[group] = bits
    return rays


@kernel
def cut_samples(
    occluded8: int,
    scene: int,
    linear: F64,
    samples: I64,
    radius: float,
    shells: int,
    m: int,
    directions: F32,
    own_axes: F32,
    sines: F32,
    data: U8,
    lengths: I64,
    counts: I32,
) -> tuple[int, int, int]:
    """Traces samples and writes their cuts; returns bytes, nodes that are leaves, and rays."""
    packet, valid = new_packet()
    packet.view(np.uint32)[MASK, :] = OPAQUE
    size = len(directions)
    words = np.empty(size >> 6, np.uint64)
    heights, values = np.empty(size, np.uint8), np.empty(size, np.uint8)
    point, own_point = np.empty(3), np.empty(3)
    at, at_leaves, rays = 0, 0, 0
    for row in range(len(samples)):
        sample_point(samples[row], radius, shells, m, point)
        for axis in range(3):
            own_point[axis] = (
                linear[axis, 0] * point[0] + linear[axis, 1] * point[1] + linear[axis, 2] * point[2]
            )
        rays += trace_sample(
            occluded8,
            scene,
            point,
            own_point,
            radius,
            directions,
            own_axes,
            sines,
            packet,
            valid,
            words,
        )
        count = cut_of_bits(words, heights, values)
        for node in range(count):
            at_leaves += 1 if heights[node] == 0 else 0
        end = put_bits(values, count, data, put_heights(heights, count, data, at))
        lengths[row], counts[row] = end - at, count
        at = end
    return at, at_leaves, rays


class VisibilityCutField:
    """The field of one mesh in one rotation and scale.

    table (n · 6 · m²,) int32 tells of every sample: 0 not asked for, −1 (`WANTED`) asked for and not traced
    yet, otherwise 1 + the number of its record. Memory that is never asked for is never used.
    """

    def __init__(self, radius: float, shells: int, m: int) -> None:
        self.radius, self.shells, self.m = radius, shells, m
        self.table: I32 = np.zeros(shells * 6 * m * m, np.int32)
        self.records = Records()
        self.rays = 0

    def wanted(self) -> I64:
        """Samples that receivers have touched and that are not traced."""
        return np.flatnonzero(self.table == WANTED).astype(np.int64)

    def trace(
        self,
        samples: I64,
        part: CasterPart,
        occluded8: int,
        directions: DirectionSet,
        workers: Workers,
        job: Checkpoints | None = None,
    ) -> None:
        """Traces samples that have no record; nothing is kept when it is cancelled."""
        if not len(samples):
            return
        frame = OwnFrame.of(part, directions)
        linear = np.ascontiguousarray(part.from_world[:, :3])
        done: dict[int, tuple[I64, I32, int, U8, int]] = {}
        most = directions.size * 5 // 8 + 2

        def body(start: int, stop: int) -> None:
            count = stop - start
            data = np.empty(count * most, np.uint8)
            lengths, counts = np.empty(count, np.int64), np.empty(count, np.int32)
            used, leaves, rays = cut_samples(
                occluded8,
                part.scene,
                linear,
                samples[start:stop],
                self.radius,
                self.shells,
                self.m,
                frame.directions,
                frame.axes,
                frame.sines,
                data,
                lengths,
                counts,
            )
            done[start] = lengths, counts, leaves, data[:used].copy(), rays

        workers.run(len(samples), CHUNK, body, job)
        first = len(self.records)
        for start in sorted(done):
            lengths, counts, leaves, data, rays = done[start]
            self.records.append(lengths, counts, leaves, data)
            self.rays += rays
        self.table[samples] = np.arange(first + 1, len(self.records) + 1)

    @property
    def nbytes(self) -> int:
        """Bytes kept: records, and four for each sample's place in the table."""
        return self.records.nbytes + 4 * len(self.records)
