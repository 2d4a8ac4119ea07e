"""Pictures on the GPU: texture pyramids as atlases, and the sky.

A pyramid lies in one texture, the finest level at the left and the others in a column at its right, and is
read texel by texel: the levels are those of the raster canvas, sizes that are no power of two included.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from vispy import gloo

from studio_core.kernels.compose import AFFINE
from studio_core.shading.coefficients import Maps
from studio_core.shading.reliefs import Reliefs
from studio_ui.canvas.gl_buffers import Tally

F32 = npt.NDArray[np.float32]


@dataclass(eq=False)
class Atlas:
    """Textures (one for AFFINE, one a term for GENERAL), the finest level's size and the atlas' own."""

    base: F32
    textures: list[Any]
    finest: tuple[int, int]
    levels: int
    size: tuple[int, int]

    def delete(self) -> None:
        """Give the textures back."""
        for texture in self.textures:
            texture.delete()


class Atlases:
    """One for each pyramid that some material of the picture shows, normal maps among them."""

    def __init__(self, tally: Tally, largest: int) -> None:
        self._tally, self._largest = tally, largest
        self._maps: Maps | None = None
        self._reliefs: Reliefs | None = None
        self._of: dict[int, Atlas] = {}
        self._relief_of: dict[int, Atlas] = {}

    def update(self, maps: Maps, reliefs: Reliefs | None = None) -> bool:
        """Make what these maps need and give back what they do not; whether anything changed."""
        changed = maps is not self._maps or reliefs is not self._reliefs
        if maps is not self._maps:
            wanted = np.flatnonzero(maps.kind).tolist()
            starts = {m: (int(maps.kind[m]), int(maps.first[m, 0])) for m in wanted}
            self._of = self._followed(self._of, starts, lambda m: _levels(maps, m))
        if not _same_texels(reliefs, self._reliefs):
            starts = {}
            if reliefs is not None:
                starts = {m: (0, int(reliefs.first[m, 0])) for m in np.flatnonzero(reliefs.levels).tolist()}
            self._relief_of = self._followed(self._relief_of, starts, lambda m: _relief_levels(reliefs, m))
        self._maps, self._reliefs = maps, reliefs
        return changed

    def _followed(
        self,
        had: dict[int, Atlas],
        starts: dict[int, tuple[int, int]],
        levels_of: Callable[[int], list[F32]],
    ) -> dict[int, Atlas]:
        """Atlases by material, one for each start; those of `had` that show the same are taken."""
        old = list(dict.fromkeys(had.values()))
        made: dict[int, Atlas] = {}
        by_start: dict[tuple[int, int], Atlas] = {}
        for material, place in starts.items():
            if place not in by_start:
                levels = levels_of(material)
                kept = next((a for a in old if _same(a.base, levels[0])), None)
                by_start[place] = kept or self._atlas(levels)
            made[material] = by_start[place]
        for atlas in old:
            if all(atlas is not other for other in made.values()):
                atlas.delete()
        return made

    def relief(self, material: int) -> Atlas | None:
        """Of its normal map."""
        return self._relief_of.get(material)

    def __getitem__(self, material: int) -> Atlas:
        return self._of[material]

    def clear(self) -> None:
        """Give everything back."""
        for atlas in dict.fromkeys((*self._of.values(), *self._relief_of.values())):
            atlas.delete()
        self._of, self._relief_of, self._maps, self._reliefs = {}, {}, None, None

    def _atlas(self, levels: list[F32]) -> Atlas:
        base = levels[0]
        while len(levels) > 1 and max(3 * levels[0].shape[1] // 2 + 1, levels[0].shape[0]) > self._largest:
            levels = levels[1:]  # the driver has no larger textures
        high, wide = levels[0].shape[:2]
        places, top = [(0, 0, wide, high)], 0
        for level in levels[1:]:
            places.append((wide, top, level.shape[1], level.shape[0]))
            top += level.shape[0]
        across = max(left + width for left, _, width, _ in places)
        down = max(high, top)
        channels = base.shape[2]
        textures = []
        for first in range(0, channels, 3):
            whole = np.zeros((down, across, 3), np.float32)
            for (left, up, width, height), level in zip(places, levels, strict=True):
                whole[up : up + height, left : left + width] = level[:, :, first : first + 3]
            textures.append(picture(whole, "rgb16f"))
            self._tally.maps += whole.nbytes
            self._tally.uploads += 1
        return Atlas(base, textures, (wide, high), len(places), (across, down))


def picture(pixels: F32, internalformat: str) -> Any:
    """A texture (H, W, 3) that is read texel by texel."""
    return gloo.Texture2D(
        np.ascontiguousarray(pixels),
        format="rgb",
        internalformat=internalformat,
        interpolation="nearest",
        wrapping="clamp_to_edge",
    )


def _same_texels(a: Reliefs | None, b: Reliefs | None) -> bool:
    """Whether nothing but how normal maps lie and their strength differs."""
    return a is b or (a is not None and b is not None and a.texels is b.texels and a.first is b.first)


def _levels(maps: Maps, material: int) -> list[F32]:
    return _cut(maps.texels if maps.kind[material] == AFFINE else maps.tables, maps, material)


def _relief_levels(reliefs: Reliefs | None, material: int) -> list[F32]:
    return [] if reliefs is None else _cut(reliefs.texels, reliefs, material)


def _cut(rows: F32, maps: Maps | Reliefs, material: int) -> list[F32]:
    made = []
    for level in range(int(maps.levels[material])):
        first, (high, wide) = int(maps.first[material, level]), maps.size[material, level].tolist()
        made.append(rows[first : first + high * wide].reshape(high, wide, rows.shape[1]))
    return made


def _same(a: F32, b: F32) -> bool:
    return a.shape == b.shape and (a is b or np.array_equal(a, b))
