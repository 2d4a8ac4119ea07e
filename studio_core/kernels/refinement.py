"""Where hits on a mesh lie after it was refined, which vertices new ones lie between, and what faces miss."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from studio_core.jit import kernel

F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]
I32 = npt.NDArray[np.int32]
I64 = npt.NDArray[np.int64]
Bools = npt.NDArray[np.bool_]
NO_PART = 2147483647


@kernel
def locate(
    start: int,
    stop: int,
    face: I32,
    u: F32,
    v: F32,
    root: I32,
    part: I32,
    within: F32,
    found: I32,
    found_u: F32,
    found_v: F32,
) -> None:
    """Hits start … stop−1 on a mesh, (N,) face or −1 and barycentrics, carried to the refined mesh.

    root, part, within: a `FaceTree`. On an edge between parts rounding may put a point outside of both: it
    goes to the part it is least outside of.
    """
    for n in range(start, stop):
        here = face[n]
        if here < 0:
            found[n], found_u[n], found_v[n] = -1, u[n], v[n]
            continue
        reference = root[here]
        a, b = float(u[n]), float(v[n])
        while reference >= 0:
            node = reference
            best = -np.inf
            x, y = 0.0, 0.0
            for k in range(4):
                if part[node, k] == NO_PART:
                    break
                s = within[node, k, 0] + within[node, k, 1] * a + within[node, k, 2] * b
                t = within[node, k, 3] + within[node, k, 4] * a + within[node, k, 5] * b
                least = min(s, t, 1.0 - s - t)
                if k == 0 or least > best:
                    best, reference, x, y = least, part[node, k], s, t
            a, b = x, y
        found[n] = ~reference
        found_u[n], found_v[n] = np.float32(a), np.float32(b)


@kernel
def descend(between: I64, wanted: Bools) -> None:
    """Of wanted vertices (V,), those that refinement made are no longer wanted, but what they lie between is.

    between (V, 2): the vertices that each was put between, before it in number; twice itself for others.
    """
    for i in range(len(between) - 1, -1, -1):
        if wanted[i] and between[i, 0] != between[i, 1]:
            wanted[i] = False
            wanted[between[i, 0]] = True
            wanted[between[i, 1]] = True


@kernel
def lift(between: I64, mass: F64) -> None:
    """Mass (V,) of the vertices' hat functions on the refined mesh to that of the meshes they were made on.

    The hat of a coarser mesh is that of the finer one and half of those in the middle of its edges.
    """
    for i in range(len(between) - 1, -1, -1):
        if between[i, 0] != between[i, 1]:
            mass[between[i, 0]] += 0.5 * mass[i]
            mass[between[i, 1]] += 0.5 * mass[i]


@kernel
def spread(between: I64, known: Bools, values: F32) -> None:
    """Values (V, C) of vertices that refinement made become the mean of the two they lie between.

    between as in `descend`. `known` (V,) tells which vertices have values; where one of two ends has, its own
    are taken over.
    """
    for i in range(len(between)):
        p, q = between[i, 0], between[i, 1]
        if p == q:
            continue
        known[i] = known[p] or known[q]
        if not known[i]:
            continue
        if not known[p]:
            p = q
        elif not known[q]:
            q = p
        for c in range(values.shape[1]):
            values[i, c] = np.float32(0.5) * (values[p, c] + values[q, c])


@kernel
def far_corners(
    positions: F32, corners: I64, radiance: F32, order: I64, start: I64, count: I64, missed: F64
) -> None:
    """missed (E,): the more that linear functions of an edge's two faces miss at each other's far corner.

    corners (F, 3) vertices of faces; order, start, count: half-edges by edge, as `topology.Edges` has them.
    A far corner's foot in the other face's plane counts; root mean square over the channels of radiance
    (V, 3). −1 for edges that do not have two faces.
    """
    for e in range(len(count)):
        missed[e] = -1.0
        if count[e] != 2:
            continue
        for turn in range(2):
            face, across = order[start[e] + turn] // 3, order[start[e] + 1 - turn]
            i, j, k = corners[face, 0], corners[face, 1], corners[face, 2]
            far = corners[across // 3, (across + 2) % 3]
            g11, g12, g22, r1, r2 = 0.0, 0.0, 0.0, 0.0, 0.0
            for c in range(3):
                a = float(positions[i, c])
                p, q, r = positions[j, c] - a, positions[k, c] - a, positions[far, c] - a
                g11 += p * p
                g12 += p * q
                g22 += q * q
                r1 += p * r
                r2 += q * r
            det = max(g11 * g22 - g12 * g12, 1e-12 * g11 * g22 + 1e-300)
            u, v = (r1 * g22 - r2 * g12) / det, (r2 * g11 - r1 * g12) / det
            w = min(max(1.0 - u - v, -4.0), 4.0)  # of needles only so far
            u, v = min(max(u, -4.0), 4.0), min(max(v, -4.0), 4.0)
            square = 0.0
            for c in range(radiance.shape[1]):
                miss = w * radiance[i, c] + u * radiance[j, c] + v * radiance[k, c] - radiance[far, c]
                square += miss * miss
            missed[e] = max(missed[e], np.sqrt(square / radiance.shape[1]))
