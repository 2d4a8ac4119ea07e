"""Irradiance from an environment at places where nothing is in the way.

What a photograph shows was lit like this: a surface that catches shadows multiplies the photograph with the
irradiance that it gets over this one (differential rendering: Debevec, SIGGRAPH 1998, section 5).
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from studio_core.kernels.environment import row_weights

F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]

ROWS = 96
"""Of the coarse grid in which light is put together: 1.9° of a cell are cut by a horizon."""
_AT_ONCE = 256  # normals


class OpenLight:
    """Light of an equirectangular picture (H, W, 3) as vector irradiance of cells: (cells, channel, axis)."""

    def __init__(self, pixels: F32) -> None:
        finer = -(-ROWS // pixels.shape[0])
        if finer > 1:
            pixels = pixels.repeat(finer, axis=0).repeat(finer, axis=1)
        height, width = pixels.shape[:2]
        rows, columns = min(ROWS, height), min(2 * ROWS, width)
        weight = row_weights(height) * 2 * math.pi / width
        polar = np.pi * (np.arange(height) + 0.5) / height
        around = 2 * np.pi * (0.5 - (np.arange(width) + 0.5) / width)
        right = np.arange(columns) * width // columns
        top = np.arange(rows) * height // rows
        made = np.empty((rows, columns, 3, 3))
        ways = (np.sin(around), np.ones(width), np.cos(around))
        lift = (np.sin(polar), np.cos(polar), np.sin(polar))
        for axis, (across, up) in enumerate(zip(ways, lift, strict=True)):
            strips = np.empty((height, columns, 3))
            for row in range(height):  # one by one: a panorama at once would need its size in float64
                strips[row] = np.add.reduceat(pixels[row] * across[:, None], right, axis=0)
            made[..., axis] = np.add.reduceat(strips * (weight * up)[:, None, None], top, axis=0)
        self._cells = made.reshape(-1, 3)

    def irradiance(self, normals: npt.ArrayLike) -> F64:
        """(N, 3) at unit normals (N, 3) in the picture's frame; equal normals are summed once."""
        given = np.asarray(normals, np.float64).reshape(-1, 3)
        ways, of = np.unique(np.round(given, 4), axis=0, return_inverse=True)
        made = np.empty((len(ways), 3))
        for first in range(0, len(ways), _AT_ONCE):
            some = ways[first : first + _AT_ONCE]
            facing = np.maximum(self._cells @ some.T, 0)  # (cells · channel, n)
            made[first : first + _AT_ONCE] = facing.reshape(-1, 3, len(some)).sum(axis=0).T
        return np.asarray(made[of.reshape(-1)])
