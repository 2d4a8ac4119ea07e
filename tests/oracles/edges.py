"""Pixels in which something ends, pair by pair of neighbouring samples, float64."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

JUMP, CREASE = 0.03, 20.0  # of the nearer distance; degrees


def sample_grid(values, width, n):
    """(rows·n, width·n) what samples in the order of pixels hold, as they lie in the picture."""
    rows = len(values) // (width * n * n)
    return values.reshape(rows, width, n, n).transpose(0, 2, 1, 3).reshape(rows * n, width * n)


def ends(mesh, a, b):
    """Whether something ends between two samples (face, u, v, distance), and whether rounding may decide."""
    if a[0] == b[0]:
        return False, False
    if a[0] < 0 or b[0] < 0 or mesh.face_material[a[0]] != mesh.face_material[b[0]]:
        return True, False
    corners, others = mesh.faces[a[0]], mesh.faces[b[0]]
    if set(corners.tolist()) & set(others.tolist()):
        return False, False
    if mesh.object[corners[0]] != mesh.object[others[0]]:
        return True, False
    jump = abs(a[3] - b[3]) / min(a[3], b[3])
    normals = [
        np.array([1 - s[1] - s[2], s[1], s[2]]) @ mesh.normals[mesh.faces[s[0]]].astype(np.float64)
        for s in (a, b)
    ]
    cosine = normals[0] @ normals[1] / np.prod(np.linalg.norm(normals, axis=1))
    least = np.cos(np.radians(CREASE))
    unsure = abs(jump - JUMP) < 1e-4 or abs(cosine - least) < 2e-3
    return bool(jump > JUMP or cosine < least), bool(unsure)


def edge_pixels(mesh, face, u, v, distance, width, n) -> tuple[npt.NDArray[np.bool_], npt.NDArray[np.bool_]]:
    """(P,) pixels in which, or right beside which, something ends; and where rounding may decide."""
    index = sample_grid(np.arange(len(face)), width, n)
    found, unsure = np.zeros((2, len(face) // (n * n)), np.bool_)
    for y, x in np.ndindex(index.shape):
        for there in ((y, x + 1), (y + 1, x)):
            if there[0] < index.shape[0] and there[1] < index.shape[1]:
                pair = [index[y, x], index[there]]
                one, other = ((int(face[s]), float(u[s]), float(v[s]), float(distance[s])) for s in pair)
                end, doubt = ends(mesh, one, other)
                for s in pair:
                    found[s // (n * n)] |= end
                    unsure[s // (n * n)] |= doubt
    return found, unsure
