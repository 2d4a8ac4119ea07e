"""BRDF coefficients of a scene's materials as pixels want them, maps kept while their pictures stay.

Where one texture acts, the coefficients of most models are affine in its texel: then only the picture is
kept as a map, and another colour, roughness or metalness costs two rows of numbers. Whether they are is
found out by asking the model along the range of the picture's values. A term that a model lets be
`straightened` is the line nearest to it over the picture's texels.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from studio_core.arrays import frozen_map
from studio_core.contract import Registry
from studio_core.kernels.compose import AFFINE, CONSTANT, GENERAL
from studio_core.params import Value
from studio_core.scene.geometry import Image
from studio_core.scene.nodes import Material, Scene
from studio_core.shading.artifacts import Surfaces
from studio_core.shading.materials import Resolved, coefficients, linear_rgb, resolve
from studio_core.shading.painting import PaintTable
from studio_core.shading.pyramids import LEVELS, Pyramid, joined, lay_out, pyramid
from studio_core.shading.reliefs import Reliefs, ReliefTable

F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]
I64 = npt.NDArray[np.int64]

PROBES = 33
SAMPLED = 4096
AFFINE_WITHIN = 1e-5  # of the largest coefficient


@dataclass(frozen=True, eq=False)
class Maps:
    """Mip levels of all textured materials (M); the same object while no map changes.

    Level l < levels[m] of material m starts at row first[m, l] of texels (R, 3) or, where its coefficients
    are not affine, of tables (R, T·3), and has size[m, l] = (height, width). uv_map (M, 6) is
    `Texture.affine`, kind (M,) says which, as in `kernels.compose`.
    """

    kind: I64
    texels: F32
    tables: F32
    first: I64
    size: I64
    levels: I64
    uv_map: F32


@dataclass(frozen=True, eq=False)
class Coefficients:
    """Coefficients (M, T·3) are plain + slope · texel, or rows of a map; `typical` are their means.

    T is the most terms that one of the materials has. painted (V, T·3) is what strokes add at the vertices of
    the meshes, (0, 0) without any. `reliefs` are their normal maps, None without any.
    """

    plain: F32
    slope: F32
    typical: F32
    maps: Maps
    reliefs: Reliefs | None = None
    painted: F32 = field(default_factory=lambda: np.zeros((0, 0), np.float32))

    @property
    def width(self) -> int:
        """T."""
        return int(self.plain.shape[1] // 3)


@dataclass(frozen=True, eq=False)
class _Look:
    """What is known of one material; its coefficients are as many as its model has terms, times 3."""

    material: Material
    kind: int
    plain: F32
    slope: F32
    typical: F32
    pyramid: Pyramid | None
    picture: tuple[str, bool] | None
    uv_map: F32


class CoefficientTable:
    """Makes `Coefficients`, keeping what belongs to materials and pictures that did not change."""

    def __init__(self, registry: Registry) -> None:
        self._registry = registry
        self._looks: dict[str, _Look] = {}
        self._pictures: dict[tuple[str, bool], Pyramid] = {}
        self._made: tuple[tuple[_Look, ...], Coefficients] | None = None
        self._reliefs = ReliefTable()
        self._paint = PaintTable(registry)
        self._stored: dict[int, tuple[tuple[Pyramid, ...], F32, list[int]]] = {}

    def __call__(self, scene: Scene, surfaces: Surfaces) -> Coefficients:
        """The table for `surfaces.materials`; the same object while neither they nor paint changes."""
        looks: dict[str, _Look] = {}
        pictures: dict[tuple[str, bool], Pyramid] = {}
        for name in surfaces.materials:
            material, look = scene.material(name), self._looks.get(name)
            if look is None or look.material is not material:
                look = self._look(material, pictures)
            elif look.picture is not None:
                pictures[look.picture] = self._pictures[look.picture]
            looks[name] = look
        self._looks, self._pictures = looks, pictures
        made = tuple(looks.values())
        if self._made is None or self._made[0] != made:
            self._made = made, self._assemble(made)
        table = self._made[1]
        painted = self._paint(scene, surfaces.materials, surfaces.mesh, table.width)
        if painted is not table.painted:
            self._made = made, dataclasses.replace(table, painted=painted)
        return self._made[1]

    def _look(self, material: Material, pictures: dict[tuple[str, bool], Pyramid]) -> _Look:
        bare = dataclasses.replace(material, textures=frozen_map()) if material.catches else material
        resolved = resolve(bare, self._registry)  # what catches shadows shows no picture of its own
        if not resolved.textures:
            plain = coefficients(resolved).ravel()
            none, where = np.zeros_like(plain), uv_map_of(resolved)
            return _Look(material, CONSTANT, plain, none, plain, None, None, where)
        if len(resolved.textures) == 1:
            key = picture_key(resolved)
            found = pictures.get(key) or self._pictures.get(key)
            if found is None:
                found = pyramid(picture_texels(next(iter(resolved.textures.values())).image, key[1]))
            line = affine_line(resolved, found)
            if line is not None:
                pictures[key] = found
                plain, slope = line
                mean = np.tile(found.levels[-1].mean(axis=(0, 1), dtype=np.float32), len(plain) // 3)
                typical = plain + slope * mean
                return _Look(material, AFFINE, plain, slope, typical, found, key, uv_map_of(resolved))
        own = pyramid(coefficients(resolved).reshape(*_map_size(resolved), -1))
        typical = own.levels[-1].mean(axis=(0, 1), dtype=np.float32)
        none = np.zeros_like(typical)
        return _Look(material, GENERAL, none, none, typical, own, None, uv_map_of(resolved))

    def _assemble(self, looks: tuple[_Look, ...]) -> Coefficients:
        count = max(len(looks), 1)
        kind, first = np.zeros(count, np.int64), np.zeros((count, LEVELS), np.int64)
        size, uv_map = np.zeros((count, LEVELS, 2), np.int64), np.zeros((count, 6), np.float32)
        most = max((len(look.plain) for look in looks), default=3)
        plain, slope, typical = np.zeros((3, count, most), np.float32)
        arrays = {}
        for which, channels in ((AFFINE, 3), (GENERAL, most)):
            used = dict.fromkeys(look.pyramid for look in looks if look.kind == which and look.pyramid)
            arrays[which], starts = self._store(which, tuple(used), channels)
            begin = dict(zip(used, starts, strict=True))
            for m, look in enumerate(looks):
                if look.kind != which or look.pyramid is None:
                    continue
                lay_out(look.pyramid, begin[look.pyramid], first[m], size[m])
        for m, look in enumerate(looks):
            kind[m], uv_map[m] = look.kind, look.uv_map
            own = len(look.plain)
            plain[m, :own], slope[m, :own], typical[m, :own] = look.plain, look.slope, look.typical
        levels = (size[:, :, 0] > 0).sum(axis=1)
        maps = Maps(kind, arrays[AFFINE], arrays[GENERAL], first, size, levels, uv_map)
        if self._made is not None and _same(maps, self._made[1].maps):
            maps = self._made[1].maps
        reliefs = self._reliefs([look.material for look in looks])
        return Coefficients(plain, slope, typical, maps, reliefs)

    def _store(self, which: int, pyramids: tuple[Pyramid, ...], channels: int) -> tuple[F32, list[int]]:
        """All levels of some pyramids as rows, and where each pyramid starts; kept while they stay."""
        kept = self._stored.get(which)
        if kept is not None and kept[0] == pyramids and kept[1].shape[1] == channels:
            return kept[1], kept[2]
        made, starts = joined(pyramids, channels)
        self._stored[which] = pyramids, made, starts
        return made, starts


def _same(a: Maps, b: Maps) -> bool:
    if a.texels is not b.texels or a.tables is not b.tables:
        return False
    pairs = ((a.kind, b.kind), (a.first, b.first), (a.size, b.size), (a.uv_map, b.uv_map))
    return all(np.array_equal(x, y) for x, y in pairs)


def picture_key(resolved: Resolved) -> tuple[str, bool]:
    """What picture a material with one texture shows: its content, and whether one channel stands for all."""
    ((name, texture),) = resolved.textures.items()
    return texture.image.key, np.ndim(np.asarray(resolved.values[name])) == 0


def picture_texels(image: Image, grey: bool) -> F32:
    """(H, W, 3) what a material with one texture multiplies, rows from v = 0 up."""
    texels = linear_rgb(image)[::-1]
    return np.repeat(texels[..., :1], 3, axis=2) if grey else texels


def _map_size(resolved: Resolved) -> tuple[int, int]:
    sizes = [texture.image.pixels.shape[:2] for texture in resolved.textures.values()]
    return max(h for h, _ in sizes), max(w for _, w in sizes)


def uv_map_of(resolved: Resolved) -> F32:
    """(6,) `Texture.affine` of the pictures, which all lie alike."""
    for texture in resolved.textures.values():
        return np.array(texture.affine, np.float32)
    return np.array([1, 0, 0, 0, 1, 0], np.float32)


def affine_line(resolved: Resolved, picture: Pyramid) -> tuple[F32, F32] | None:
    """Coefficients (T·3,) at texel 0 and their slopes, channel by channel; None where they bend."""
    low, high = picture.low.astype(np.float64), picture.high.astype(np.float64)
    ramp = np.linspace(0, 1, PROBES)[:, None]
    mixed = np.random.default_rng(0).random((PROBES, 3))
    at = (low + np.concatenate([ramp * np.ones(3), mixed]) * (high - low)).astype(np.float32)
    made = _at_texels(resolved, at).astype(np.float64)
    ((name, _),) = resolved.textures.items()
    if np.ndim(np.asarray(resolved.values[name])) == 0:
        made, at = made[:PROBES], at[:PROBES]  # one channel stands for all
    rise = np.where(high > low, high - low, 1)
    slope = np.where(high > low, (made[PROBES - 1] - made[0]) / rise, 0)  # (T, 3)
    plain = made[0] - slope * low
    for term in getattr(resolved.brdf, "straightened", ()):
        texels, values = _sampled(resolved, picture, term)
        plain[term], slope[term] = _nearest(texels, values, low)
        made[:, term] = plain[term] + slope[term] * at
    error = np.abs(plain + slope * at[:, None, :] - made).max(initial=0)
    if not error <= AFFINE_WITHIN * np.abs(made).max(initial=0):
        return None
    return plain.ravel().astype(np.float32), slope.ravel().astype(np.float32)


def _sampled(resolved: Resolved, picture: Pyramid, term: int) -> tuple[F64, F64]:
    """Texels (K, 3) from all over the picture, and the coefficient (K, 3) of a term there."""
    rows = picture.levels[0].reshape(-1, picture.levels[0].shape[-1])[:, :3]
    texels = np.ascontiguousarray(rows[:: max(len(rows) // SAMPLED, 1)])
    return texels.astype(np.float64), _at_texels(resolved, texels)[:, term].astype(np.float64)


def _nearest(texels: F64, values: F64, low: F64) -> tuple[F64, F64]:
    """Lines (3,) at 0 and their slopes (3,) by least squares, each channel's not below 0 from `low` on."""
    mean, height = texels.mean(axis=0), values.mean(axis=0)
    away = texels - mean
    spread = (away * away).sum(axis=0)
    slope = (away * (values - height)).sum(axis=0) / np.maximum(spread, 1e-12)
    plain = height - slope * mean
    above = texels - low
    lifted = (above * values).sum(axis=0) / np.maximum((above * above).sum(axis=0), 1e-12)
    under = plain + slope * low < 0
    return np.where(under, -lifted * low, plain), np.where(under, lifted, slope)


def _at_texels(resolved: Resolved, texels: F32) -> F32:
    """(K, T, 3) coefficients where the one texture has texels (K, 3)."""
    values: dict[str, Any] = {}
    for name, value in resolved.values.items():
        if _numeric(value):
            number = np.asarray(value, np.float32)
            if name in resolved.textures:
                number = number * (texels[:, 0] if number.ndim == 0 else texels)
            values[name] = np.broadcast_to(number, (len(texels), *np.shape(value)))
    made = np.asarray(resolved.brdf.coefficients(values), np.float32)
    return np.broadcast_to(made, (len(texels), *made.shape[-2:]))


def _numeric(value: Value) -> bool:
    return not isinstance(value, str | bool)
