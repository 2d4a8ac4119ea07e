"""Where hits on a mesh lie after it was refined."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from studio_core.jit import kernel

F32 = npt.NDArray[np.float32]
I32 = npt.NDArray[np.int32]
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
