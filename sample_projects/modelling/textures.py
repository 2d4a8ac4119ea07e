"""Textures by computation: planks, weave, a print; 8-bit sRGB, repeating without a seam where tiled."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from studio_core.scene.geometry import Image

from .mesh import Array


def noise(shape: tuple[int, int], cells: tuple[int, int], seed: int, octaves: int = 3) -> Array:
    """(H, W) smooth noise about 0, roughly −1…1, that repeats at the edges; `cells` waves at first."""
    rng = np.random.default_rng(seed)
    total, weight = np.zeros(shape), 1.0
    for octave in range(octaves):
        lattice = rng.uniform(-1, 1, (cells[0] << octave, cells[1] << octave))
        total += weight * _enlarged(_enlarged(lattice, shape[0]).T, shape[1]).T
        weight *= 0.5
    return total


def _enlarged(grid: Array, count: int) -> Array:
    """Rows interpolated to `count`, periodic, by the cubic B-spline."""
    t = (np.arange(count) + 0.5) / count * len(grid)
    base = np.floor(t).astype(np.int64)
    f = (t - base)[:, None]
    weights = ((1 - f) ** 3, 3 * f**3 - 6 * f**2 + 4, -3 * f**3 + 3 * f**2 + 3 * f + 1, f**3)
    return np.asarray(
        sum(w / 6 * grid[(base + o) % len(grid)] for w, o in zip(weights, (-1, 0, 1, 2), strict=True))
    )


def encoded(linear: Array, steps: int = 2) -> Image:
    """An 8-bit sRGB picture of linear (H, W, 3); `steps` > 1 rounds coarser and so stores smaller."""
    x = np.clip(linear, 0, 1)
    srgb = np.where(x <= 0.0031308, 12.92 * x, 1.055 * x ** (1 / 2.4) - 0.055) * 255
    pixels: npt.NDArray[np.uint8] = (np.round(srgb / steps) * steps).clip(0, 255).astype(np.uint8)
    return Image(pixels, "srgb")


def planks(size: int = 1024, rows: int = 12, seed: int = 3) -> Image:
    """Oak boards along u, two to a row, with grain, knots' rings, and dark joints; repeats both ways."""
    rng = np.random.default_rng(seed)
    v, u = np.meshgrid((np.arange(size) + 0.5) / size, (np.arange(size) + 0.5) / size, indexing="ij")
    row = np.floor(v * rows).astype(np.int64)
    starts, cuts = rng.uniform(0, 1, rows), rng.uniform(0.38, 0.62, rows)
    along = (u - starts[row]) % 1.0
    second = along > cuts[row]
    board = 2 * row + second
    tone = rng.normal(0, 1, 2 * rows)[board]
    warm = rng.normal(0, 1, 2 * rows)[board]
    slide = rng.integers(0, size, 2 * rows)
    fine = noise((size, size), (160, 4), seed + 1, 3)
    wide = noise((size, size), (24, 2), seed + 2, 3)
    columns = (np.arange(size)[None, :] + slide[board]) % size
    rows_index = np.broadcast_to(np.arange(size)[:, None], (size, size))
    fine, wide = fine[rows_index, columns], wide[rows_index, columns]
    rings = 0.5 + 0.5 * np.sin(14 * wide + 2.0 * board)
    value = 1 + 0.11 * tone + 0.10 * fine + 0.13 * (rings - 0.5) * (0.6 + 0.4 * np.sin(board * 1.7))
    base = np.array([0.57, 0.365, 0.19])
    hue = np.stack([1 + 0.02 * warm, np.ones_like(warm), 1 - 0.06 * warm], -1)
    colour = base * hue * np.maximum(value, 0.3)[..., None] ** np.array([0.9, 1.0, 1.12])
    edge_v = np.minimum(v * rows % 1.0, 1 - v * rows % 1.0) / rows
    ends = np.minimum(np.minimum(along, 1 - along), np.abs(along - cuts[row]))
    joint = np.minimum(edge_v, ends) * size
    return encoded(colour * np.clip(0.35 + 0.5 * joint, 0, 1)[..., None])


def grain(size: int = 256, seed: int = 21) -> Image:
    """Plain-sawn wood along u, about white: to be multiplied with a colour."""
    wide = noise((size, size), (5, 1), seed, 3)
    fine = noise((size, size), (48, 2), seed + 1, 3)
    rings = 0.5 + 0.5 * np.sin(16 * wide)
    value = 0.8 + 0.14 * (rings - 0.5) + 0.10 * fine
    return encoded(np.stack([value, value**1.06, value**1.12], -1))


