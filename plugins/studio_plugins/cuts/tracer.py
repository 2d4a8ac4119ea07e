"""Which leaves each object blocks at each vertex, traced object by object, eight rays at a time.

A vertex asks only the objects that are stale for it. Whole cones of leaves are skipped where the object
cannot be: outside the frustum of its bounding box, below the horizon or behind the vertex' own object,
where nothing is seen anyway, or where the vertices around agree. What is left is traced against that
object alone, in its own frame.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from studio_core.jit import call_address, kernel
from studio_core.kernels.packets import DIRECTION, MASK, OPAQUE, ORIGIN, TFAR, new_packet
from studio_plugins.cuts.guides import guess, index_record, segment_bits
from studio_plugins.cuts.intervals import ONES, U64, Pool, runs_of, set_bits

F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]
I32 = npt.NDArray[np.int32]
I64 = npt.NDArray[np.int64]
Bools = npt.NDArray[np.bool_]

COUNTS = 6
RAYS, HORIZON, SKIPPED, PACKETS, TRACED, GUESSED = range(COUNTS)
"""Columns of counts: rays; objects skipped under the horizon; packets of 8 skipped by its frustum, or
since the vertex' own object or the horizon hides them; packets looked at; objects looked at; packets taken
from the vertices around."""

_NONE = np.uint64(0)
_BYTE = np.uint64(0xFF)


@kernel
def frustum(x: float, y: float, z: float, half: F64, planes: F64) -> int:
    """Planes (n, 3) through (x, y, z) that bound the directions in which a box about the origin lies.

    Unit normals point inwards; there are at most six. 0: the point is in the box (or on its skin), and so
    every direction may meet it.
    """
    skin = 1e-5 * (half[0] + half[1] + half[2]) + 1e-9
    hx, hy, hz = half[0] + skin, half[1] + skin, half[2] + skin
    count = 0
    for axis in range(3):
        # The edges along one axis lie where two faces of the other axes meet: b and c.
        if axis == 0:
            pb, pc, hb, hc = y, z, hy, hz
        elif axis == 1:
            pb, pc, hb, hc = z, x, hz, hx
        else:
            pb, pc, hb, hc = x, y, hx, hy
        for number in range(4):
            sb = 1.0 if number & 1 else -1.0
            sc = 1.0 if number & 2 else -1.0
            if (sb * pb > hb) == (sc * pc > hc):
                continue  # both faces or none are seen: no outline
            # normal = edge × way to the edge, which lies in the plane of b and c
            wb, wc = sb * hb - pb, sc * hc - pc
            length = np.sqrt(wb * wb + wc * wc)
            if length < 1e-12:
                continue
            nb, nc = -wc / length, wb / length
            if nb * -pb + nc * -pc < 0.0:  # towards the middle
                nb, nc = -nb, -nc
            if axis == 0:
                planes[count, 0], planes[count, 1], planes[count, 2] = 0.0, nb, nc
            elif axis == 1:
                planes[count, 0], planes[count, 1], planes[count, 2] = nc, 0.0, nb
            else:
                planes[count, 0], planes[count, 1], planes[count, 2] = nb, nc, 0.0
            count += 1
    return count


@kernel
def _blocked(
    occluded8: int,
    scene: int,
    packet: F32,
    valid: I32,
    x: float,
    y: float,
    z: float,
    half: F64,
    planes: F64,
    rows: F32,
    axis: F32,
    sine: F32,
    offset: I64,
    hidden: U64,
    guided: bool,
    guessed: U64,
    sure: U64,
    words: U64,
    counts: I64,
) -> int:
    """Sets the bits of the leaves that one object blocks; how many packets block something.

    (x, y, z) is the ray origin in the object's frame; `hidden` has bits where no ray is needed. If guided,
    one ray decides whether a packet that is `sure` is as `guessed`; then its bits are set in `hidden`.
    """
    words[:] = _NONE
    sides = frustum(x, y, z, half, planes)
    packet[ORIGIN, :] = x
    packet[ORIGIN + 1, :] = y
    packet[ORIGIN + 2, :] = z
    packets = rows.shape[0]
    found = 0
    total = 8 * packets
    level, largest = 0, 4096
    while largest > total:
        largest >>= 3
        level += 1
    leaf, size = 0, largest
    while leaf < total:
        node = offset[level] + leaf // size
        skip = False
        dx, dy, dz = axis[node, 0], axis[node, 1], axis[node, 2]
        for side in range(sides):
            if planes[side, 0] * dx + planes[side, 1] * dy + planes[side, 2] * dz < -sine[node]:
                skip = True
                break
        if not skip:
            if size >= 64:
                all_hidden = True
                for w in range(leaf >> 6, (leaf + size) >> 6):
                    if hidden[w] != ONES:
                        all_hidden = False
                        break
                skip = all_hidden
            else:
                byte = (hidden[leaf >> 6] >> np.uint64(leaf & 63)) & np.uint64(0xFF)
                skip = byte == np.uint64(0xFF)
        if skip:
            counts[SKIPPED] += size >> 3
            leaf += size
        elif size > 8:
            if guided and size == 64 and sure[leaf >> 6] != _NONE:
                found += _checked(
                    occluded8, scene, packet, valid, leaf >> 6, rows, hidden, guessed, sure, words, counts
                )
            size >>= 3
            level += 1
            continue
        else:
            byte = (hidden[leaf >> 6] >> np.uint64(leaf & 63)) & np.uint64(0xFF)
            row = leaf >> 3
            used = 0
            for lane in range(8):
                packet[DIRECTION, lane] = rows[row, 0, lane]
                packet[DIRECTION + 1, lane] = rows[row, 1, lane]
                packet[DIRECTION + 2, lane] = rows[row, 2, lane]
                packet[TFAR, lane] = np.inf
                free = 1 - int((byte >> np.uint64(lane)) & np.uint64(1))
                valid[lane] = -free
                used += free
            counts[RAYS] += used
            counts[PACKETS] += 1
            call_address(occluded8, valid, scene, packet, 0)
            bits = np.uint64(0)
            for lane in range(8):
                if valid[lane] != 0 and packet[TFAR, lane] < 0:
                    bits |= np.uint64(1) << np.uint64(lane)
            if bits != _NONE:
                words[leaf >> 6] |= bits << np.uint64(leaf & 63)
                found += 1
            leaf += 8
        # back up to the largest block that starts here
        while size < largest and leaf % (size << 3) == 0:
            size <<= 3
            level -= 1
    return found


@kernel
def _checked(
    occluded8: int,
    scene: int,
    packet: F32,
    valid: I32,
    word: int,
    rows: F32,
    hidden: U64,
    guessed: U64,
    sure: U64,
    words: U64,
    counts: I64,
) -> int:
    """Takes the guess for those packets of a word of which one ray says that it is right; how many block."""
    used = 0
    for part in range(8):
        shift = np.uint64(8 * part)
        row = 8 * word + part
        lane = (5 * row + 3) & 7
        there = (sure[word] >> shift) & _BYTE == _BYTE and (hidden[word] >> shift) & _BYTE != _BYTE
        valid[part] = -1 if there else 0
        used += there
        packet[DIRECTION, part] = rows[row, 0, lane]
        packet[DIRECTION + 1, part] = rows[row, 1, lane]
        packet[DIRECTION + 2, part] = rows[row, 2, lane]
        packet[TFAR, part] = np.inf
    if used == 0:
        return 0
    counts[RAYS] += used
    counts[PACKETS] += 1
    call_address(occluded8, valid, scene, packet, 0)
    found = 0
    for part in range(8):
        if valid[part] == 0:
            continue
        shift = np.uint64(8 * part)
        blocked = (guessed[word] >> shift) & _BYTE != _NONE
        if (packet[TFAR, part] < 0) == blocked:
            counts[GUESSED] += 1
            if blocked:
                words[word] |= (_BYTE << shift) & ~hidden[word]
                found += 1
            hidden[word] |= _BYTE << shift
    return found


@kernel
def below(normal: F32, rows: F32, axis: F32, sine: F32, offset: I64, words: U64) -> None:
    """Sets the bits of the leaves whose direction is not above a vertex' horizon."""
    nx, ny, nz = normal[0], normal[1], normal[2]
    for group in range(len(words)):
        node = offset[2] + group
        height = nx * axis[node, 0] + ny * axis[node, 1] + nz * axis[node, 2]
        if height <= -sine[node]:
            words[group] = ONES
            continue
        bits = np.uint64(0)
        if height < sine[node]:
            for part in range(8):
                row = 8 * group + part
                for lane in range(8):
                    up = nx * rows[row, 0, lane] + ny * rows[row, 1, lane] + nz * rows[row, 2, lane]
                    if not up > 0:
                        bits |= np.uint64(1) << np.uint64(8 * part + lane)
        words[group] = bits


