"""Which face of a mesh each texel of an atlas shows."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from studio_core.jit import kernel

F32 = npt.NDArray[np.float32]
I32 = npt.NDArray[np.int32]

SHARED = 1e-3
"""Barycentric distance from an edge under which two faces may have a texel's middle in common."""


@kernel
def cover(corners: npt.NDArray[np.float64], face: I32, second: F32, third: F32, often: I32) -> None:
    """Lays faces (F, 3, 2), in texels with the first row's middle at y = 0.5, over an atlas (H, W).

    Where a face has a texel's middle, `face` is its number, `second` and `third` the weights of those
    corners; elsewhere they stay as they are. `often` counts the faces that have it well inside.
    """
    height, width = face.shape
    for f in range(len(corners)):
        ax, ay = corners[f, 0, 0], corners[f, 0, 1]
        bx, by = corners[f, 1, 0] - ax, corners[f, 1, 1] - ay
        cx, cy = corners[f, 2, 0] - ax, corners[f, 2, 1] - ay
        area = bx * cy - by * cx
        if area == 0:
            continue
        left, right = min(0.0, bx, cx) + ax, max(0.0, bx, cx) + ax
        low, high = min(0.0, by, cy) + ay, max(0.0, by, cy) + ay
        for i in range(max(int(np.floor(low - 0.5)), 0), min(int(np.ceil(high + 0.5)), height)):
            for j in range(max(int(np.floor(left - 0.5)), 0), min(int(np.ceil(right + 0.5)), width)):
                x, y = j + 0.5 - ax, i + 0.5 - ay
                u, v = (x * cy - y * cx) / area, (bx * y - by * x) / area
                nearest = min(u, v, 1 - u - v)
                if nearest < -1e-9:
                    continue
                face[i, j], second[i, j], third[i, j] = f, u, v
                if nearest > SHARED:
                    often[i, j] += 1
