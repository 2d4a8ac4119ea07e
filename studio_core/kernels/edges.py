"""Pixels that a few samples do not tell: what they see is not one smooth surface of one material."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from studio_core.jit import kernel

F32 = npt.NDArray[np.float32]
I32 = npt.NDArray[np.int32]
U32 = npt.NDArray[np.uint32]
Bools = npt.NDArray[np.bool_]

JUMP = np.float32(0.03)  # of the distance: one of two samples sees past what the other sees
SMOOTH = np.float32(0.94**2)  # squared cosine between normals, 20°: beyond it lies a crease
_ONE = np.float32(1)


@kernel
def mark_edges(
    start: int,
    stop: int,
    width: int,
    n: int,
    face: I32,
    u: F32,
    v: F32,
    distance: F32,
    faces: U32,
    normals: F32,
    objects: I32,
    face_material: I32,
    marked: Bools,
) -> None:
    """Marks (P,) pixels between whose samples, or between which, something ends; looks right of and below
    the samples of pixels start … stop−1.

    It ends between samples next to each other of which one hits nothing, or that see other objects or
    materials, or distances more than JUMP apart, or normals more than 20° apart: but not where their faces
    share a vertex, across which shading is smooth. Hits as in `compose.shade_hits`, n × n in each pixel,
    `width` pixels in a row; faces (F, 3), normals (V, 3), objects (V,) and face_material (F,) of the mesh.

    In one piece, as `compose.shade_hits` and for the same reason.
    """
    count, pixels = n * n, len(marked)
    column, below = start % width - 1, width * count
    for pixel in range(start, stop):
        begin = pixel * count
        column = column + 1 if column + 1 < width else 0  # counted on: dividing takes longer
        last_column, last_row = column + 1 == width, pixel + width >= pixels
        first, same = face[begin], True
        for sample in range(begin + 1, begin + count):
            same &= face[sample] == first
        if not last_column:
            for y in range(n):
                same &= face[begin + count + y * n] == first
        if not last_row:
            for x in range(n):
                same &= face[begin + below + x] == first
        if same:
            continue
        here = begin
        for y in range(n):
            for x in range(n):
                f = face[here]
                for way in range(2):
                    other = pixel
                    if way == 0:
                        there = here + 1
                        if x + 1 == n:
                            if last_column:
                                continue
                            there, other = begin + count + y * n, pixel + 1
                    else:
                        there = here + n
                        if y + 1 == n:
                            if last_row:
                                continue
                            there, other = begin + below + x, pixel + width
                    g = face[there]
                    if f == g or (marked[pixel] and marked[other]):
                        continue
                    if f >= 0 and g >= 0 and face_material[f] == face_material[g]:
                        i, j, k = faces[f, 0], faces[f, 1], faces[f, 2]
                        p, q, r = faces[g, 0], faces[g, 1], faces[g, 2]
                        if i in (p, q, r) or j in (p, q, r) or k in (p, q, r):
                            continue
                        near, far = distance[here], distance[there]
                        if objects[i] == objects[p] and abs(near - far) <= JUMP * min(near, far):
                            ua, va, ub, vb = u[here], v[here], u[there], v[there]
                            wa, wb = _ONE - ua - va, _ONE - ub - vb
                            dot, one, two = np.float32(0), np.float32(0), np.float32(0)
                            for c in range(3):
                                a = wa * normals[i, c] + ua * normals[j, c] + va * normals[k, c]
                                b = wb * normals[p, c] + ub * normals[q, c] + vb * normals[r, c]
                                dot, one, two = dot + a * b, one + a * a, two + b * b
                            if dot >= 0 and dot * dot >= SMOOTH * one * two:
                                continue
                    marked[pixel] = marked[other] = True
                here += 1
