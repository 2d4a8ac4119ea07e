"""Equation (4) at receivers: Ṽ_s · Π_i V_i from self-visibility cuts and interpolated fields, V.A.4.

Each receiver walks over the objects that it does not leave out (`placement`); eight samples of each are
interpolated and the results multiplied, by intervals or by the counters of V.A.3. Both give the same nodes.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from studio_core.jit import kernel
from studio_plugins.cuts.paper.height_cuts import aligned_height, bit_at, height_at, value_at
from studio_plugins.cuts.paper.operations import (
    INTERPOLATION,
    PRODUCT,
    add_changes,
    by_counters,
    multiply_sums,
    next_boundary,
)
from studio_plugins.cuts.paper.placement import (
    COARSE,
    MISSING,
    bytes_at,
    f32_at,
    i32_at,
    i64_at,
    neighbours_of,
    open_nodes,
    u16_at,
)
from studio_plugins.cuts.paper.shells import NEIGHBOURS

U8 = npt.NDArray[np.uint8]
U16 = npt.NDArray[np.uint16]
I32 = npt.NDArray[np.int32]
I64 = npt.NDArray[np.int64]
F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]


@kernel
def push(
    top: int,
    leaf: int,
    height: int,
    value: np.float32,
    limit: np.float32,
    heights: U8,
    values: F32,
    spreads: F32,
) -> int:
    """Adds the node that begins at `leaf`, next from the left, to the cut; returns the count of nodes.

    Siblings merge to their average while the error, that of `height_cuts.cut_of_leaves`, allows it:
    `limit` is its square times S, negative for no merging.
    """
    spread = np.float32(0)
    while (leaf >> height) & 1 and top > 0 and heights[top - 1] == height:
        apart = values[top - 1] - value
        joint = spreads[top - 1] + spread + np.float32(0.5) * np.float32(1 << height) * apart * apart
        if joint > limit:
            break
        top -= 1
        value = np.float32(0.5) * (values[top] + value)
        spread = joint
        leaf -= 1 << height
        height += 1
    heights[top], values[top], spreads[top] = height, value, spread
    return top + 1


@kernel
def _stack(size: int) -> tuple[U8, F32, F32]:
    return np.empty(size, np.uint8), np.empty(size, np.float32), np.empty(size, np.float32)


@kernel
def put_nodes(count: int, heights: U8, values: F32, k: int, numbers: U16, out: F32) -> int:
    """Heap numbers and values of the nodes of a cut that are not 0; returns how many."""
    made, leaf = 0, 0
    for item in range(count):
        height = int(heights[item])
        if values[item] > 0:
            numbers[made] = (1 << (k - height)) + (leaf >> height)
            out[made] = values[item]
            made += 1
        leaf += 1 << height
    return made


@kernel
def first_factor(
    svc: U8,
    at: int,
    nodes: int,
    numbers_address: int,
    values_address: int,
    size: int,
    k: int,
    heights: U8,
    values: F32,
) -> int:
    """What objects are multiplied to, as a whole cut: Ṽ_s, or for size ≥ 0 a product made before."""
    if size < 0:
        for item in range(nodes):
            heights[item] = height_at(svc, at, item)
            values[item] = value_at(svc, at, nodes, item)
        return nodes
    numbers, given = u16_at(numbers_address), f32_at(values_address)
    count, leaf = 0, 0
    for item in range(size + 1):
        height, start = 0, 1 << k
        if item < size:
            while (int(numbers[item]) << height) < 1 << k:
                height += 1
            start = (int(numbers[item]) << height) - (1 << k)
        while leaf < start:  # the nodes between are 0
            heights[count], values[count] = aligned_height(leaf, start), np.float32(0)
            leaf += 1 << heights[count]
            count += 1
        if item < size:
            heights[count], values[count] = height, given[item]
            leaf += 1 << height
            count += 1
    return count


@kernel
def multiply(
    start: int,
    stop: int,
    points: I64,
    positions: F32,
    normals: F32,
    object_of: I32,
    selfs: I64,
    fields: I64,
    spheres: F64,
    shells: int,
    m: int,
    k: int,
    horizon: bool,
    hidden: bool,
    cones: F64,
    counts: I64,
    only: U8,
    base_numbers: I64,
    base_values: I64,
    base_sizes: I64,
    limit: np.float32,
    numbers: U16,
    values: F32,
    sizes: I32,
) -> int:
    """The cut of v_k at points[start:stop], by intervals: heap numbers and values of nodes that are not 0.

    Objects in `only` (O,) are multiplied to Ṽ_s, or to the product at the addresses of base_… (P,), of
    base_sizes (P,) nodes (−1: to Ṽ_s). sizes (stop − start,) gets the counts of nodes; returns how many in
    all. `limit` as in `push`.
    """
    size = 1 << k
    samples, weights = np.empty(NEIGHBOURS, np.int64), np.empty(NEIGHBOURS, np.int32)
    mask = np.empty(1 << COARSE, np.uint8)
    product = np.empty(size, np.float32)
    differences = np.zeros(size + 64, np.int32)
    changed = np.zeros((size >> 6) + 1, np.uint64)
    boundaries = np.zeros((size >> 6) + 1, np.uint64)
    heights, averages, spreads = _stack(size)
    base_heights, base_factors = np.empty(size, np.uint8), np.empty(size, np.float32)
    made = 0
    for row in range(start, stop):
        p = points[row]
        own = object_of[p]
        slot = i32_at(selfs[own, 0])[p - selfs[own, 4]]
        at = i64_at(selfs[own, 1])[slot]
        nodes = int(i32_at(selfs[own, 2])[slot])
        svc = bytes_at(selfs[own, 3])
        if hidden:
            open_nodes(svc, at, nodes, k, mask)
        product[:] = np.float32(1)
        boundaries[:] = np.uint64(0)
        for i in range(len(spheres)):
            if i == own or only[i] == 0 or spheres[i, 3] <= 0:
                continue
            count = neighbours_of(
                positions[p],
                normals[p],
                spheres[i],
                horizon,
                hidden,
                cones,
                mask,
                shells,
                m,
                samples,
                weights,
                counts[row],
            )
            table = i32_at(fields[i, 0])
            starts = i64_at(fields[i, 1])
            lengths = i32_at(fields[i, 2])
            records = bytes_at(fields[i, 3])
            for item in range(count):
                entry = table[samples[item]] - 1
                if entry < 0:
                    counts[row, MISSING] += 1
                    continue
                add_changes(records, starts[entry], lengths[entry], weights[item], differences, changed)
            if count > 0:
                multiply_sums(differences, changed, product, boundaries)
        nodes = first_factor(
            svc,
            at,
            nodes,
            base_numbers[row],
            base_values[row],
            base_sizes[row],
            k,
            base_heights,
            base_factors,
        )
        top, leaf = 0, 0
        for item in range(nodes):
            value = base_factors[item]
            end = leaf + (1 << base_heights[item])
            while leaf < end:
                edge = next_boundary(boundaries, leaf, end) if value > 0 else end
                v = value * product[leaf]
                while leaf < edge:
                    span = aligned_height(leaf, edge)
                    top = push(top, leaf, span, v, limit, heights, averages, spreads)
                    leaf += 1 << span
        sizes[row - start] = put_nodes(top, heights, averages, k, numbers[made:], values[made:])
        made += sizes[row - start]
    return made


@kernel
def multiply_by_counters(
    start: int,
    stop: int,
    points: I64,
    positions: F32,
    normals: F32,
    object_of: I32,
    selfs: I64,
    fields: I64,
    spheres: F64,
    shells: int,
    m: int,
    k: int,
    horizon: bool,
    hidden: bool,
    cones: F64,
    counts: I64,
    only: U8,
    base_numbers: I64,
    base_values: I64,
    base_sizes: I64,
    limit: np.float32,
    numbers: U16,
    values: F32,
    sizes: I32,
) -> int:
    """The same as `multiply` by the counters of V.A.3: interpolation, then product with what was made."""
    size = 1 << k
    samples, weights = np.empty(NEIGHBOURS, np.int64), np.empty(NEIGHBOURS, np.int32)
    mask = np.empty(1 << COARSE, np.uint8)
    scratch, first = np.empty((2, NEIGHBOURS), np.int64), np.empty(NEIGHBOURS + 1, np.int64)
    heights = np.empty(NEIGHBOURS * size, np.uint8)
    bits = np.empty(NEIGHBOURS * size, np.float32)
    pair = np.empty(3, np.int64)
    # two cuts to multiply, one behind the other, and the product
    two_heights, two_values = np.empty(2 * size, np.uint8), np.empty(2 * size, np.float32)
    out_heights, out_values, spreads = _stack(size)
    made = 0
    for row in range(start, stop):
        p = points[row]
        own = object_of[p]
        slot = i32_at(selfs[own, 0])[p - selfs[own, 4]]
        at = i64_at(selfs[own, 1])[slot]
        nodes = int(i32_at(selfs[own, 2])[slot])
        svc = bytes_at(selfs[own, 3])
        if hidden:
            open_nodes(svc, at, nodes, k, mask)
        nodes = first_factor(
            svc,
            at,
            nodes,
            base_numbers[row],
            base_values[row],
            base_sizes[row],
            k,
            two_heights,
            two_values,
        )
        for i in range(len(spheres)):
            if i == own or only[i] == 0 or spheres[i, 3] <= 0:
                continue
            count = neighbours_of(
                positions[p],
                normals[p],
                spheres[i],
                horizon,
                hidden,
                cones,
                mask,
                shells,
                m,
                samples,
                weights,
                counts[row],
            )
            if count == 0:
                continue
            table = i32_at(fields[i, 0])
            starts = i64_at(fields[i, 1])
            lengths = i32_at(fields[i, 2])
            records = bytes_at(fields[i, 3])
            first[0] = 0
            for item in range(count):
                entry = table[samples[item]] - 1
                if entry < 0:
                    counts[row, MISSING] += 1
                    heights[first[item]], bits[first[item]] = k, np.float32(1)
                    first[item + 1] = first[item] + 1
                    continue
                for node in range(lengths[entry]):
                    heights[first[item] + node] = height_at(records, starts[entry], node)
                    bits[first[item] + node] = bit_at(records, starts[entry], lengths[entry], node)
                first[item + 1] = first[item] + lengths[entry]
            between = by_counters(
                INTERPOLATION,
                heights,
                bits,
                first[: count + 1],
                weights,
                scratch[0],
                scratch[1],
                two_heights[nodes:],
                two_values[nodes:],
            )
            pair[0], pair[1], pair[2] = 0, nodes, nodes + between
            nodes = by_counters(
                PRODUCT,
                two_heights,
                two_values,
                pair,
                weights,
                scratch[0],
                scratch[1],
                out_heights,
                out_values,
            )
            two_heights[:nodes] = out_heights[:nodes]
            two_values[:nodes] = out_values[:nodes]
        top, leaf = 0, 0
        for item in range(nodes):
            height = int(two_heights[item])
            top = push(top, leaf, height, two_values[item], limit, out_heights, out_values, spreads)
            leaf += 1 << height
        sizes[row - start] = put_nodes(top, out_heights, out_values, k, numbers[made:], values[made:])
        made += sizes[row - start]
    return made
