"""Tangent frames of a ball's or a flat sample's texels, and vectors turned into them (section 4.4).

With polar angle φ = arcsin n_y and azimuth θ = arccos(n_x / cos φ) (the paper prints arccos(n_x) / cos
φ). Here z points to the camera and the tangent to the right, so that the frame is right-handed: t, b, n =
x, y, z in the middle.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from studio_plugins.residual.samples import F32


def tangent_frames(normals: npt.ArrayLike) -> F32:
    """(..., 3, 3) rows tangent, binormal, normal of unit normals (..., 3); at the poles the tangent is x."""
    n = np.asarray(normals, np.float64)
    ring = np.hypot(n[..., 0], n[..., 2])  # cos φ
    at_pole = ring < 1e-9
    safe = np.where(at_pole, 1.0, ring)
    cosine, sine = n[..., 0] / safe, np.where(at_pole, 1.0, n[..., 2] / safe)  # of θ
    tangent = np.stack([sine, np.zeros_like(sine), np.where(at_pole, 0.0, -cosine)], axis=-1)
    binormal = np.cross(n, tangent)
    return np.stack([tangent, binormal, n], axis=-2).astype(np.float32)


def to_tangent(vectors: npt.ArrayLike, frames: npt.ArrayLike) -> F32:
    """(..., 3) the same vectors by their parts along tangent, binormal and normal."""
    made = np.einsum("...ij,...j->...i", np.asarray(frames), np.asarray(vectors))
    return np.asarray(made, np.float32)
