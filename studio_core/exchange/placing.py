"""Maps of texture coordinates as other programs compose them, and as a `Texture` has them."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from studio_core.scene.geometry import Image, Texture

Affine = npt.NDArray[np.float64]
"""(3, 3), of columns (u, v, 1)."""
_SMALL = 1e-9


def scaling(u: float, v: float) -> Affine:
    """uv times these."""
    return np.diag([u, v, 1.0])


def moving(u: float, v: float) -> Affine:
    """uv plus these."""
    made = np.eye(3)
    made[:2, 2] = u, v
    return made


def turning(degrees: float) -> Affine:
    """(c u + s v, c v − s u): the picture turns counter-clockwise."""
    c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    return np.array([[c, s, 0], [-s, c, 0], [0, 0, 1.0]])


def of(texture: Texture) -> Affine:
    """How a picture lies."""
    return np.array([texture.affine[:3], texture.affine[3:], (0, 0, 1)])


def laid(image: Image, affine: Affine) -> tuple[Texture, bool]:
    """The picture laid so, and whether that is exact: what is sheared is laid unturned."""
    (a, b, t), (c, d, s) = affine[:2].tolist()
    size = float(np.abs(affine[:2, :2]).max())
    if max(abs(b), abs(c)) <= _SMALL * size:
        return Texture(image, (a, d), (t, s)), True
    if max(abs(a), abs(d)) <= _SMALL * size:
        return Texture(image, (b, -c), (t, s), 90.0), True
    square = -b * c / (a * d) if a * d != 0 else 0.0
    if square <= 0:
        return Texture(image, (math.hypot(a, c), math.hypot(b, d)), (t, s)), False
    tangent = math.copysign(math.sqrt(square), b / a)
    angle = math.atan(tangent)
    aspect, cosine = b / a / tangent, math.cos(angle)
    made = Texture(image, (a / cosine, d / (aspect * cosine)), (t, s), math.degrees(angle), aspect)
    return made, bool(np.abs(of(made) - affine).max() <= 1e-6 * max(size, 1.0))
