"""What is hidden at each vertex as far as light cares: visibility for the time while something moves.

A ray may stand for a share of the light that a vertex gets, so bright leaves are traced one by one and dim
ones by hundreds. What other objects hide is not looked at, and what one object was found to hide no other
is asked for. The record of a glimpse says what all objects together hide that had to be looked at, and what
they hid before; it is forgotten when they move on.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from studio_core.colour import LUMINANCE
from studio_core.jit import call_address, kernel
from studio_core.kernels.light_tree import LightTree
from studio_core.kernels.packets import DIRECTION, MASK, OPAQUE, ORIGIN, TFAR, new_packet
from studio_plugins.cuts.beams import BLOCKS
from studio_plugins.cuts.intervals import ONES, U64, Pool, runs_of, set_bits
from studio_plugins.cuts.tracer import HORIZON, PACKETS, RAYS, SKIPPED, TRACED, below, frustum

F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]
I32 = npt.NDArray[np.int32]
I64 = npt.NDArray[np.int64]
Bools = npt.NDArray[np.bool_]

NOW, BEFORE = 0, 1
"""Slots of a glimpse: what is hidden by all that is stale, and what was."""
_BYTE = np.uint64(0xFF)
_ONE = np.uint64(1)


@dataclass(frozen=True, eq=False)
class Glow:
    """How much light comes from where: luminous ∫ L dω of the blocks of leaves of `Beams`.

    power (nodes,) float32, in the order of the beams' cones; peak (nodes,) that of the brightest of eight
    parts of each, 0 for the smallest blocks.
    """

    k: int
    power: F32
    peak: F32

    @staticmethod
    def of(tree: LightTree, k: int) -> Glow:
        """Of a light tree; the light of a coarser one is taken as even within its leaves."""
        sums = tree.prefix_power @ np.array(LUMINANCE)
        if tree.k >= k:
            return _glow(k, np.diff(sums[:: 1 << (tree.k - k)]))
        parts = 1 << (k - tree.k)
        return _glow(k, np.repeat(np.diff(sums) / parts, parts))

    @staticmethod
    def even(k: int) -> Glow:
        """The same from everywhere, for want of anything better."""
        return _glow(k, np.full(1 << k, 4 * np.pi / (1 << k)))


def _glow(k: int, leaves: F64) -> Glow:
    power = [leaves.reshape(-1, min(block, len(leaves))).sum(axis=1) for block in BLOCKS]
    peak = [np.zeros_like(own) for own in power]
    for own, parts in zip(peak, power[1:], strict=False):
        own[:] = parts.reshape(len(own), -1).max(axis=1)
    return Glow(k, np.concatenate(power).astype(np.float32), np.concatenate(peak).astype(np.float32))


@kernel
def ones(word: np.uint64) -> np.uint64:
    """How many bits are set."""
    word -= (word >> _ONE) & np.uint64(0x5555555555555555)
    word = (word & np.uint64(0x3333333333333333)) + ((word >> np.uint64(2)) & np.uint64(0x3333333333333333))
    word = (word + (word >> np.uint64(4))) & np.uint64(0x0F0F0F0F0F0F0F0F)
    return (word * np.uint64(0x0101010101010101)) >> np.uint64(56)


@kernel
def _light(normal: F32, hidden: U64, axis: F32, offset: I64, power: F32) -> np.float32:
    """About how much light arrives from where nothing is hidden yet."""
    total = np.float32(0)
    for group in range(len(hidden)):
        if hidden[group] == ONES:
            continue
        node = offset[2] + group
        up = normal[0] * axis[node, 0] + normal[1] * axis[node, 1] + normal[2] * axis[node, 2]
        if up > 0:
            total += up * power[node] * np.float32(ones(~hidden[group])) / np.float32(64)
    return total


@kernel
def _all_hidden(hidden: U64, leaf: int, size: int) -> bool:
    if size < 64:
        return bool((hidden[leaf >> 6] >> np.uint64(leaf & 63)) & _BYTE == _BYTE)
    free = np.uint64(0)
    for w in range(leaf >> 6, (leaf + size) >> 6):
        free |= ~hidden[w]
    return bool(free == np.uint64(0))


@kernel
def _outside(planes: F64, sides: int, x: np.float32, y: np.float32, z: np.float32, sine: np.float32) -> bool:
    for side in range(sides):
        if planes[side, 0] * x + planes[side, 1] * y + planes[side, 2] * z < -sine:
            return True
    return False


@kernel
def _look(
    occluded8: int,
    scene: int,
    packet: F32,
    valid: I32,
    planes: F64,
    sides: int,
    rows: F32,
    axis: F32,
    upright: F32,
    sine: F32,
    offset: I64,
    normal: F32,
    peak: F32,
    allowed: np.float32,
    hidden: U64,
    words: U64,
    counts: I64,
) -> None:
    """Sets bits of leaves that one object hides, in `hidden` and `words`.

    The packet's origin is set. rows and axis are directions in the object's frame, `upright` the cones' axes
    in the world. A ray may stand for light of up to `allowed`.
    """
    total = 8 * rows.shape[0]
    level, largest = 0, 4096
    while largest > total:
        largest >>= 3
        level += 1
    leaf, size = 0, largest
    while leaf < total:
        node = offset[level] + leaf // size
        if _outside(planes, sides, axis[node, 0], axis[node, 1], axis[node, 2], sine[node]) or _all_hidden(
            hidden, leaf, size
        ):
            counts[SKIPPED] += size >> 3
        else:
            up = (
                normal[0] * upright[node, 0] + normal[1] * upright[node, 1] + normal[2] * upright[node, 2]
            ) + sine[node]
            if size > 8 and up * peak[node] > allowed:
                size >>= 3
                level += 1
                continue
            part = size >> 3
            used = 0
            if size > 8:
                child = offset[level + 1] + leaf // part
                for lane in range(8):
                    x, y, z = axis[child + lane, 0], axis[child + lane, 1], axis[child + lane, 2]
                    packet[DIRECTION, lane], packet[DIRECTION + 1, lane], packet[DIRECTION + 2, lane] = (
                        x,
                        y,
                        z,
                    )
                    packet[TFAR, lane] = np.inf
                    skip = _all_hidden(hidden, leaf + lane * part, part) or _outside(
                        planes, sides, x, y, z, np.float32(0)
                    )
                    valid[lane] = 0 if skip else -1
                    used += not skip
            else:
                byte = (hidden[leaf >> 6] >> np.uint64(leaf & 63)) & _BYTE
                row = leaf >> 3
                for lane in range(8):
                    packet[DIRECTION, lane] = rows[row, 0, lane]
                    packet[DIRECTION + 1, lane] = rows[row, 1, lane]
                    packet[DIRECTION + 2, lane] = rows[row, 2, lane]
                    packet[TFAR, lane] = np.inf
                    free = 1 - int((byte >> np.uint64(lane)) & _ONE)
                    valid[lane] = -free
                    used += free
            if used > 0:
                counts[RAYS] += used
                counts[PACKETS] += 1
                call_address(occluded8, valid, scene, packet, 0)
                for lane in range(8):
                    if valid[lane] != 0 and packet[TFAR, lane] < 0:
                        first = leaf + lane * part
                        if part < 64:
                            bits = ((_ONE << np.uint64(part)) - _ONE) << np.uint64(first & 63)
                            words[first >> 6] |= bits & ~hidden[first >> 6]
                            hidden[first >> 6] |= bits
                        else:
                            for w in range(first >> 6, (first + part) >> 6):
                                words[w] |= ~hidden[w]
                                hidden[w] = ONES
        leaf += size
        while size < largest and leaf % (size << 3) == 0:  # back up to the largest block that starts here
            size <<= 3
            level -= 1


@kernel
def _candidates(
    own: int,
    stale: Bools,
    scene: I64,
    from_mesh: F64,
    turn: F64,
    radius: F64,
    x: float,
    y: float,
    z: float,
    normal: F32,
    candidates: I64,
    origins: F64,
    counts: I64,
) -> int:
    """Which stale objects are above the horizon, its own first, and where (x, y, z) is in their frames."""
    found = 0
    for step in range(-1, len(scene)):
        j = own if step < 0 else step
        if step == own or not stale[j]:
            continue
        counts[TRACED] += 1
        if scene[j] == 0:
            continue
        m, t = from_mesh[j], turn[j]
        up = 0.0
        for i in range(3):
            origins[found, i] = m[i, 0] * x + m[i, 1] * y + m[i, 2] * z + m[i, 3]
            up += (t[i, 0] * normal[0] + t[i, 1] * normal[1] + t[i, 2] * normal[2]) * origins[found, i]
        if up >= radius[j] * 1.0001:
            counts[HORIZON] += 1
            continue
        candidates[found] = j
        found += 1
    return found


@kernel
def glimpse_records(
    begin: int,
    stop: int,
    points: I64,
    stale_row: I64,
    stale: Bools,
    positions: F32,
    normals: F32,
    geometric: F32,
    inset: F32,
    object_of: I32,
    object_in: I64,
    pool: Pool,
    start: I64,
    length: I32,
    occluded8: int,
    scene: I64,
    from_mesh: F64,
    turn: F64,
    half: F64,
    radius: F64,
    epsilon: float,
    which: I64,
    rows: F32,
    axis: F32,
    sine: F32,
    offset: I64,
    power: F32,
    peak: F32,
    share: float,
    out: Pool,
    out_length: I32,
    changed: Bools,
    used: I64,
    counts: I64,
) -> int:
    """Records of points[begin:stop] of what the objects that are stale for them hide, one after the other.

    Returns how many points fitted; used[0] is how many numbers they took. As `trace_records`, but for:
    object_in (slots,) is the object of a slot or -1; the record has two segments, NOW and BEFORE, without
    what others hide; a ray stands for light of at most `share` of what reaches the vertex past all that is
    not stale, `power` and `peak` being a `Glow`'s. `changed` marks points of which both segments differ.
    """
    leaves = 8 * rows.shape[1]
    groups = leaves // 64
    count = len(scene)
    packet, valid = new_packet()
    packet.view(np.uint32)[MASK, :] = OPAQUE
    hidden = np.empty(groups, np.uint64)
    words, before = np.empty(groups, np.uint64), np.empty(groups, np.uint64)
    planes = np.empty((6, 3))
    candidates, origins = np.empty(count, np.int64), np.empty((count + 1, 3))
    place = 0
    for number in range(begin, stop):
        if len(out) - place < 2 * leaves + 8:
            used[0] = place
            return number - begin
        p = points[number]
        r = object_of[p]
        mine = stale[stale_row[number], r]
        nx, ny, nz = normals[p, 0], normals[p, 1], normals[p, 2]
        ox = float(positions[p, 0]) + epsilon * geometric[p, 0] + inset[p, 0]
        oy = float(positions[p, 1]) + epsilon * geometric[p, 1] + inset[p, 1]
        oz = float(positions[p, 2]) + epsilon * geometric[p, 2] + inset[p, 2]
        good = abs(ox + oy + oz + nx + ny + nz) < np.inf
        differs = length[p] == 0 or mine[r]
        asked = 0
        if good:
            asked = _candidates(
                r, mine, scene, from_mesh, turn, radius, ox, oy, oz, normals[p], candidates, origins, counts
            )
        words[:] = np.uint64(0)
        hidden[:] = np.uint64(0)
        before[:] = np.uint64(0)
        if mine[r] and good:
            below(normals[p], rows[0], axis[0], sine, offset, words)
        elif mine[r]:
            words[:] = ONES
        hidden |= words
        at, end = start[p], start[p] + length[p]
        while at < end:
            size = 2 + 2 * int(pool[at + 1])
            j = object_in[pool[at]]
            if j >= 0:
                for pair in range(at + 2, at + size, 2):
                    set_bits(before if mine[j] else hidden, int(pool[pair]), int(pool[pair + 1]))
            at += size
        for group in range(groups):
            before[group] &= ~hidden[group]
        if asked > 0:
            allowed = np.float32(share) * _light(normals[p], hidden, axis[0], offset, power)
            for one in range(asked):
                j = candidates[one]
                x, y, z = origins[one, 0], origins[one, 1], origins[one, 2]
                packet[ORIGIN, :], packet[ORIGIN + 1, :], packet[ORIGIN + 2, :] = x, y, z
                sides = frustum(x, y, z, half[j], planes)
                w = which[j]
                _look(
                    occluded8,
                    scene[j],
                    packet,
                    valid,
                    planes,
                    sides,
                    rows[w],
                    axis[w],
                    axis[0],
                    sine,
                    offset,
                    normals[p],
                    peak,
                    allowed,
                    hidden,
                    words,
                    counts,
                )
        for group in range(groups):
            differs |= words[group] != before[group]
        first = place
        if differs:
            for slot in range(2):
                after = runs_of(words if slot == NOW else before, groups, out, place + 2)
                out[place], out[place + 1] = slot, (after - place - 2) // 2
                place = after
        out_length[number] = place - first
        changed[number] = differs
    used[0] = place
    return stop - begin
