"""Environment light on the tree of directions: integrated over leaves, summed over nodes and ranges.

An environment is an equirectangular map of radiance; between pixel centres it is bilinear (wrapping in
u, clamped at the poles, centres at half integers), as in OpenEXR's lat-long maps and Mitsuba's
`envmap`. Leaves hold its mean over their cell, never a point sample: a sun inside one cell is kept.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from studio_core.colour import LUMINANCE
from studio_core.errors import InputError
from studio_core.jit import kernel
from studio_core.kernels.directions import arctangent, cell_of_leaf, direction_at, direction_set, leaf_of
from studio_core.parallel import Checkpoints, Workers

F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]
Colour = tuple[np.float32, np.float32, np.float32]

PIXELS_PER_LEAF = 4.0
"""Maps with more pixels across a leaf are averaged down first."""
SAMPLES_PER_PIXEL = 6.0
_STRETCH = 1.5  # by how much the concentric map lengthens a cell's side at most, about
_PI = np.float32(math.pi)
_INVERSE_TURN = np.float32(0.5 / math.pi)
_INVERSE_PI = np.float32(1 / math.pi)
_QUARTER_TURN = np.float32(math.pi / 2)
_ONE, _HALF = np.float32(1), np.float32(0.5)


@kernel
def _box_rows(pixels: F32, out: F32, start: int, stop: int) -> None:
    """Rows start … stop of a smaller map: means of `pixels` weighted by solid angle."""
    height, width = pixels.shape[0], pixels.shape[1]
    rows, columns = out.shape[0], out.shape[1]
    tall, wide = height / rows, width / columns
    for row in range(start, stop):
        top, bottom = row * tall, (row + 1) * tall
        for column in range(columns):
            left, right = column * wide, (column + 1) * wide
            red, green, blue, total = 0.0, 0.0, 0.0, 0.0
            for y in range(int(top), min(height, math.ceil(bottom - 1e-9))):
                upper, lower = max(top, float(y)), min(bottom, y + 1.0)
                across = math.cos(math.pi * upper / height) - math.cos(math.pi * lower / height)
                for x in range(int(left), min(width, math.ceil(right - 1e-9))):
                    weight = across * (min(right, x + 1.0) - max(left, float(x)))
                    red += weight * pixels[y, x, 0]
                    green += weight * pixels[y, x, 1]
                    blue += weight * pixels[y, x, 2]
                    total += weight
            out[row, column, 0] = red / total
            out[row, column, 1] = green / total
            out[row, column, 2] = blue / total


@kernel
def _widen_rows(pixels: F32, out: F32, start: int, stop: int) -> None:
    """Rows start … stop averaged along u until a pixel is two thirds as wide as it is high.

    Near the poles pixels are slivers that a grid of samples would miss; a row keeps its sum. The first
    and the last row become constant.
    """
    height, width = pixels.shape[0], pixels.shape[1]
    for row in range(start, stop):
        sine = math.sin(math.pi * (row + 0.5) / height)
        span = min(float(width), height / (0.75 * width * sine))
        if row == 0 or row == height - 1:
            span = float(width)
        if span <= 1.0 + 1e-9:
            out[row] = pixels[row]
            continue
        reach = math.ceil((span - 1.0) / 2 - 1e-9)
        edge = (span - 1.0) / 2 - (reach - 1)
        if 2 * reach + 1 > width:
            reach, edge = width // 2, (1.0 if width % 2 == 1 else 0.5)
        for channel in range(3):
            inner = 0.0
            for x in range(-reach + 1, reach):
                inner += pixels[row, x % width, channel]
            for x in range(width):
                ends = np.float64(pixels[row, (x - reach) % width, channel])
                ends += pixels[row, (x + reach) % width, channel]
                out[row, x, channel] = (inner + edge * ends) / (2 * reach - 1 + 2 * edge)
                inner += pixels[row, (x + reach) % width, channel]
                inner -= pixels[row, (x - reach + 1) % width, channel]


@kernel
def angle_of(y: np.float32, x: np.float32) -> np.float32:
    """atan2(y, x) within 3e-7; 0 at the origin."""
    tall = abs(y) > abs(x)
    larger = y if tall else x
    angle = arctangent((x if tall else y) / (larger if larger != 0 else _ONE))
    if tall:
        return (_QUARTER_TURN if y > 0 else -_QUARTER_TURN) - angle
    if x < 0:
        return angle + (_PI if y >= 0 else -_PI)
    return angle


@kernel
def padded_map(pixels: F32) -> F32:
    """The map (H + 2, W + 2, 3) with one more pixel all around: wrapped in u, repeated at the poles."""
    height, width = pixels.shape[0], pixels.shape[1]
    out = np.empty((height + 2, width + 2, 3), np.float32)
    for row in range(height + 2):
        line = pixels[min(max(row - 1, 0), height - 1)]
        out[row, 1 : width + 1] = line
        out[row, 0] = line[width - 1]
        out[row, width + 1] = line[0]
    return out


@kernel
def bilinear(padded: F32, x: np.float32, y: np.float32, z: np.float32) -> Colour:
    """Radiance of a `padded_map` in direction (x, y, z) of the environment's own frame."""
    height, width = padded.shape[0] - 2, padded.shape[1] - 2
    around = np.float32(math.sqrt(x * x + z * z))
    u = (_HALF - angle_of(x, z) * _INVERSE_TURN) * np.float32(width) + _HALF
    v = angle_of(around, y) * _INVERSE_PI * np.float32(height) + _HALF
    column, row = min(max(int(u), 0), width), min(max(int(v), 0), height)
    fu, fv = u - np.float32(column), v - np.float32(row)
    a, b = (_ONE - fu) * (_ONE - fv), fu * (_ONE - fv)
    c, d = (_ONE - fu) * fv, fu * fv
    upper, lower = padded[row], padded[row + 1]
    return (
        a * upper[column, 0] + b * upper[column + 1, 0] + c * lower[column, 0] + d * lower[column + 1, 0],
        a * upper[column, 1] + b * upper[column + 1, 1] + c * lower[column, 1] + d * lower[column + 1, 1],
        a * upper[column, 2] + b * upper[column + 1, 2] + c * lower[column, 2] + d * lower[column + 1, 2],
    )