def weave(width: int = 512, height: int = 384, seed: int = 8) -> Image:
    """A woollen rug: cream, with hand-drawn dark rhombs, a quiet border, and the rows of its knots."""
    v, u = np.meshgrid((np.arange(height) + 0.5) / height, (np.arange(width) + 0.5) / width, indexing="ij")
    wobble = 0.02 * noise((height, width), (5, 6), seed, 2)
    x, y = u * 4 + wobble * 3, v * 3 + 2.0 * wobble
    rhomb = np.abs((x + y) % 1.0 - 0.5), np.abs((x - y) % 1.0 - 0.5)
    line = np.minimum(*rhomb)
    inner = np.abs(np.maximum(*rhomb) - 0.5) + 0.35 * line
    dark = np.clip((0.035 - line) * 60, 0, 1)
    rust = np.clip((0.06 - inner) * 40, 0, 1)
    from_edge = np.minimum(np.minimum(u * 4, (1 - u) * 4), np.minimum(v * 3, (1 - v) * 3))
    field = np.clip((from_edge - 0.22) * 40, 0, 1)
    band = np.clip((0.03 - np.abs(from_edge - 0.15)) * 60, 0, 1)
    cream, ink = np.array([0.60, 0.545, 0.455]), np.array([0.105, 0.12, 0.15])
    clay = np.array([0.40, 0.17, 0.10])
    colour = np.broadcast_to(cream, (height, width, 3))
    for mask, paint in ((rust * field, clay), (dark * field, ink), (band, ink)):
        colour = colour * (1 - mask[..., None]) + paint * mask[..., None]
    knots = 1 + 0.07 * np.sin(2 * np.pi * v * height / 4) * np.sin(
        2 * np.pi * (u * width / 4 + 0.5 * (v * height // 4))
    )
    wool = (
        1
        + 0.07 * noise((height, width), (90, 120), seed + 1, 1)
        + 0.05 * noise((height, width), (8, 10), seed + 2, 2)
    )
    return encoded(colour * (knots * wool)[..., None], 3)


def abstract_print(width: int = 320, height: int = 256, seed: int = 4) -> Image:
    """A print of arches and a disc in earth colours on sand, on white paper."""
    y, x = np.meshgrid(
        (np.arange(4 * height) + 0.5) / (4 * height),
        (np.arange(4 * width) + 0.5) / (4 * width) * width / height,
        indexing="ij",
    )
    aspect = width / height
    shapes = (
        ((x - 0.40 * aspect) ** 2 + (y - 0.36) ** 2 < 0.135**2, (0.52, 0.17, 0.075)),
        (
            (np.hypot(x - 0.62 * aspect, (y - 0.60)) < 0.27) & (y < 0.60)
            | (np.abs(x - 0.62 * aspect) < 0.27) & (y >= 0.60) & (y < 0.86),
            (0.16, 0.21, 0.17),
        ),
        (
            (np.hypot(x - 0.62 * aspect, (y - 0.64)) < 0.16) & (y < 0.64)
            | (np.abs(x - 0.62 * aspect) < 0.16) & (y >= 0.64) & (y < 0.86),
            (0.66, 0.56, 0.42),
        ),
        ((np.hypot(x - 0.30 * aspect, (y - 0.86)) < 0.2) & (y < 0.86), (0.10, 0.15, 0.22)),
        ((np.abs(y - 0.875) < 0.012) & (np.abs(x - 0.5 * aspect) < 0.40 * aspect), (0.10, 0.10, 0.10)),
    )
    colour = np.full((*x.shape, 3), (0.70, 0.64, 0.54))
    for mask, paint in shapes:
        colour[mask] = paint
    margin = np.minimum(np.minimum(x, aspect - x), np.minimum(y, 1 - y)) < 0.05
    colour[margin] = (0.78, 0.77, 0.74)
    small = colour.reshape(height, 4, width, 4, 3).mean(axis=(1, 3))
    return encoded(small * (1 + 0.02 * noise((height, width), (64, 80), seed, 1))[..., None], 3)


def slabs(size: int = 512, rows: int = 6, seed: int = 17) -> Image:
    """Pale stone slabs in running bond, three to a row, with dark joints; repeats both ways."""
    rng = np.random.default_rng(seed)
    v, u = np.meshgrid((np.arange(size) + 0.5) / size, (np.arange(size) + 0.5) / size, indexing="ij")
    row = np.floor(v * rows).astype(np.int64)
    across = (u + (row % 2) / 6) % 1.0 * 3
    slab = row * 3 + np.floor(across).astype(np.int64)
    tone = rng.normal(0, 1, 3 * rows)[slab]
    cloud = noise((size, size), (9, 9), seed, 4)
    pores = noise((size, size), (128, 128), seed + 1, 1)
    value = 1 + 0.05 * tone + 0.06 * cloud + 0.035 * pores
    warm = rng.normal(0, 0.02, 3 * rows)[slab]
    colour = (
        np.array([0.47, 0.425, 0.36])
        * value[..., None]
        * np.stack([1 + warm, np.ones_like(warm), 1 - warm], -1)
    )
    in_row, in_column = v * rows % 1.0, across % 1.0
    joint = np.minimum(np.minimum(in_row, 1 - in_row) / rows, np.minimum(in_column, 1 - in_column) / 3) * size
    return encoded(colour * np.clip(0.4 + 0.35 * joint, 0, 1)[..., None], 3)
