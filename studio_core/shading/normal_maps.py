"""Normal maps: what a picture says of the way a surface is turned, and how far light is looked at for it.

A picture under `NORMAL` holds unit normals n of the tangent frame (`scene.tangents`: x along u, y along v) as
t = (n + 1) / 2, green up as in glTF; the value of the same name is its strength, which multiplies x and y
before n is made unit again (pixels do so with the mean that they read, `kernels.relief.strengthened`).
Vertices know how their light changes with the normal (`LayerRadiance.tilts`): as a sum of x, y and 1 − z,
the functions whose sum with a constant Lambert's light is until some of it sets. Being linear in texels, it
may be averaged over mip levels as it stands, and so over what a pixel covers.

The changes are differences between normals that lie as steep as those of the picture: `slope`, `REACH` times
the root mean square of its slopes, in whole steps of √2, so that a slider of the strength seldom asks for
other light sums.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from studio_core.scene.geometry import Image, Texture
from studio_core.scene.nodes import Material

F32 = npt.NDArray[np.float32]

NORMAL = "normal"
"""Name of the picture, and of the number that tells its strength."""
STRONGEST = 10.0
LOWEST = 0.05
"""Smallest z of a texel: steeper ones are as steep."""
REACH = 1.2
FLATTEST, STEEPEST = 1 / 64, 1.0
"""Slopes between which light is looked at."""
FLAT = 1 / 128
"""Pictures whose mean slope is less are flat: rounding to 8 bits makes more than half of that."""
_ENOUGH = 1 << 20  # texels for the mean of the slopes


def normal_texture(material: Material) -> Texture | None:
    """The normal map that acts; none where the surface shows a photograph, or at strength 0."""
    texture = material.textures.get(NORMAL)
    if texture is None or material.catches or strength(material) == 0 or texture.image.pixels.shape[2] < 3:
        return None
    return texture


def strength(material: Material) -> float:
    """How much the picture's slopes are multiplied by."""
    value = material.values.get(NORMAL, 1.0)
    if isinstance(value, str | tuple) or not math.isfinite(value):
        return 1.0
    return min(max(float(value), -STRONGEST), STRONGEST)


def unit_normals(image: Image, strong: float = 1.0) -> F32:
    """(H, W, 3) unit normals, rows as the picture's; 8 bits are plain numbers whatever it says."""
    pixels = image.pixels[..., :3]
    made = pixels.astype(np.float32) * np.float32(2 / 255 if pixels.dtype == np.uint8 else 2) - np.float32(1)
    np.maximum(made[..., 2], np.float32(LOWEST), out=made[..., 2])
    made[..., :2] *= np.float32(strong)
    made /= np.sqrt((made * made).sum(axis=2, keepdims=True))
    return made


def of_heights(image: Image, high: float) -> Image:
    """The normal map of a picture of heights (its first channel): white is `high` widths of it above black.

    Slopes are central differences; the picture is repeated.
    """
    pixels = image.pixels[..., 0].astype(np.float32)
    heights = pixels * np.float32(high * pixels.shape[1] / (255 if image.pixels.dtype == np.uint8 else 1))
    across = (np.roll(heights, -1, axis=1) - np.roll(heights, 1, axis=1)) / 2
    down = (np.roll(heights, -1, axis=0) - np.roll(heights, 1, axis=0)) / 2
    normals = np.stack([-across, down, np.ones_like(across)], axis=2)
    normals /= np.sqrt((normals * normals).sum(axis=2, keepdims=True))
    return Image(np.rint((normals + 1) * np.float32(127.5)).astype(np.uint8), "data")


def components(image: Image) -> F32:
    """(H, W, 3) x, y and 1 − z in the picture's own frame at strength 1, rows from v = 0 up."""
    made = np.ascontiguousarray(unit_normals(image)[::-1])
    made[..., 2] = np.float32(1) - made[..., 2]
    return made


def turn(texture: Texture) -> tuple[float, float, float, float]:
    """(p, q, r, s): (x', y') in the picture's frame is x = p x' + q y', y = r x' + s y' on the surface.

    A picture may lie turned, and mirrored by a negative scale.
    """
    angle = math.radians(texture.rotation)
    across, up = (math.copysign(1, scale) for scale in texture.scale)
    return across * math.cos(angle), -up * math.sin(angle), across * math.sin(angle), up * math.cos(angle)


def mean_slope(image: Image) -> float:
    """Root mean square of the slope √(x² + y²) / z over the picture, or over so many of its texels."""
    step = max(1, math.isqrt(image.pixels.shape[0] * image.pixels.shape[1] // _ENOUGH))
    normals = unit_normals(Image(image.pixels[::step, ::step], "data")).astype(np.float64)
    return float(np.sqrt(((normals[..., :2] / normals[..., 2:]) ** 2).sum(axis=2).mean()))


def slope_of(material: Material, mean: Callable[[Image], float] = mean_slope) -> float:
    """The slope at which light is looked at for a material's normal map; 0 where none acts."""
    texture = normal_texture(material)
    if texture is None or (own := mean(texture.image)) < FLAT:
        return 0.0
    found = max(REACH * abs(strength(material)) * own, FLATTEST)
    stepped = math.exp2(round(2 * math.log2(found)) / 2)
    return min(max(stepped, FLATTEST), STEEPEST)


def normals_at(texture: Texture, strong: float, uvs: F32) -> F32:
    """(P, 3) unit normals of the finest level at texture coordinates (P, 2): bilinear, repeated."""
    texels = unit_normals(texture.image, strong)[::-1]
    height, width = texels.shape[:2]
    at = texture.placed(uvs).astype(np.float64)
    x, y = at[:, 0] * width - 0.5, at[:, 1] * height - 0.5
    x0, y0 = np.floor(x), np.floor(y)
    fx, fy = (x - x0)[:, None], (y - y0)[:, None]
    i, j = x0.astype(np.int64), y0.astype(np.int64)
    left, right, below, above = i % width, (i + 1) % width, j % height, (j + 1) % height
    low = texels[below, left] * (1 - fx) + texels[below, right] * fx
    high = texels[above, left] * (1 - fx) + texels[above, right] * fx
    made = low * (1 - fy) + high * fy
    made[:, :2] = made[:, :2] @ np.array(turn(texture)).reshape(2, 2).T
    return np.asarray(made / np.linalg.norm(made, axis=1, keepdims=True), np.float32)


__all__ = [
    "NORMAL",
    "REACH",
    "STRONGEST",
    "components",
    "mean_slope",
    "normal_texture",
    "normals_at",
    "of_heights",
    "slope_of",
    "strength",
    "turn",
    "unit_normals",
]
