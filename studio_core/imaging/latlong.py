"""Equirectangular pictures: which direction a pixel shows.

Convention (OpenEXR's lat-long, and Mitsuba's): the picture's centre looks along +z, y is up,
u = 0.5 − atan2(x, z) / 2π, v = acos(y) / π from the top; u = 0.25 is +x. Pixel i of n covers
i / n … (i + 1) / n.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

_ALL = slice(None)


def equirect_direction(u: npt.ArrayLike, v: npt.ArrayLike) -> npt.NDArray[np.float64]:
    """(..., 3) unit directions of picture coordinates in 0…1, v down."""
    longitude = 2 * np.pi * (0.5 - np.asarray(u, dtype=np.float64))
    polar = np.pi * np.asarray(v, dtype=np.float64)
    longitude, polar = np.broadcast_arrays(longitude, polar)
    ring = np.sin(polar)
    return np.stack([ring * np.sin(longitude), np.cos(polar), ring * np.cos(longitude)], axis=-1)


def pixel_directions(
    height: int, width: int, rows: slice = _ALL, columns: slice = _ALL
) -> npt.NDArray[np.float64]:
    """(H, W, 3) unit directions of the middles of a picture's pixels, or of a part's."""
    u = ((np.arange(width) + 0.5) / width)[columns]
    v = ((np.arange(height) + 0.5) / height)[rows]
    return equirect_direction(u[None, :], v[:, None])


def direction_to_uv(directions: npt.ArrayLike) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
    """Picture coordinates u in 0…1 (0 and 1 are one) and v of directions (..., 3) of any length."""
    d = np.asarray(directions, dtype=np.float64)
    x, y, z = d[..., 0], d[..., 1], d[..., 2]
    return 0.5 - np.arctan2(x, z) / (2 * np.pi), np.arctan2(np.hypot(x, z), y) / np.pi


def pixel_solid_angles(height: int, width: int) -> npt.NDArray[np.float64]:
    """(height,) exact solid angle of one pixel of each row; all pixels together have 4π."""
    edges = np.cos(np.pi * np.arange(height + 1) / height)
    made: npt.NDArray[np.float64] = (edges[:-1] - edges[1:]) * 2 * np.pi / width
    return made
