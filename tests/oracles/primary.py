"""What a camera sees, by testing every pixel's ray against every triangle; and what an environment shows."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Seen:
    """Per pixel: object (−1: none), distance along the ray, texture coordinates, ray direction."""

    obj: npt.NDArray[np.int64]
    distance: Array
    uv: Array
    direction: Array


def camera_rays(camera_to_world: Array, fov: float, width: int, height: int) -> Array:
    """(H, W, 3) unit directions through pixel centres; the camera looks along −z, `fov` is vertical."""
    top = np.tan(np.radians(fov) / 2)
    x = (2 * (np.arange(width) + 0.5) / width - 1) * top * width / height
    y = (1 - 2 * (np.arange(height) + 0.5) / height) * top
    local = np.stack([*np.meshgrid(x, y), np.full((height, width), -1.0)], axis=-1)
    world = local @ camera_to_world[:3, :3].T
    return world / np.linalg.norm(world, axis=-1, keepdims=True)


def see(
    camera_to_world: Array,
    fov: float,
    width: int,
    height: int,
    meshes: list[tuple[Array, npt.NDArray[np.int64], Array, Array]],
) -> Seen:
    """Nearest hits (Möller–Trumbore); a mesh is positions, faces, uvs and its 4×4 world matrix."""
    d = camera_rays(camera_to_world, fov, width, height)
    o = camera_to_world[:3, 3]
    near = np.full((height, width), np.inf)
    obj, uv = np.full((height, width), -1), np.zeros((height, width, 2))
    for index, (positions, faces, uvs, world) in enumerate(meshes):
        placed = positions @ world[:3, :3].T + world[:3, 3]
        for face in faces:
            a, b, c = placed[face]
            p = np.cross(d, c - a)
            det = p @ (b - a)
            det = np.where(np.abs(det) < 1e-12, np.inf, det)
            s = (p @ (o - a)) / det
            q = np.cross(o - a, b - a)
            t = (d @ q) / det
            distance = ((c - a) @ q) / det
            hit = (s >= 0) & (t >= 0) & (s + t <= 1) & (distance > 1e-6) & (distance < near)
            near[hit], obj[hit] = distance[hit], index
            corners = uvs[face]
            mixed = (
                corners[0]
                + s[..., None] * (corners[1] - corners[0])
                + t[..., None] * (corners[2] - corners[0])
            )
            uv[hit] = mixed[hit]
    return Seen(obj, near, uv, d)


def bilinear(pixels: Array, column: Array, row: Array) -> Array:
    """Interpolation between pixel centres at fractional indices; columns repeat, rows end."""
    height, width = pixels.shape[:2]
    i, j = np.floor(column).astype(int), np.floor(row).astype(int)
    x, y = (column - i)[..., None], (row - j)[..., None]
    j0, j1 = np.clip(j, 0, height - 1), np.clip(j + 1, 0, height - 1)
    top = pixels[j0, i % width] * (1 - x) + pixels[j0, (i + 1) % width] * x
    low = pixels[j1, i % width] * (1 - x) + pixels[j1, (i + 1) % width] * x
    return np.asarray(top * (1 - y) + low * y)


def environment(pixels: Array, azimuth: float, tilt: float, directions: Array) -> Array:
    """Radiance of a lat-long picture tilted about x, then turned about y (degrees), towards directions."""
    a, t = np.radians(azimuth), np.radians(tilt)
    tip = np.array([[1, 0, 0], [0, np.cos(t), -np.sin(t)], [0, np.sin(t), np.cos(t)]])
    turn = np.array([[np.cos(a), 0, np.sin(a)], [0, 1, 0], [-np.sin(a), 0, np.cos(a)]])
    x, y, z = np.moveaxis(directions @ (turn @ tip), -1, 0)  # transposed: into the picture's frame
    height, width = pixels.shape[:2]
    u, v = 0.5 - np.arctan2(x, z) / (2 * np.pi), np.arccos(np.clip(y, -1, 1)) / np.pi
    return bilinear(pixels, u * width - 0.5, v * height - 0.5)