@kernel
def _same(a: Pool, at: int, b: Pool, bt: int, length: int) -> bool:
    different = 0
    for i in range(length):
        different |= a[at + i] != b[bt + i]
    return different == 0


@kernel
def trace_records(
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
    slots: I64,
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
    guides: I64,
    around: I32,
    slot_count: int,
    out: Pool,
    out_length: I32,
    changed: Bools,
    used: I64,
    counts: I64,
) -> int:
    """Writes the records of points[begin:stop] that change one after the other into `out`.

    Returns how many points fitted; used[0] is how many numbers they took.

    stale[stale_row[p], r, j] says that what object r's vertices know of object j must be traced again; the
    rest is copied from the old record pool[start:start + length].
    guides (P, 2) are vertices with records of what is now between which a point lies, or -1: where they agree
    (see `guess`) a point without a record takes it from them.
    `changed` marks points whose record differs (without one, all); `counts` (COUNTS,) is added to.
    """
    packets = rows.shape[1]
    count = len(scene)
    groups = packets // 8
    packet, valid = new_packet()
    packet.view(np.uint32)[MASK, :] = OPAQUE
    hidden = np.empty(groups, np.uint64)
    words = np.empty(groups, np.uint64)
    where = np.full(slot_count, -1, np.int64)
    where_a, where_b = np.full(slot_count, -1, np.int64), np.full(slot_count, -1, np.int64)
    one, other = np.empty(groups, np.uint64), np.empty(groups, np.uint64)
    scratch, sure = np.empty(groups, np.uint64), np.empty(groups, np.uint64)
    skipped = np.empty(groups, np.uint64)
    planes = np.empty((6, 3))
    room = 8 * packets + 4
    place = 0
    for number in range(begin, stop):
        p = points[number]
        r = object_of[p]
        old = start[p]
        end = old + length[p]
        at = old
        while at < end:
            where[pool[at]] = at
            at += 2 + 2 * int(pool[at + 1])
        guided = guides[number, 0] >= 0 and length[p] == 0
        if guided:
            index_record(pool, start[guides[number, 0]], length[guides[number, 0]], where_a)
            index_record(pool, start[guides[number, 1]], length[guides[number, 1]], where_b)
        first = place
        differs = length[p] == 0 or stale[stale_row[number], r, r]  # light arrives at another slant
        full = False
        nx, ny, nz = normals[p, 0], normals[p, 1], normals[p, 2]
        ox = float(positions[p, 0]) + epsilon * geometric[p, 0] + inset[p, 0]
        oy = float(positions[p, 1]) + epsilon * geometric[p, 1] + inset[p, 1]
        oz = float(positions[p, 2]) + epsilon * geometric[p, 2] + inset[p, 2]
        good = abs(ox + oy + oz + nx + ny + nz) < np.inf  # isfinite of a sum is folded away: x − x is 0
        for step in range(-1, count):  # the vertex' own object comes first
            j = r if step < 0 else step
            if step == r:
                continue
            slot = slots[j]
            known = where[slot]
            known_length = 2 + 2 * int(pool[known + 1]) if known >= 0 else 0
            if len(out) - place < room:
                full = True
                break
            if not stale[stale_row[number], r, j]:
                if known >= 0:
                    out[place : place + known_length] = pool[known : known + known_length]
                    place += known_length
                if j == r:
                    hidden[:] = np.uint64(0)
                    if known >= 0:
                        for pair in range(known + 2, known + known_length, 2):
                            set_bits(hidden, int(pool[pair]), int(pool[pair + 1]))
                continue
            counts[TRACED] += 1
            if j == r:
                if good:
                    below(normals[p], rows[0], axis[0], sine, offset, hidden)
                else:
                    hidden[:] = ONES
            found = 0
            if scene[j] != 0 and good:
                m = from_mesh[j]
                x = m[0, 0] * ox + m[0, 1] * oy + m[0, 2] * oz + m[0, 3]
                y = m[1, 0] * ox + m[1, 1] * oy + m[1, 2] * oz + m[1, 3]
                z = m[2, 0] * ox + m[2, 1] * oy + m[2, 2] * oz + m[2, 3]
                t = turn[j]
                up = (
                    (t[0, 0] * nx + t[0, 1] * ny + t[0, 2] * nz) * x
                    + (t[1, 0] * nx + t[1, 1] * ny + t[1, 2] * nz) * y
                    + (t[2, 0] * nx + t[2, 1] * ny + t[2, 2] * nz) * z
                )
                if up >= radius[j] * 1.0001:
                    counts[HORIZON] += 1
                else:
                    w = which[j]
                    if guided:
                        segment_bits(pool, where_a[slot], one)
                        segment_bits(pool, where_b[slot], other)
                        guess(one, other, around, scratch, sure)
                        skipped[:] = hidden
                    found = _blocked(
                        occluded8,
                        scene[j],
                        packet,
                        valid,
                        x,
                        y,
                        z,
                        half[j],
                        planes,
                        rows[w],
                        axis[w],
                        sine,
                        offset,
                        skipped if guided else hidden,
                        guided,
                        one,
                        sure,
                        words,
                        counts,
                    )
            if j == r:
                if found > 0:
                    for g in range(groups):
                        hidden[g] |= words[g]
                found = 1
            if found > 0:
                after = runs_of(hidden if j == r else words, groups, out, place + 2)
                out[place] = slot
                out[place + 1] = (after - place - 2) // 2
                if after - place != known_length or not _same(out, place, pool, known, known_length):
                    differs = True
                place = after
            elif known_length > 2:
                differs = True
        at = old
        while at < end:
            where[pool[at]] = -1
            at += 2 + 2 * int(pool[at + 1])
        if guided:
            where_a[:] = -1
            where_b[:] = -1
        if full:
            used[0] = first
            return number - begin
        if not differs:
            place = first
        out_length[number] = place - first
        changed[number] = differs
    used[0] = place
    return stop - begin
