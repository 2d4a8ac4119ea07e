"""Means of pictures over what places of a surface stand for."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from studio_core.scene.shading_mesh import NO_BACK, ShadingMesh
from studio_core.scene.world_mesh import WorldMesh

F32 = npt.NDArray[np.float32]


def picture_areas(mesh: WorldMesh | ShadingMesh) -> F32:
    """(V,) how much of the texture coordinates' plane belongs to each vertex: a third of its faces'."""
    total = np.zeros(len(mesh))
    if mesh.uvs is None:
        return total.astype(np.float32)
    seen = np.flatnonzero(mesh.back_faces[:, 0] != NO_BACK)
    for faces in (mesh.faces, mesh.back_faces[seen]):
        corners = mesh.uvs[faces].astype(np.float64)
        one, other = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
        area = np.abs(one[:, 0] * other[:, 1] - one[:, 1] * other[:, 0]) / 6
        total += np.bincount(faces.reshape(-1), np.repeat(area, 3), minlength=len(total))
    return total.astype(np.float32)


def trilinear(levels: Sequence[F32], uvs: F32, area: F32) -> F32:
    """(P, …) means over squares about uvs (P, 2) that cover `area` (P,) of a picture, which repeats.

    Its levels (h, w, …) are halved down to one texel, rows from v = 0 up. Bilinear on the two levels whose
    texels come next to the square, and linear between them.
    """
    height, width = levels[0].shape[:2]
    tail = levels[0].shape[2:]
    texels = np.maximum(area.astype(np.float64) * height * width, 1.0)
    place = np.minimum(0.5 * np.log2(texels), len(levels) - 1)
    low = np.floor(place).astype(np.int64)
    made = np.zeros((len(uvs), *tail), np.float32)
    for level in np.unique(low).tolist():
        own = np.flatnonzero(low == level)
        finer = bilinear(levels[level], uvs[own])
        coarser = bilinear(levels[min(level + 1, len(levels) - 1)], uvs[own])
        share = (place[own] - level).astype(np.float32).reshape(-1, *(1,) * len(tail))
        made[own] = finer + share * (coarser - finer)
    return made


def bilinear(texels: F32, uvs: F32) -> F32:
    """(P, …) between texels (h, w, …) at uvs (P, 2)."""
    height, width = texels.shape[:2]
    x, y = uvs[:, 0].astype(np.float64) * width - 0.5, uvs[:, 1].astype(np.float64) * height - 0.5
    x0, y0 = np.floor(x), np.floor(y)
    tail = (1,) * (texels.ndim - 2)
    fx, fy = (x - x0).reshape(-1, *tail), (y - y0).reshape(-1, *tail)
    i, j = x0.astype(np.int64), y0.astype(np.int64)
    left, right, below, above = i % width, (i + 1) % width, j % height, (j + 1) % height
    low = texels[below, left] * (1 - fx) + texels[below, right] * fx
    high = texels[above, left] * (1 - fx) + texels[above, right] * fx
    return np.asarray(low * (1 - fy) + high * fy, np.float32)


__all__ = ["bilinear", "picture_areas", "trilinear"]
