"""Pictures of a material grown into larger ones without a seam or repetition, all by the same patches."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from studio_core.errors import InputError
from studio_core.imaging.resample import resize_area
from studio_core.imaging.synthesis import Grown, fitting_size, grow
from studio_core.scene.geometry import Image, Texture
from studio_core.shading.job import Job
from studio_core.shading.materials import linear

F32 = npt.NDArray[np.float32]

LARGEST_SIDE = 4096


def lying_alike(textures: Mapping[str, Texture], name: str) -> dict[str, Texture]:
    """Those that lie as the one of that name does."""
    return {key: one for key, one in textures.items() if one.affine == textures[name].affine}


def grown(
    textures: Mapping[str, Texture], times: float, *, seed: int = 0, job: Job | None = None
) -> dict[str, Texture]:
    """Textures that lie alike, `times` as wide and high; a texel is as large on the surface as before.

    Pictures of fewer texels are enlarged to those of the largest first; where a sample repeats itself the
    size is rounded to its periods. Raises InputError, Cancelled.
    """
    if not textures:
        raise InputError("there is no picture to grow")
    first = next(iter(textures.values()))
    if any(one.affine != first.affine for one in textures.values()):
        raise InputError("pictures that are grown together must lie alike")
    sides = [one.image.pixels.shape[:2] for one in textures.values()]
    height, width = max(h for h, _ in sides), max(w for _, w in sides)
    if not 1 < times <= LARGEST_SIDE / max(height, width):
        most = LARGEST_SIDE / max(height, width)
        raise InputError(f"a picture of {width} × {height} texels can be grown up to {most:.1f} times")
    pixels = {name: _sized(one.image.pixels, height, width) for name, one in textures.items()}
    signal = np.concatenate([_seen(Image(pixels[n], t.image.encoding)) for n, t in textures.items()], axis=2)
    size = fitting_size(signal, (round(height * times), round(width * times)))
    made = grow(signal, (min(size[0], LARGEST_SIDE), min(size[1], LARGEST_SIDE)), seed=seed, job=job)
    return {name: _relaid(one, made, pixels[name]) for name, one in textures.items()}


def _sized(pixels: npt.NDArray[Any], height: int, width: int) -> npt.NDArray[Any]:
    return pixels if pixels.shape[:2] == (height, width) else resize_area(pixels, height, width)


def _seen(image: Image) -> F32:
    """(h, w, C) what patches are compared by: about as bright as one sees it, each picture counting alike.

    What may be negative is no light and is taken as it is.
    """
    values = linear(image)
    if image.encoding != "data" and image.pixels.shape[2] == 4:
        values = values[..., :3]
    if values.min() >= 0:
        values = np.sqrt(values)
    spread = float(np.sqrt(values.reshape(-1, values.shape[2]).var(axis=0, dtype=np.float64).sum()))
    return np.asarray(values / spread, np.float32) if spread > 1e-4 else np.zeros_like(values)


def _relaid(texture: Texture, made: Grown, pixels: npt.NDArray[Any]) -> Texture:
    """The grown picture, its texels as large as those of the sample."""
    image = Image(made.of(pixels), texture.image.encoding)
    (height, width), (tall, wide) = pixels.shape[:2], image.pixels.shape[:2]
    ratio = (width / wide, height / tall)
    scale = (texture.scale[0] * ratio[0], texture.scale[1] * ratio[1])
    offset = (texture.offset[0] * ratio[0], texture.offset[1] * ratio[1])
    return dataclasses.replace(texture, image=image, scale=scale, offset=offset)


__all__ = ["LARGEST_SIDE", "grown", "lying_alike"]
