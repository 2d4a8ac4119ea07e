"""What a painted material is at each texel of an atlas: its parameters, pictures and paint together."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from studio_core.params import ParamInfo, param_infos
from studio_core.scene.geometry import Image, Texture
from studio_core.scene.paint import Paint
from studio_core.shading.materials import Resolved
from studio_core.shading.painting import painted
from studio_core.shading.varying import Grey

F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]
BLOCK = 1 << 16


@dataclass(frozen=True, eq=False)
class Spots:
    """N spots of an object, in its own frame: places, normals (N, 3), and coordinates (N, 2) of pictures.

    `slot` of its materials; `area` (N,) is how much of the coordinates' plane each has. `looks` (N, 3), where
    paint follows the picture below it (`shading.looks`).
    """

    places: F64
    normals: F64
    slot: int
    uvs: F32
    area: F32
    looks: F32 | None = None


def values_at(resolved: Resolved, paint: Paint, spots: Spots) -> dict[str, F32]:
    """(N,) numbers and (N, 3) colours: parameters that are painted or have a picture, in their ranges."""
    infos = param_infos(resolved.brdf.Params)
    pictures = {**resolved.textures, **resolved.shaping}
    changes = _changes(paint, spots, [name for name in paint.changes if name in infos])
    made: dict[str, F32] = {}
    for name in dict.fromkeys((*pictures, *changes)):
        info = infos.get(name)
        if info is None or info.kind not in ("number", "colour"):
            continue
        value = np.asarray(resolved.values[name], np.float64)
        if name in pictures:
            value = value * sampled(pictures[name], spots.uvs, spots.area, value.ndim == 1)
        shape = (len(spots.uvs), *((3,) if info.kind == "colour" else ()))
        made[name] = _painted(np.broadcast_to(value, shape), changes.get(name), info)
    return made


def sampled(texture: Texture, uvs: F32, area: F32, colour: bool) -> F32:
    """(N,) or, of a colour, (N, 3) linear texels, averaged over areas (N,) of the coordinates' plane."""
    pixels, places = texture.image.pixels, texture.placed(uvs)
    around = area * np.float32(texture.area)
    channels = range(3) if colour and pixels.shape[2] >= 3 else range(1)
    found = [
        Grey.of(Image(pixels[..., c : c + 1], texture.image.encoding)).at(places, around) for c in channels
    ]
    if not colour:
        return found[0]
    return np.stack(found if len(found) == 3 else found * 3, axis=1)


def _painted(value: npt.NDArray[np.float64], change: F32 | None, info: ParamInfo) -> F32:
    if change is None:
        return np.clip(value, info.low, info.high).astype(np.float32)
    added = change if value.ndim == 2 else change[:, 0]  # one number changes all channels alike
    return painted(value, added, info).astype(np.float32)


def _changes(paint: Paint, spots: Spots, names: list[str]) -> Mapping[str, F32]:
    """(N, C) by parameter, as the paint has them at the spots themselves."""
    count = len(spots.places)
    made = {name: np.zeros((count, paint.change(name).shape[1]), np.float32) for name in names}
    for start in range(0, count, BLOCK):
        some = slice(start, start + BLOCK)
        places = spots.places[some]
        looks = None if spots.looks is None else spots.looks[some]
        weights = paint.weights(places, spots.normals[some], np.full(len(places), spots.slot), looks)
        for name in names:
            made[name][some] = weights(paint.change(name))
    return made


__all__ = ["Spots", "sampled", "values_at"]
