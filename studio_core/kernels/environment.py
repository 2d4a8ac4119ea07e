"""From an equirectangular map of radiance to the leaves of the direction tree.

Between pixel centres a map is bilinear (wrapping in u, clamped at the poles, centres at half integers), as
in OpenEXR's lat-long maps and Mitsuba's `envmap`. Leaves hold its mean over their cell, never a point
sample.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from studio_core.errors import InputError
from studio_core.jit import kernel
from studio_core.kernels.directions import arctangent, cell_of_leaf, direction_at
from studio_core.parallel import Checkpoints, Workers

F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]

PIXELS_PER_LEAF = 4.0
"""Maps with more pixels across a leaf are averaged down first."""
SAMPLES_PER_PIXEL = 3.0
_STRETCH = 1.5  # by how much the concentric map lengthens a cell's side at most, about
_PI = np.float32(math.pi)
_INVERSE_TURN = np.float32(0.5 / math.pi)
_INVERSE_PI = np.float32(1 / math.pi)
_QUARTER_TURN = np.float32(math.pi / 2)
_ONE, _HALF, _ZERO = np.float32(1), np.float32(0.5), np.float32(0)


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
    """atan2(y, x) within 3e-7; 0 at the origin. Without branches, so that loops become vector code."""
    tall = abs(y) > abs(x)
    larger, smaller = y if tall else x, x if tall else y
    angle = arctangent(smaller / (larger if larger != 0 else _ONE))
    upright = _QUARTER_TURN if y > 0 else -_QUARTER_TURN
    flat = _ZERO if x >= 0 else (_PI if y >= 0 else -_PI)
    return upright - angle if tall else flat + angle


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
def _integrate(
    padded: F32, to_environment: F32, k: int, across: int, along: int, out: F32, start: int, stop: int
) -> None:
    """Leaves start … stop: the mean over across × along points of each cell."""
    height, width = padded.shape[0] - 2, padded.shape[1] - 2
    columns, rows = np.float32(across << (k // 2)), np.float32(along << ((k - 1) // 2))
    wide, tall = np.float32(width), np.float32(height)
    m = to_environment
    xx, xy, xz = m[0, 0], m[0, 1], m[0, 2]
    yx, yy, yz = m[1, 0], m[1, 1], m[1, 2]
    zx, zy, zz = m[2, 0], m[2, 1], m[2, 2]
    us, vs = np.empty(along, np.float32), np.empty(along, np.float32)
    for leaf in range(start, stop):
        hemisphere, column, row = cell_of_leaf(leaf, k)
        red, green, blue = 0.0, 0.0, 0.0
        for i in range(across):
            s = (np.float32(column * across + i) + _HALF) / columns
            for j in range(along):
                t = (np.float32(row * along + j) + _HALF) / rows
                x, y, z = direction_at(hemisphere, s, t)
                ex = xx * x + xy * y + xz * z
                ey = yx * x + yy * y + yz * z
                ez = zx * x + zy * y + zz * z
                around = np.float32(math.sqrt(ex * ex + ez * ez))
                us[j] = (_HALF - angle_of(ex, ez) * _INVERSE_TURN) * wide + _HALF
                vs[j] = angle_of(around, ey) * _INVERSE_PI * tall + _HALF
            line_red, line_green, line_blue = _ZERO, _ZERO, _ZERO
            for j in range(along):
                u, v = us[j], vs[j]
                left, top = min(max(int(u), 0), width), min(max(int(v), 0), height)
                fu, fv = u - np.float32(left), v - np.float32(top)
                a, b = (_ONE - fu) * (_ONE - fv), fu * (_ONE - fv)
                c, d = (_ONE - fu) * fv, fu * fv
                upper, lower = padded[top], padded[top + 1]
                line_red += a * upper[left, 0] + b * upper[left + 1, 0]
                line_red += c * lower[left, 0] + d * lower[left + 1, 0]
                line_green += a * upper[left, 1] + b * upper[left + 1, 1]
                line_green += c * lower[left, 1] + d * lower[left + 1, 1]
                line_blue += a * upper[left, 2] + b * upper[left + 1, 2]
                line_blue += c * lower[left, 2] + d * lower[left + 1, 2]
            red += np.float64(line_red)
            green += np.float64(line_green)
            blue += np.float64(line_blue)
        out[leaf, 0] = red / (across * along)
        out[leaf, 1] = green / (across * along)
        out[leaf, 2] = blue / (across * along)


def checked_rotation(rotation: npt.ArrayLike) -> F64:
    """The matrix; raises `InputError` when it does not turn."""
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


def row_weights(height: int) -> F64:
    """(H,) ∫ sin θ dθ of each row's tent; the first and the last reach to the poles undiminished."""
    step = math.pi / height
    rows = np.sin(step * (np.arange(height) + 0.5)) * 2 * (1 - math.cos(step)) / step
    rows[0] = rows[-1] = 1 - (math.sin(1.5 * step) - math.sin(0.5 * step)) / step if height > 1 else 2.0
    return np.asarray(rows, np.float64)


