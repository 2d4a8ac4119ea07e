"""Atlases: texture coordinates by which every spot of a surface has texels of its own.

`unwrap` makes coordinates for patterns, whose charts lie over each other in metres; here they are laid side
by side. Coordinates that a mesh has already are an atlas where they stay in the unit square and cover nothing
twice.
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from studio_core.kernels.atlas import cover
from studio_core.scene.geometry import Geometry
from studio_core.scene.topology import components
from studio_core.scene.unwrap import unwrapped

F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]
I32 = npt.NDArray[np.int32]
I64 = npt.NDArray[np.int64]

LEAST, MOST = 16, 2048
"""Texels along a side."""
MARGIN = 8
"""Texels between charts, half of them of each: finer mip levels do not mix them."""
LOOKED_AT = 512
TWICE = 2e-3
"""Share of a mesh' texels that may be covered twice, where edges meet in between."""


@dataclass(frozen=True, eq=False)
class Atlas:
    """A mesh whose coordinates show each of its spots once, `size` texels along a side.

    `texel` is a texel's length on the surface, in the mesh' own unit. `made` where the mesh had none such;
    faces keep their order, and positions are doubled where charts meet.
    """

    geometry: Geometry
    size: int
    texel: float
    made: bool


@dataclass(frozen=True, eq=False)
class Texels:
    """The N texels of an atlas that show a face: their places in it (row from v = 0 up, column), the face's
    number, and the weights of its corners (N, 3).
    """

    row: I64
    column: I64
    face: I64
    shares: F64

    def of(self, geometry: Geometry, values: npt.NDArray[np.generic]) -> F64:
        """(N, C) of values (P, C) at the mesh' positions."""
        corners = np.asarray(values, np.float64)[geometry.faces[self.face]]
        return np.asarray(np.einsum("nk,nkc->nc", self.shares, corners))


def atlas_of(geometry: Geometry, texel: float, most: int = MOST) -> Atlas:
    """With texels of that length, or as long as `most` of them along a side allow."""
    if is_atlas(geometry):
        assert geometry.uvs is not None
        side = math.sqrt(_area(geometry) / _area_in_map(geometry))
        return Atlas(geometry, *_sized(side, texel, most), False)
    found = unwrapped(geometry).geometry
    assert found.uvs is not None
    uvs, faces = found.uvs.astype(np.float64), found.faces.astype(np.int64)
    chart = components(
        len(uvs), np.concatenate([faces[:, 0], faces[:, 1]]), np.concatenate([faces[:, 1], faces[:, 2]])
    )
    chart = np.unique(chart, return_inverse=True)[1].reshape(-1)
    length = texel
    for _ in range(8):
        placed, side = packed(uvs, chart, MARGIN * length)
        size, actual = _sized(side, length, most)
        if actual <= length * 1.01:
            break
        length = actual
    made = dataclasses.replace(found, uvs=(placed / side).astype(np.float32))
    return Atlas(made, size, actual, True)


def _sized(side: float, texel: float, most: int) -> tuple[int, float]:
    """Texels along a side, a multiple of four, and how long they are."""
    size = min(max(4 * math.ceil(side / texel / 4), LEAST), most)
    return size, side / size


def is_atlas(geometry: Geometry) -> bool:
    """Whether a mesh has coordinates in the unit square by which no spot lies over another."""
    if geometry.uvs is None or not len(geometry.faces):
        return False
    used = geometry.uvs[np.unique(geometry.faces)]
    if used.min() < -1e-4 or used.max() > 1 + 1e-4:
        return False
    size, in_map = _face_areas(geometry)
    flat = (in_map < 1e-12) & (size > 1e-6 * size.sum())
    if flat.any():
        return False
    _, often = _covered(geometry, LOOKED_AT)
    return bool((often > 1).sum() <= TWICE * max((often > 0).sum(), 1))


def texels_of(atlas: Atlas) -> Texels:
    """Those whose middle a face has."""
    (face, second, third), _ = _covered(atlas.geometry, atlas.size)
    row, column = np.nonzero(face >= 0)
    b, c = second[row, column].astype(np.float64), third[row, column].astype(np.float64)
    return Texels(row, column, face[row, column].astype(np.int64), np.stack([1 - b - c, b, c], axis=1))


def filled(texels: Texels, size: int, values: npt.NDArray[np.generic]) -> F32:
    """(size, size, C) a picture, rows from the top, of values (N, C); other texels are as the nearest."""
    from scipy.ndimage import distance_transform_edt  # heavy: only exports come here

    which = np.full((size, size), -1, np.int64)
    which[size - 1 - texels.row, texels.column] = np.arange(len(texels.row))
    if not len(texels.row):
        return np.zeros((size, size, values.shape[1]), np.float32)
    nearest = distance_transform_edt(which < 0, return_distances=False, return_indices=True)
    return np.asarray(values[which[tuple(nearest)]], np.float32)


def packed(uvs: F64, chart: I64, margin: float) -> tuple[F64, float]:
    """(P, 2) coordinates with charts side by side in a square from 0 on, and its side.

    Shelves of charts as high as the highest of each, from high to low.
    """
    count = int(chart.max(initial=-1)) + 1
    low, high = np.full((count, 2), np.inf), np.full((count, 2), -np.inf)
    np.minimum.at(low, chart, uvs)
    np.maximum.at(high, chart, uvs)
    size = high - low + margin
    width = max(float(np.sqrt(size.prod(axis=1).sum()) * 1.05), float(size[:, 0].max(initial=0)))
    corner = np.zeros((count, 2))
    x = y = shelf = longest = 0.0
    for k in np.argsort(-size[:, 1], kind="stable").tolist():
        if x > 0 and x + size[k, 0] > width:
            x, y, shelf = 0.0, y + shelf, 0.0
        corner[k] = x, y
        x, shelf = x + size[k, 0], max(shelf, size[k, 1])
        longest = max(longest, x)
    side = max(longest, y + shelf, 1e-12)
    return uvs - low[chart] + corner[chart] + margin / 2, side


def _covered(geometry: Geometry, size: int) -> tuple[tuple[I32, F32, F32], I32]:
    assert geometry.uvs is not None
    face, often = np.full((size, size), -1, np.int32), np.zeros((size, size), np.int32)
    second, third = np.zeros((2, size, size), np.float32)
    cover(geometry.uvs[geometry.faces].astype(np.float64) * size, face, second, third, often)
    return (face, second, third), often


def _face_areas(geometry: Geometry) -> tuple[F64, F64]:
    """(F,) on the surface, and in the plane of coordinates."""
    assert geometry.uvs is not None
    place, uv = geometry.positions[geometry.faces].astype(np.float64), geometry.uvs[geometry.faces]
    normal = np.cross(place[:, 1] - place[:, 0], place[:, 2] - place[:, 0])
    (a, b), (c, d) = ((uv[:, k] - uv[:, 0]).astype(np.float64).T for k in (1, 2))
    return np.linalg.norm(normal, axis=1) / 2, np.abs(a * d - b * c) / 2


def _area(geometry: Geometry) -> float:
    return float(_face_areas(geometry)[0].sum())


def _area_in_map(geometry: Geometry) -> float:
    return max(float(_face_areas(geometry)[1].sum()), 1e-300)


__all__ = ["LEAST", "MOST", "Atlas", "Texels", "atlas_of", "filled", "is_atlas", "packed", "texels_of"]
