"""Bounding volume hierarchies over boxes: binned surface-area heuristic, in numba.

The same builder serves triangles of a mesh and instances of a scene. Wald 2007, "On fast construction
of SAH-based bounding volume hierarchies", with 16 bins along the widest axis of the centroids.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from studio_core.jit import kernel

F32 = npt.NDArray[np.float32]
I32 = npt.NDArray[np.int32]

LEAF_SIZE = 4
BINS = 16
HEURISTIC_DEPTH = 40  # below it nodes are halved, so that no tree is deeper than a traversal's stack
STACK = 128


@kernel
def triangle_boxes(triangles: F32) -> F32:
    """Boxes (F, 6), minimum then maximum, of triangles (F, 9): three corners each."""
    boxes = np.empty((len(triangles), 6), np.float32)
    for i in range(len(triangles)):
        for axis in range(3):
            a, b, c = triangles[i, axis], triangles[i, 3 + axis], triangles[i, 6 + axis]
            boxes[i, axis] = min(a, b, c)
            boxes[i, 3 + axis] = max(a, b, c)
    return boxes


@kernel
def _half_area(low: npt.NDArray[np.float64], high: npt.NDArray[np.float64]) -> float:
    x, y, z = high[0] - low[0], high[1] - low[1], high[2] - low[2]
    return float(x * y + y * z + z * x)


@kernel
def _split(boxes: F32, order: I32, start: int, stop: int, depth: int, bins: npt.NDArray[np.float64]) -> int:
    """Reorders order[start:stop] and returns where the right half begins.

    `bins` is scratch (2·BINS, 8): per bin minimum, maximum, count, and the cost to its right.
    """
    low = np.full(3, np.inf)
    high = np.full(3, -np.inf)
    for i in range(start, stop):
        for axis in range(3):
            centre = 0.5 * (np.float64(boxes[order[i], axis]) + np.float64(boxes[order[i], 3 + axis]))
            low[axis] = min(low[axis], centre)
            high[axis] = max(high[axis], centre)
    axis = 0
    for other in range(1, 3):
        if high[other] - low[other] > high[axis] - low[axis]:
            axis = other
    extent = high[axis] - low[axis]
    middle = (start + stop) // 2
    if depth >= HEURISTIC_DEPTH or not extent > 0.0:
        return middle
    scale = BINS * (1.0 - 1e-9) / extent
    for b in range(2 * BINS):
        bins[b, 0:3] = np.inf
        bins[b, 3:6] = -np.inf
        bins[b, 6:8] = 0.0
    for i in range(start, stop):
        box = boxes[order[i]]
        b = int((0.5 * (np.float64(box[axis]) + np.float64(box[3 + axis])) - low[axis]) * scale)
        for a in range(3):
            bins[b, a] = min(bins[b, a], np.float64(box[a]))
            bins[b, 3 + a] = max(bins[b, 3 + a], np.float64(box[3 + a]))
        bins[b, 6] += 1.0
    # Suffix boxes and counts in the second half of the scratch, then a sweep from the left.
    run = bins[2 * BINS - 1]
    for b in range(BINS - 1, 0, -1):
        for a in range(3):
            run[a] = min(run[a], bins[b, a])
            run[3 + a] = max(run[3 + a], bins[b, 3 + a])
        run[6] += bins[b, 6]
        bins[b, 7] = _half_area(run[0:3], run[3:6]) * run[6] if run[6] > 0.0 else 0.0
    run = bins[2 * BINS - 2]
    best, cut = np.inf, -1
    for b in range(BINS - 1):
        for a in range(3):
            run[a] = min(run[a], bins[b, a])
            run[3 + a] = max(run[3 + a], bins[b, 3 + a])
        run[6] += bins[b, 6]
        if run[6] == 0.0 or run[6] == stop - start:
            continue
        cost = _half_area(run[0:3], run[3:6]) * run[6] + bins[b + 1, 7]
        if cost < best:
            best, cut = cost, b
    if cut < 0:
        return middle
    left, right = start, stop - 1
    while left <= right:
        box = boxes[order[left]]
        b = int((0.5 * (np.float64(box[axis]) + np.float64(box[3 + axis])) - low[axis]) * scale)
        if b <= cut:
            left += 1
        else:
            order[left], order[right] = order[right], order[left]
            right -= 1
    return left


@kernel
def build(boxes: F32) -> tuple[F32, I32, I32]:
    """A tree over boxes (n ≥ 1, 6): node bounds (m, 6), links (m, 2), order of the boxes (n,).

    links[i] is (first child, 0) of an inner node, whose second child follows the first, or
    (first, count) of a leaf that holds order[first : first + count].
    """
    n = len(boxes)
    order = np.arange(n).astype(np.int32)
    bounds = np.empty((2 * n, 6), np.float32)
    links = np.zeros((2 * n, 2), np.int32)
    bins = np.empty((2 * BINS, 8), np.float64)
    stack = np.empty((STACK, 4), np.int64)
    stack[0] = np.array([0, 0, n, 0])
    height, used = 1, 1
    while height > 0:
        height -= 1
        node, start, stop, depth = stack[height]
        bounds[node, 0:3] = np.inf
        bounds[node, 3:6] = -np.inf
        for i in range(start, stop):
            for a in range(3):
                bounds[node, a] = min(bounds[node, a], boxes[order[i], a])
                bounds[node, 3 + a] = max(bounds[node, 3 + a], boxes[order[i], 3 + a])
        if stop - start <= LEAF_SIZE:
            links[node, 0], links[node, 1] = start, stop - start
            continue
        middle = _split(boxes, order, start, stop, depth, bins)
        links[node, 0] = used
        for child, first, last in ((used, start, middle), (used + 1, middle, stop)):
            stack[height, 0], stack[height, 1] = child, first
            stack[height, 2], stack[height, 3] = last, depth + 1
            height += 1
        used += 2
    return bounds[:used].copy(), links[:used].copy(), order