def map_power(pixels: F32) -> F64:
    """∫ L dω (3,) of the bilinear map, in closed form."""
    height, width = pixels.shape[:2]
    sums: F64 = pixels.sum(axis=1, dtype=np.float64)
    return np.asarray(row_weights(height) @ sums * 2 * math.pi / width, np.float64)


def scaled_to(leaves: F32, power: F64) -> None:
    """Scales each colour so that the leaves' power is `power`, where there is any."""
    found = leaves.sum(axis=0, dtype=np.float64) * 4 * math.pi / len(leaves)
    leaves *= np.where(found > 0, power / np.where(found > 0, found, 1.0), 1.0).astype(np.float32)


@dataclass(frozen=True, eq=False)
class EnvironmentMap:
    """A map made ready for 2^k leaves, whatever its rotation; get it from `prepare`."""

    k: int
    padded: F32
    """The map as small as the leaves allow, one more pixel all around."""
    power: F64

    @staticmethod
    def prepare(
        pixels: npt.ArrayLike, k: int, workers: Workers, job: Checkpoints | None = None
    ) -> EnvironmentMap:
        """pixels (H, W, 3): scene-linear radiance; `InputError` where it is negative or not finite."""
        whole = checked_map(pixels)
        return EnvironmentMap(k, padded_map(reduced_map(whole, k, workers, job)), map_power(whole))

    def over_leaves(self, rotation: npt.ArrayLike, workers: Workers, job: Checkpoints | None = None) -> F32:
        """Mean radiance (S, 3) float32 over each of the 2^k leaves; rotation (3, 3): world from environment.

        Each cell is summed over equal-area points half to a third of a pixel apart; the sums are then
        scaled to the map's exact power. A single pixel's light is caught to 1 % (suns, for which that is
        too little, are taken out before: `suns.split_suns`), constants to rounding.
        """
        k, padded = self.k, self.padded
        to_environment = np.ascontiguousarray(checked_rotation(rotation).T, np.float32)
        pixel = min(math.pi / (padded.shape[0] - 2), 2 * math.pi / (padded.shape[1] - 2))
        side = math.sqrt(2 * math.pi) * _STRETCH
        across = max(6, math.ceil(side / (1 << (k // 2)) / pixel * SAMPLES_PER_PIXEL))
        along = max(6, math.ceil(side / (1 << ((k - 1) // 2)) / pixel * SAMPLES_PER_PIXEL))
        out = np.empty((1 << k, 3), np.float32)
        workers.run(
            len(out),
            max(16, 65536 // (across * along)),
            lambda start, stop: _integrate(padded, to_environment, k, across, along, out, start, stop),
            job,
        )
        scaled_to(out, self.power)
        return out


def integrate_environment(
    pixels: npt.ArrayLike, rotation: npt.ArrayLike, k: int, workers: Workers, job: Checkpoints | None = None
) -> F32:
    """`EnvironmentMap.over_leaves` of a map that is needed once."""
    return EnvironmentMap.prepare(pixels, k, workers, job).over_leaves(rotation, workers, job)
