"""Where hits on a mesh lie after it was refined, and what old vertices tell of new ones."""

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
def prolong(between: I64, known: Bools, values: F32) -> None:
    """Values (V, C) of vertices that refinement made and that are not known: the means of those between.

    With all that `descend` left, it gives what the unrefined mesh would show.
    """
    for i in range(len(between)):
        if not known[i] and between[i, 0] != between[i, 1]:
            for c in range(values.shape[1]):
                values[i, c] = np.float32(0.5) * (values[between[i, 0], c] + values[between[i, 1], c])


@kernel
def lift(between: I64, mass: F64) -> None:
    """Mass (V,) of the vertices' hat functions on the refined mesh to that of the meshes they were made on.

    The hat of a coarser mesh is that of the finer one and half of those in the middle of its edges.
    """
    for i in range(len(between) - 1, -1, -1):
        if between[i, 0] != between[i, 1]:
            mass[between[i, 0]] += 0.5 * mass[i]
            mass[between[i, 1]] += 0.5 * mass[i]
