"""Pictures of light from all around: OpenEXR's lat-long layout, colour balance, storage precision."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from studio_core.colour import LUMINANCE
from studio_core.scene.geometry import Image

from .mesh import Array

Radiance = Callable[[Array], Array]


def directions(height: int, rows: Array, columns: Array) -> Array:
    """Unit vectors (N, 3) at pixel coordinates (edges are whole numbers) of a picture 2·height wide."""
    theta = math.pi * rows / height
    phi = 2 * math.pi * (0.5 - columns / (2 * height))
    return np.stack([np.sin(theta) * np.sin(phi), np.cos(theta), np.sin(theta) * np.cos(phi)], -1)


def solid_angles(height: int) -> Array:
    """(height,) steradians of a pixel of each row, exact."""
    edges = np.cos(np.pi * np.arange(height + 1) / height)
    return np.asarray((edges[:-1] - edges[1:]) * math.pi / height)


def painted(radiance: Radiance, height: int, samples: int = 4, contrast: float = 0.02) -> Array:
    """(height, 2·height, 3) of `radiance`: pixel centres, and samples² points where neighbours differ.

    `contrast` is the relative difference to a neighbour beyond which a pixel is refined.
    """
    shape = (height, 2 * height, 3)
    row, column = np.meshgrid(np.arange(height) + 0.5, np.arange(2 * height) + 0.5, indexing="ij")
    made = _in_batches(radiance, height, row.ravel(), column.ravel()).reshape(shape)
    light = made @ np.array(LUMINANCE) + 1e-9
    across = np.abs(np.log(light / np.roll(light, 1, axis=1))) > contrast
    down = np.abs(np.diff(np.log(light), axis=0)) > contrast
    edge = across | np.roll(across, -1, axis=1)
    edge[1:] |= down
    edge[:-1] |= down
    at_row, at_column = np.nonzero(edge)
    offsets = (np.arange(samples) + 0.5) / samples
    down_by, right_by = (o.ravel() for o in np.meshgrid(offsets, offsets, indexing="ij"))
    fine = _in_batches(
        radiance, height, (at_row[:, None] + down_by).ravel(), (at_column[:, None] + right_by).ravel()
    )
    made[at_row, at_column] = fine.reshape(-1, samples**2, 3).mean(axis=1)
    return made


def _in_batches(radiance: Radiance, height: int, rows: Array, columns: Array) -> Array:
    made = np.empty((len(rows), 3))
    for start in range(0, len(rows), 1 << 16):
        part = slice(start, start + (1 << 16))
        made[part] = radiance(directions(height, rows[part], columns[part]))
    return made


def add_disc(picture: Array, towards: Array, radius: float, radiance: Array) -> Array:
    """The picture with a disc of uniform radiance added, its energy exact, its rim antialiased."""
    height = len(picture)
    fine = 64
    theta, phi = math.acos(towards[1]), math.atan2(towards[0], towards[2])
    row, column = theta / math.pi * height, (0.5 - phi / (2 * math.pi)) * 2 * height
    reach = 2 + int(radius / math.pi * height / max(math.sin(theta), 0.05))
    rows = np.arange(max(int(row) - reach, 0), min(int(row) + reach + 1, height))
    columns = np.arange(int(column) - reach, int(column) + reach + 1)
    sub = (np.arange(fine) + 0.5) / fine
    r, c = np.meshgrid((rows[:, None] + sub).ravel(), (columns[:, None] + sub).ravel(), indexing="ij")
    inside = directions(height, r, c) @ np.asarray(towards) >= math.cos(radius)
    cover = inside.reshape(len(rows), fine, len(columns), fine).mean(axis=(1, 3))
    angle = 2 * math.pi * (1 - math.cos(radius))
    cover *= angle / (cover * solid_angles(height)[rows, None]).sum()
    made = picture.copy()
    made[rows[:, None], columns % (2 * height)] += cover[..., None] * radiance
    return made


def irradiance(picture: Array, normal: Array) -> Array:
    """(3,) irradiance of a surface with this unit normal from a picture (H, 2H, 3)."""
    height = len(picture)
    row, column = np.meshgrid(np.arange(height) + 0.5, np.arange(2 * height) + 0.5, indexing="ij")
    cosine = np.maximum(directions(height, row, column) @ np.asarray(normal, dtype=np.float64), 0)
    return np.asarray(np.einsum("hwc,hw,h->c", picture, cosine, solid_angles(height)))


def balance(light: Array, strength: float) -> Array:
    """(3,) gains that take this light towards white by `strength` (1: fully) and keep its luminance."""
    gains = (light / (light @ np.array(LUMINANCE))) ** -strength
    return np.asarray(gains * (light @ np.array(LUMINANCE)) / ((gains * light) @ np.array(LUMINANCE)))


def stored(picture: Array) -> Image:
    """The picture rounded to 11 significant bits, a half's precision, so that it packs small."""
    mantissa, exponent = np.frexp(np.maximum(picture, 0.0))
    return Image(np.ldexp(np.round(mantissa * 2048) / 2048, exponent).astype(np.float32), "linear")
