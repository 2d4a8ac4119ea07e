"""What tests of stitching share: lenses that look at a sky given by a function, and a light meter."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from studio_core.capturing.artifacts import Registration, View
from studio_core.capturing.standing import HALF_TURN
from studio_core.imaging.latlong import pixel_directions, pixel_solid_angles
from studio_core.imaging.projection import Circle, Lens, pixel_points, unproject

Sky = Callable[[np.ndarray], np.ndarray]


def smooth_sky(directions: np.ndarray) -> np.ndarray:
    """Radiance (..., 3) without symmetry, brightest 20 times the darkest."""
    d = directions / np.linalg.norm(directions, axis=-1, keepdims=True)
    x, y, z = d[..., 0], d[..., 1], d[..., 2]
    return np.exp(np.stack([1.2 * y + 0.3 * x * z, y + 0.4 * z, 0.8 * y - 0.5 * x], -1)).astype(np.float32)


def sphere(height: int) -> np.ndarray:
    """(height, 2 height, 3) directions of an equirectangular picture's pixels."""
    return pixel_directions(height, 2 * height)


def lens_view(sky: Sky, lens: Lens, rotation: np.ndarray, size: int = 200) -> View:
    """What a lens sees; `rotation` (3, 3): the sky's frame from the lens'."""
    circle = Circle(size / 2 + 0.7, size / 2 - 1.3, size * 0.47)
    points = pixel_points(size, size)
    directions, _ = unproject(lens, circle, points)
    reach = np.hypot(points[..., 0] - circle.x, points[..., 1] - circle.y)
    light = np.where((reach < circle.radius + 1)[..., None], sky(directions @ rotation.T), 0)
    return View(light.astype(np.float32), reach < circle.radius - 0.5, circle, lens)


def registration(
    lens: Lens, rotation: np.ndarray, gain: float = 1.0, falloff: tuple[float, float, float] = (0, 0, 0)
) -> Registration:
    """Of a back lens with this rotation to the front lens."""
    return Registration(rotation, lens, np.full(3, gain), falloff, 0.0, 100, True)


def pair(sky: Sky, lens: Lens, rotation: np.ndarray, size: int = 200) -> dict[str, View]:
    """Front and back lens; the front one looks at the middle of the sky's equirectangular picture."""
    front = lens_view(sky, lens, HALF_TURN, size)
    return {"front": front, "back": lens_view(sky, lens, HALF_TURN @ rotation, size)}


def turn(axis: tuple[float, float, float], degrees: float) -> np.ndarray:
    """(3, 3) right-handed rotation."""
    a = np.asarray(axis, float) / np.linalg.norm(axis)
    k = np.array([[0, -a[2], a[1]], [a[2], 0, -a[0]], [-a[1], a[0], 0]])
    r = np.radians(degrees)
    return np.eye(3) + np.sin(r) * k + (1 - np.cos(r)) * k @ k


def irradiance(light: np.ndarray) -> np.ndarray:
    """(26, 3) of an equirectangular picture: faces, edges and corners of a cube."""
    steps = (-1, 0, 1)
    normals = np.array([(x, y, z) for x in steps for y in steps for z in steps if (x, y, z) != (0, 0, 0)])
    normals = normals / np.linalg.norm(normals, axis=1, keepdims=True)
    height, width = light.shape[:2]
    weighted = light.astype(np.float64) * pixel_solid_angles(height, width)[:, None, None]
    cosine = np.maximum(normals @ sphere(height).reshape(-1, 3).T, 0)
    return cosine @ weighted.reshape(-1, 3)


def relative(made: np.ndarray, wanted: np.ndarray) -> float:
    """Relative RMSE."""
    return float(np.sqrt(((made - wanted) ** 2).mean()) / wanted.mean())
