"""Normal maps as pixels read them: mip levels of x, y and 1 − z, kept while their pictures stay."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from studio_core.scene.geometry import Image
from studio_core.scene.nodes import Material
from studio_core.shading.normal_maps import FLAT, components, mean_slope, normal_texture, strength, turn
from studio_core.shading.pyramids import LEVELS, Pyramid, joined, lay_out, pyramid

F32 = npt.NDArray[np.float32]
I64 = npt.NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Reliefs:
    """Normal maps of M materials; the same object while none changes.

    Where levels (M,) is not 0, level l of material m starts at row first[m, l] of texels (R, 3), components
    x, y, 1 − z of `shading.normal_maps` in the picture's frame, and has size[m, l] = (height, width). laid
    (M, 11) is `Texture.affine`, the four numbers of `normal_maps.turn`, and the strength.
    """

    texels: F32
    first: I64
    size: I64
    levels: I64
    laid: F32


class ReliefTable:
    """Makes `Reliefs`, or None where no material has a normal map."""

    def __init__(self) -> None:
        self._kept: dict[str, Pyramid | None] = {}
        self._made: tuple[tuple[Pyramid | None, ...], Reliefs] | None = None

    def __call__(self, materials: Sequence[Material]) -> Reliefs | None:
        """For materials in their order."""
        kept: dict[str, Pyramid | None] = {}
        found: list[Pyramid | None] = []
        laid = np.zeros((max(len(materials), 1), 11), np.float32)
        for number, material in enumerate(materials):
            texture = normal_texture(material)
            if texture is None:
                found.append(None)
                continue
            key = texture.image.key
            if key not in kept:
                kept[key] = self._kept[key] if key in self._kept else _pyramid(texture.image)
            found.append(kept[key])
            laid[number] = *texture.affine, *turn(texture), strength(material)
        self._kept = kept
        pyramids = tuple(found)
        if not any(pyramids):
            self._made = None
            return None
        old = self._made
        if old is None or old[0] != pyramids:
            self._made = pyramids, _assembled(pyramids, laid)
        elif not np.array_equal(old[1].laid, laid):
            self._made = pyramids, replace(old[1], laid=laid)
        assert self._made is not None
        return self._made[1]


def _pyramid(image: Image) -> Pyramid | None:
    """Of a picture as it is; how strong it acts is for pixels to say. None where it is flat."""
    return pyramid(components(image)) if mean_slope(image) >= FLAT else None


def _assembled(pyramids: tuple[Pyramid | None, ...], laid: F32) -> Reliefs:
    used = list(dict.fromkeys(one for one in pyramids if one is not None))
    texels, starts = joined(used, 3)
    begin = dict(zip(used, starts, strict=True))
    first = np.zeros((len(laid), LEVELS), np.int64)
    size = np.zeros((len(laid), LEVELS, 2), np.int64)
    for m, one in enumerate(pyramids):
        if one is not None:
            lay_out(one, begin[one], first[m], size[m])
    return Reliefs(texels, first, size, (size[:, :, 0] > 0).sum(axis=1), laid)


__all__ = ["ReliefTable", "Reliefs"]
