"""What colours vertices have for light that goes on: material coefficients, averaged over their surface.

A vertex stands for a third of each face around it. There a picture is read by its mip level: as large as the
third is, about its middle. So a pattern finer than the mesh counts with its mean, and nothing of the picture
that lies beside the mesh's own part of it comes in. Of pictures only levels up to FINEST texels are kept, and
coefficients that are no line in a picture's texels are those of such levels' texels.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from studio_core.arrays import frozen_map
from studio_core.contract import Services
from studio_core.jit import kernel
from studio_core.scene.geometry import Image
from studio_core.scene.nodes import Material, MaterialId, Scene
from studio_core.scene.shading_mesh import NO_BACK
from studio_core.scene.world_mesh import WorldMesh
from studio_core.shading.artifacts import Surfaces
from studio_core.shading.coefficients import (
    SAMPLED,
    affine_line,
    picture_key,
    picture_texels,
    uv_map_of,
)
from studio_core.shading.materials import Resolved, coefficients, linear_rgb, resolve
from studio_core.shading.painting import PaintTable
from studio_core.shading.pyramids import Pyramid

F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]
U16 = npt.NDArray[np.uint16]
I64 = npt.NDArray[np.int64]

FINEST = 512
MOST_ROW = 65535
_PictureKey = tuple[str, bool]


@dataclass(frozen=True, eq=False)
class _Picture:
    """Levels of at most FINEST texels, and of the whole picture SAMPLED texels and the range.

    A texel is low + step · row, so rows (R, C) take two bytes each and err by 1 / 131,070 of the range.
    """

    rows: U16
    low: F32
    step: F32
    first: I64
    size: I64
    probe: Pyramid

    @classmethod
    def of(cls, texels: F32) -> _Picture:
        """Of all texels (H, W, C)."""
        every = texels.reshape(-1, texels.shape[2])
        some = np.ascontiguousarray(every[:: max(len(every) // SAMPLED, 1)])
        levels = _levels(texels)
        size = np.array([level.shape[:2] for level in levels], np.int64)
        first = np.cumsum([0, *(height * width for height, width in size.tolist())])[:-1].astype(np.int64)
        rows = np.concatenate([level.reshape(-1, texels.shape[2]) for level in levels])
        low, high = every.min(axis=0), every.max(axis=0)
        step = np.maximum(high - low, np.float32(1e-30)) / np.float32(MOST_ROW)
        packed = np.clip(np.rint((rows - low) / step), 0, MOST_ROW).astype(np.uint16)
        return cls(packed, low, step, first, size, Pyramid((some[:, None],), low, high))

    def texels(self, rows: npt.NDArray[np.number]) -> F32:
        """What rows (…, C), or means of them, stand for."""
        return np.asarray(self.low + self.step * rows, np.float32)


def _levels(texels: F32) -> list[F32]:
    """From at most FINEST texels a side down to one, all but the first by powers of two; no row is lost."""
    height, width = (min(side, FINEST) for side in texels.shape[:2])
    levels = [_resized(texels, height, width)]
    while max(height, width) > 1:
        height, width = (1 << (side - 1).bit_length() - 1 if side > 1 else 1 for side in (height, width))
        levels.append(_resized(levels[-1], height, width))
    return levels


def _resized(texels: F32, height: int, width: int) -> F32:
    """Means over equal parts of a picture (H, W, C)."""
    return _fewer(_fewer(texels, height).swapaxes(0, 1), width).swapaxes(0, 1)


def _fewer(rows: F32, count: int) -> F32:
    """(count, …) means over equal parts of rows (N, …), which may end inside of one."""
    have = len(rows)
    if have == count:
        return rows
    if have % count == 0:
        parts = rows.reshape(count, have // count, *rows.shape[1:])
        return np.asarray(parts.mean(axis=1, dtype=np.float32))
    edges = np.linspace(0, have, count + 1)
    whole = np.minimum(edges.astype(np.int64), have - 1)
    sums = np.zeros((have + 1, *rows.shape[1:]))
    np.cumsum(rows, axis=0, out=sums[1:])
    part = (edges - whole).reshape(-1, *(1,) * (rows.ndim - 1))
    at = sums[whole] + part * rows[whole]
    return np.asarray(np.diff(at, axis=0) * (count / have), np.float32)


@dataclass(frozen=True, eq=False)
class _Look:
    """Coefficients (T·3,) plain + slope · texel of a picture (3,), or the texels (T·3,) themselves."""

    plain: F32
    slope: F32 | None
    picture: _Picture | None
    key: _PictureKey | None
    uv_map: F32


@dataclass(eq=False)
class _Own:
    """Of one material: its vertices, and the picture, how it lies, and what it comes to there (P, C)."""

    vertices: I64
    placed: tuple[_Picture, F32, F32] | None = None


class VertexCoefficients:
    """Makes (V, T, 3) of the unrefined meshes' vertices; what did not change is not made again."""

    def __init__(self, services: Services) -> None:
        self._registry = services.registry
        self._looks: dict[MaterialId, tuple[Material, _Look]] = {}
        self._pictures: dict[_PictureKey, _Picture] = {}
        self._small: dict[str, Image] = {}
        self._mesh: tuple[object, ...] = ()
        self._own: dict[int, _Own] = {}
        self._made: tuple[tuple[_Look, ...], F32] | None = None
        self._paint = PaintTable(services.registry)
        self._coated: tuple[F32, F32, F32] | None = None
        self.touched: npt.NDArray[np.bool_] = np.zeros(0, np.bool_)

    def __call__(self, scene: Scene, surfaces: Surfaces) -> F32:
        """Coefficients, 0 without a material; the same read-only array while nothing changes.

        `touched` (V,) tells which vertices may differ from the call before.
        """
        plain, before = self._plain(scene, surfaces), self._coated
        width = plain.shape[1]
        painted = self._paint(scene, surfaces.materials, surfaces.mesh, width)
        if before is not None and before[0] is plain and before[1] is painted:
            return before[2]
        if before is not None and before[1] is not painted:
            for coat in (before[1], painted):
                if len(coat) == len(plain):
                    self.touched = self.touched | coat.any(axis=1)
                elif len(coat):
                    self.touched = np.ones(len(plain), np.bool_)
        made = plain
        if len(painted):
            made = plain + painted.reshape(plain.shape)
            made.setflags(write=False)
        self._coated = plain, painted, made
        return made

    def _plain(self, scene: Scene, surfaces: Surfaces) -> F32:
        """Without what strokes changed."""
        mesh = surfaces.mesh
        looks = self._looked(scene, surfaces.materials)
        known = (mesh.uvs, mesh.material, mesh.faces, mesh.back_faces)
        same = len(known) == len(self._mesh) and all(a is b for a, b in zip(known, self._mesh, strict=True))
        if not same:
            self._mesh, self._own, self._made = known, {}, None
        width = max([len(look.plain) for look in looks], default=3)
        before = self._made
        if before is not None and before[0] == looks:
            self.touched = np.zeros(len(mesh), np.bool_)
            return before[1]
        self.touched = np.ones(len(mesh), np.bool_)
        made = np.zeros((len(mesh), width), np.float32)
        old: tuple[_Look, ...] = ()
        if before is not None and len(before[0]) == len(looks) and 3 * before[1].shape[1] == width:
            made[:] = before[1].reshape(made.shape)
            old = before[0]
            self.touched[:] = False
        for number, look in enumerate(looks):
            if old and old[number] is look:
                continue
            own = self._own.get(number)
            if own is None:
                own = self._own[number] = _Own(np.flatnonzero(mesh.material == number))
            made[own.vertices] = 0.0
            made[own.vertices, : len(look.plain)] = self._at(mesh, look, own)
            self.touched[own.vertices] = True
        shaped = made.reshape(len(mesh), width // 3, 3)
        shaped.setflags(write=False)
        self._made = looks, shaped
        return shaped

    def _looked(self, scene: Scene, materials: tuple[MaterialId, ...]) -> tuple[_Look, ...]:
        found: dict[MaterialId, tuple[Material, _Look]] = {}
        for name in materials:
            material, known = scene.material(name), self._looks.get(name)
            if known is None or known[0] is not material:
                made = self._look(material)
                known = material, known[1] if known is not None and _alike(known[1], made) else made
            found[name] = known
        self._looks = found
        looks = tuple(look for _, look in found.values())
        kept = {look.key for look in looks}
        self._pictures = {key: picture for key, picture in self._pictures.items() if key in kept}
        if self._small:
            every = (scene.material(name).textures.values() for name in materials)
            used = {texture.image.key for textures in every for texture in textures}
            self._small = {key: image for key, image in self._small.items() if key in used}
        return looks

    def _look(self, material: Material) -> _Look:
        bare = dataclasses.replace(material, textures=frozen_map()) if material.catches else material
        resolved = resolve(bare, self._registry)
        where = uv_map_of(resolved)
        if not resolved.textures:
            return _Look(coefficients(resolved).ravel(), None, None, None, where)
        key = None
        if len(resolved.textures) == 1:
            key = picture_key(resolved)
            if key not in self._pictures:
                texture = next(iter(resolved.textures.values()))
                self._pictures[key] = _Picture.of(picture_texels(texture.image, key[1]))
            picture = self._pictures[key]
            line = affine_line(resolved, picture.probe)
            if line is not None:
                return _Look(line[0], line[1], picture, key, where)
        own = _Picture.of(_flat(self._coarse(resolved)))
        return _Look(np.zeros(own.rows.shape[1], np.float32), None, own, key, where)

    def _coarse(self, resolved: Resolved) -> Resolved:
        """With pictures of at most FINEST texels a side: a slider asks the model for no more."""
        textures = {}
        for name, texture in resolved.textures.items():
            image = texture.image
            if max(image.pixels.shape[:2]) > FINEST:
                if image.key not in self._small:
                    height, width = (min(side, FINEST) for side in image.pixels.shape[:2])
                    self._small[image.key] = Image(_resized(linear_rgb(image), height, width))
                image = self._small[image.key]
            textures[name] = dataclasses.replace(texture, image=image)
        return dataclasses.replace(resolved, textures=textures)

    def _at(self, mesh: WorldMesh, look: _Look, own: _Own) -> F32:
        """Coefficients (P, T·3) at a material's vertices, or (T·3,) of all of them."""
        if look.picture is None:
            return look.plain
        placed = own.placed
        if placed is None or placed[0] is not look.picture or not np.array_equal(placed[1], look.uv_map):
            made = _averaged(mesh, own.vertices, look.picture, look.uv_map)
            placed = own.placed = look.picture, look.uv_map, made
        texels = placed[2]
        if look.slope is None:
            return texels
        return look.plain + look.slope * np.tile(texels, (1, len(look.plain) // 3))


def _alike(a: _Look, b: _Look) -> bool:
    """Whether both look the same, whatever their materials are beside."""
    if (a.slope is None) != (b.slope is None) or a.picture is not b.picture:
        return False
    pairs = [(a.plain, b.plain), (a.uv_map, b.uv_map)]
    if a.slope is not None and b.slope is not None:
        pairs.append((a.slope, b.slope))
    return all(np.array_equal(x, y) for x, y in pairs)


def _flat(resolved: Resolved) -> F32:
    """(H, W, T·3) coefficients at every texel."""
    made = coefficients(resolved)
    return made.reshape(*made.shape[:2], -1)


def _averaged(mesh: WorldMesh, vertices: I64, picture: _Picture, uv_map: F32) -> F32:
    """(P, C) means of a picture over the parts of faces that belong to vertices (P,)."""
    local = np.full(len(mesh), -1, np.int32)
    local[vertices] = np.arange(len(vertices), dtype=np.int32)
    back = mesh.back_faces[mesh.back_faces[:, 0] != NO_BACK]
    sums = np.zeros((len(vertices), picture.rows.shape[1]), np.float32)
    total = np.zeros(len(vertices), np.float64)
    for faces in (mesh.faces, back):
        add_shares(
            0, len(faces), faces, mesh.positions, mesh.uvs, local, uv_map.astype(np.float64),
            picture.rows, picture.first, picture.size, sums, total,
        )  # fmt: skip
    mean = sums / np.maximum(total, 1e-30)[:, None].astype(np.float32)
    return picture.texels(np.where(total[:, None] > 0, mean, picture.rows[-1]))


@kernel
def add_shares(
    start: int,
    stop: int,
    faces: npt.NDArray[np.uint32],
    positions: F32,
    uvs: F32,
    local: npt.NDArray[np.int32],
    uv_map: F64,
    texels: U16,
    first: I64,
    size: I64,
    sums: F32,
    total: F64,
) -> None:
    """Adds area times texel, and area, of each corner's third of faces to its vertex' row of `local` (V,).

    Level l of the picture starts at row first[l] of texels (R, C) and has size[l] = (height, width); it
    repeats. uv_map (6,) is `Texture.affine`.
    """
    channels = texels.shape[1]
    most = len(first) - 1
    for f in range(start, stop):
        a, b, c = faces[f, 0], faces[f, 1], faces[f, 2]
        if local[a] < 0 and local[b] < 0 and local[c] < 0:
            continue
        bx = np.float64(positions[b, 0]) - positions[a, 0]
        by = np.float64(positions[b, 1]) - positions[a, 1]
        bz = np.float64(positions[b, 2]) - positions[a, 2]
        cx = np.float64(positions[c, 0]) - positions[a, 0]
        cy = np.float64(positions[c, 1]) - positions[a, 1]
        cz = np.float64(positions[c, 2]) - positions[a, 2]
        nx, ny, nz = by * cz - bz * cy, bz * cx - bx * cz, bx * cy - by * cx
        weight = max(np.sqrt(nx * nx + ny * ny + nz * nz), 1e-30)
        au, av = np.float64(uvs[a, 0]), np.float64(uvs[a, 1])
        bu, bv = uvs[b, 0] - au, uvs[b, 1] - av
        cu, cv = uvs[c, 0] - au, uvs[c, 1] - av
        covered = abs((bu * cv - bv * cu) * (uv_map[0] * uv_map[4] - uv_map[1] * uv_map[3])) / 6
        level = 0
        while level < most and covered * size[level, 0] * size[level, 1] > 2.0:
            level += 1
        height, width, begin = size[level, 0], size[level, 1], first[level]
        for corner in range(3):
            v = local[faces[f, corner]]
            if v < 0:
                continue
            wb, wc = 7.0 / 36.0, 7.0 / 36.0  # the middle of the corner's third
            if corner == 1:
                wb = 22.0 / 36.0
            elif corner == 2:
                wc = 22.0 / 36.0
            u, w = au + wb * bu + wc * cu, av + wb * bv + wc * cv
            x = uv_map[0] * u + uv_map[1] * w + uv_map[2]
            y = uv_map[3] * u + uv_map[4] * w + uv_map[5]
            x -= np.floor(x)
            y -= np.floor(y)
            total[v] += weight
            px, py = x * width - 0.5, y * height - 0.5
            left, bottom = int(np.floor(px)), int(np.floor(py))
            fx, fy = px - left, py - bottom
            right, top = (left + 1) % width, (bottom + 1) % height
            left, bottom = left % width, bottom % height
            p, q = begin + bottom * width + left, begin + bottom * width + right
            r, s = begin + top * width + left, begin + top * width + right
            wp, wq = np.float32(weight * (1 - fx) * (1 - fy)), np.float32(weight * fx * (1 - fy))
            wr, ws = np.float32(weight * (1 - fx) * fy), np.float32(weight * fx * fy)
            for k in range(channels):
                sums[v, k] += wp * texels[p, k] + wq * texels[q, k] + wr * texels[r, k] + ws * texels[s, k]


__all__ = ["FINEST", "VertexCoefficients", "add_shares"]