@kernel
def _integrate(
    padded: F32, to_environment: F32, k: int, across: int, along: int, out: F32, start: int, stop: int
) -> None:
    """Leaves start … stop: the mean over across × along points of each cell."""
    columns, rows = np.float32(across << (k // 2)), np.float32(along << ((k - 1) // 2))
    m = to_environment
    for leaf in range(start, stop):
        hemisphere, column, row = cell_of_leaf(leaf, k)
        red, green, blue = 0.0, 0.0, 0.0
        for i in range(across):
            s = (np.float32(column * across + i) + _HALF) / columns
            line_red, line_green, line_blue = np.float32(0), np.float32(0), np.float32(0)
            for j in range(along):
                t = (np.float32(row * along + j) + _HALF) / rows
                x, y, z = direction_at(hemisphere, s, t)
                r, g, b = bilinear(
                    padded,
                    m[0, 0] * x + m[0, 1] * y + m[0, 2] * z,
                    m[1, 0] * x + m[1, 1] * y + m[1, 2] * z,
                    m[2, 0] * x + m[2, 1] * y + m[2, 2] * z,
                )
                line_red += r
                line_green += g
                line_blue += b
            red += np.float64(line_red)
            green += np.float64(line_green)
            blue += np.float64(line_blue)
        out[leaf, 0] = red / (across * along)
        out[leaf, 1] = green / (across * along)
        out[leaf, 2] = blue / (across * along)


def _checked_rotation(rotation: npt.ArrayLike) -> F64:
    matrix = np.asarray(rotation, np.float64)
    if matrix.shape != (3, 3) or not np.allclose(matrix @ matrix.T, np.eye(3), atol=1e-6):
        raise InputError("the environment's rotation is not a rotation matrix")
    return matrix


def checked_map(pixels: npt.ArrayLike) -> F32:
    """The map as contiguous float32 (H, W, 3); raises `InputError` when it cannot be radiance."""
    image = np.ascontiguousarray(pixels, np.float32)
    if image.ndim != 3 or image.shape[2] != 3 or image.shape[0] < 1 or image.shape[1] < 2:
        raise InputError(f"an environment map has rows, columns and three colours, not {image.shape}")
    if not np.isfinite(image.min()) or not np.isfinite(image.max()):
        raise InputError("the environment map holds radiance that is not finite")
    if image.min() < 0:
        raise InputError("the environment map holds negative radiance")
    return image


def reduced_map(pixels: F32, k: int, workers: Workers, job: Checkpoints | None = None) -> F32:
    """The map averaged down to what 2^k leaves need, pixels near the poles as wide as they are high.

    Means are weighted by solid angle; a map that is small already keeps its size.
    """
    height, width = pixels.shape[:2]
    pixel = math.sqrt(4 * math.pi / (1 << k)) / PIXELS_PER_LEAF
    rows, columns = min(height, math.ceil(math.pi / pixel)), min(width, math.ceil(2 * math.pi / pixel))
    small = pixels
    if (rows, columns) != (height, width):
        small = np.empty((rows, columns, 3), np.float32)
        workers.run(rows, 16, lambda start, stop: _box_rows(pixels, small, start, stop), job)
    wide = np.empty_like(small)
    workers.run(rows, 16, lambda start, stop: _widen_rows(small, wide, start, stop), job)
    return wide


def map_power(pixels: F32) -> F64:
    """∫ L dω (3,) of the bilinear map, in closed form: each row's tent integrated against sin θ."""
    height, width = pixels.shape[:2]
    step = math.pi / height
    rows = np.sin(step * (np.arange(height) + 0.5)) * 2 * (1 - math.cos(step)) / step
    rows[0] = rows[-1] = 1 - (math.sin(1.5 * step) - math.sin(0.5 * step)) / step if height > 1 else 2.0
    sums: F64 = pixels.sum(axis=1, dtype=np.float64)
    return np.asarray(rows @ sums * 2 * math.pi / width, np.float64)


def _scaled_to(leaves: F32, power: F64) -> None:
    """Scales each colour so that the leaves' power is `power`, where there is any."""
    found = leaves.sum(axis=0, dtype=np.float64) * 4 * math.pi / len(leaves)
    leaves *= np.where(found > 0, power / np.where(found > 0, found, 1.0), 1.0).astype(np.float32)


def integrate_environment(
    pixels: npt.ArrayLike, rotation: npt.ArrayLike, k: int, workers: Workers, job: Checkpoints | None = None
) -> F32:
    """Mean radiance (S, 3) float32 of an environment over each of the 2^k leaves.

    pixels (H, W, 3): scene-linear radiance; rotation (3, 3): world from environment. Each cell is
    summed over equal-area points a quarter to an eighth of a pixel apart, which catches a one-pixel sun
    to 0.4 %; the sums are then scaled to the map's exact power. Constants come out exact to rounding.
    Raises `InputError` for negative or non-finite radiance.
    """
    whole = checked_map(pixels)
    image = reduced_map(whole, k, workers, job)
    padded = padded_map(image)
    to_environment = np.ascontiguousarray(_checked_rotation(rotation).T, np.float32)
    height, width = image.shape[:2]
    pixel = min(math.pi / height, 2 * math.pi / width)
    side = math.sqrt(2 * math.pi) * _STRETCH
    across = max(2, math.ceil(side / (1 << (k // 2)) / pixel * SAMPLES_PER_PIXEL))
    along = max(2, math.ceil(side / (1 << ((k - 1) // 2)) / pixel * SAMPLES_PER_PIXEL))
    out = np.empty((1 << k, 3), np.float32)
    chunk = max(16, 65536 // (across * along))
    workers.run(
        len(out),
        chunk,
        lambda start, stop: _integrate(padded, to_environment, k, across, along, out, start, stop),
        job,
    )
    _scaled_to(out, map_power(whole))
    return out


@kernel
def _rotate(
    leaves: F32, from_k: int, to_environment: F32, k: int, points: int, out: F32, start: int, stop: int
) -> None:
    columns, rows = np.float32(points << (k // 2)), np.float32(points << ((k - 1) // 2))
    m = to_environment
    for leaf in range(start, stop):
        hemisphere, column, row = cell_of_leaf(leaf, k)
        red, green, blue = np.float32(0), np.float32(0), np.float32(0)
        for i in range(points):
            s = (np.float32(column * points + i) + _HALF) / columns
            for j in range(points):
                t = (np.float32(row * points + j) + _HALF) / rows
                x, y, z = direction_at(hemisphere, s, t)
                source = leaf_of(
                    m[0, 0] * x + m[0, 1] * y + m[0, 2] * z,
                    m[1, 0] * x + m[1, 1] * y + m[1, 2] * z,
                    m[2, 0] * x + m[2, 1] * y + m[2, 2] * z,
                    from_k,
                )
                red += leaves[source, 0]
                green += leaves[source, 1]
                blue += leaves[source, 2]
        share = _ONE / np.float32(points * points)
        out[leaf, 0], out[leaf, 1], out[leaf, 2] = red * share, green * share, blue * share


def rotate_radiance(
    leaves: F32, rotation: npt.ArrayLike, k: int, workers: Workers, job: Checkpoints | None = None
) -> F32:
    """Leaf radiance (2^k, 3) of an environment turned by `rotation`, from its own leaves (2^j, 3).

    For the time while a hand turns it: 16 lookups a leaf in milliseconds. Light moves by up to half a
    source leaf and power is kept per colour; `integrate_environment` is exact.
    """
    from_k = len(leaves).bit_length() - 1
    to_environment = np.ascontiguousarray(_checked_rotation(rotation).T, np.float32)
    source = np.ascontiguousarray(leaves, np.float32)
    out = np.empty((1 << k, 3), np.float32)
    workers.run(
        len(out),
        2048,
        lambda start, stop: _rotate(source, from_k, to_environment, k, 4, out, start, stop),
        job,
    )
    _scaled_to(out, source.sum(axis=0, dtype=np.float64) * 4 * math.pi / len(source))
    return out


@dataclass(frozen=True, eq=False)
class LightTree:
    """Radiance of the leaves with the sums that shading needs; get it from `LightTree.build`.

    The light of leaves a … b−1 is prefix_power[b] − prefix_power[a], the vector irradiance of a
    channel likewise from prefix_vector: exact for any interval of leaves.
    """

    k: int
    radiance: F32
    """(S, 3) mean radiance of the leaves."""
    node_sum: F32
    """(2S, 3) sum of the leaves' radiance below each node, in heap order (root 1, leaf j at S + j)."""
    node_moment: F32
    """(2S, 3) luminance-weighted sum of directions below each node; its direction is the light's centroid."""
    prefix_power: F64
    """(S + 1, 3) sums of L·Δω over leaves before each."""
    prefix_vector: F64
    """(S + 1, 3, 3) sums of L_c·ω·Δω over leaves before each: [leaf, channel, axis]."""

    @property
    def solid_angle(self) -> float:
        """Of a leaf."""
        return 4 * math.pi / (1 << self.k)

    @staticmethod
    def build(radiance: npt.ArrayLike) -> LightTree:
        """The tree over leaf radiance (2^k, 3), finite and not negative."""
        leaves = np.ascontiguousarray(radiance, np.float32)
        size = len(leaves)
        k = size.bit_length() - 1
        if leaves.shape != (1 << k, 3):
            raise InputError(f"leaf radiance needs 2^k rows of three colours, not {leaves.shape}")
        directions = direction_set(k)
        if not np.isfinite(leaves).all():
            raise InputError("the light holds radiance that is not finite")
        if leaves.min() < 0:
            raise InputError("the light holds negative radiance")
        wide = leaves.astype(np.float64)
        along = directions.directions.astype(np.float64)
        sums, moments = np.zeros((2 * size, 3)), np.zeros((2 * size, 3))
        sums[size:] = wide
        moments[size:] = (wide @ np.array(LUMINANCE))[:, None] * along
        for level in range(k - 1, -1, -1):
            first = 1 << level
            for table in (sums, moments):
                np.add(
                    table[2 * first : 4 * first : 2],
                    table[2 * first + 1 : 4 * first : 2],
                    table[first : 2 * first],
                )
        power = np.zeros((size + 1, 3))
        np.cumsum(wide * directions.solid_angle, axis=0, out=power[1:])
        vector = np.zeros((size + 1, 3, 3))
        np.cumsum((wide * directions.solid_angle)[:, :, None] * along[:, None, :], axis=0, out=vector[1:])
        arrays = (leaves.copy(), sums.astype(np.float32), moments.astype(np.float32), power, vector)
        for array in arrays:
            array.flags.writeable = False
        return LightTree(k, *arrays)

    def coarsened(self, k: int) -> LightTree:
        """The tree over 2^k fewer leaves: means of this one's."""
        if not k <= self.k:
            raise ValueError(f"2^{self.k} leaves cannot be made 2^{k}")
        if k == self.k:
            return self
        block = 1 << (self.k - k)
        means = self.radiance.astype(np.float64).reshape(1 << k, block, 3).mean(axis=1)
        return LightTree.build(means)
