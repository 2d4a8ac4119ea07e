"""Which side of which face a picture shows, and the vertices that belong to it.

Seen from one eye, a plane face shows the same side to all of its samples: the sign of its plane's height
above the eye decides it, once a face.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from studio_core.jit import kernel

F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]
I32 = npt.NDArray[np.int32]
U32 = npt.NDArray[np.uint32]
Bools = npt.NDArray[np.bool_]

NO_FACE = np.uint32(0xFFFFFFFF)
EDGE_ON = 1e-5  # of the distance: both sides of such a face count as seen


@kernel
def plane_height(positions: F32, i: int, j: int, k: int, eye: F64) -> float:
    """Metres from the eye to the plane of a face along its normal; > 0: the eye is behind it, 0: no area."""
    ax, ay, az = np.float64(positions[i, 0]), np.float64(positions[i, 1]), np.float64(positions[i, 2])
    bx, by, bz = positions[j, 0] - ax, positions[j, 1] - ay, positions[j, 2] - az
    cx, cy, cz = positions[k, 0] - ax, positions[k, 1] - ay, positions[k, 2] - az
    nx, ny, nz = by * cz - bz * cy, bz * cx - bx * cz, bx * cy - by * cx
    length = np.sqrt(nx * nx + ny * ny + nz * nz)
    if not length > 0.0:
        return 0.0
    made: float = (nx * (ax - eye[0]) + ny * (ay - eye[1]) + nz * (az - eye[2])) / length
    return made


@kernel
def shown_sides(
    start: int, stop: int, positions: F32, faces: U32, back_faces: U32, eye: F64, shown: U32, height: F32
) -> None:
    """For faces start … stop−1 the corners (F, 3) on the side that `eye` sees, and its `plane_height`."""
    for f in range(start, stop):
        away = plane_height(positions, faces[f, 0], faces[f, 1], faces[f, 2], eye)
        height[f] = away
        if away > 0 and back_faces[f, 0] != NO_FACE:
            shown[f, 0], shown[f, 1], shown[f, 2] = back_faces[f, 0], back_faces[f, 1], back_faces[f, 2]
        else:
            shown[f, 0], shown[f, 1], shown[f, 2] = faces[f, 0], faces[f, 1], faces[f, 2]


@kernel
def mark_faces(face: I32, touched: Bools) -> None:
    """Marks every face that is hit; −1 is nothing."""
    last = -1
    for n in range(len(face)):
        if face[n] != last:
            last = face[n]
            if last >= 0:
                touched[last] = True


@kernel
def mark_vertices(touched: Bools, positions: F32, faces: U32, back_faces: U32, eye: F64, seen: Bools) -> None:
    """Marks the corners of every touched face on the side that `eye` sees; edge-on, both."""
    for f in range(len(touched)):
        if not touched[f]:
            continue
        front, back = True, back_faces[f, 0] != NO_FACE
        if back:
            i, j, k = faces[f, 0], faces[f, 1], faces[f, 2]
            away = plane_height(positions, i, j, k, eye)
            reach = EDGE_ON * (
                abs(positions[i, 0] - eye[0]) + abs(positions[i, 1] - eye[1]) + abs(positions[i, 2] - eye[2])
            )
            front, back = away <= reach, away >= -reach
        for corner in range(3):
            if front:
                seen[faces[f, corner]] = True
            if back:
                seen[back_faces[f, corner]] = True
