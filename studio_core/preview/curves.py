"""A material's reflectance as curves: its lobe in the plane of incidence, its albedo against the angle.

Both are of the material's values as they are; `averaged` ones stand for pictures that lie on it.
"""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from studio_core.brdfs.albedo import albedo_table, flat_coefficients
from studio_core.brdfs.calls import evaluate
from studio_core.preview.fan import Fan, fan
from studio_core.scene.geometry import Image
from studio_core.shading.materials import Resolved

F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]

STEEPEST = 89.5
"""Degrees beyond which nothing is seen of a surface."""
_GRADED = np.geomspace(1e-3, 30, 64)  # degrees beside the mirror direction: sharp lobes are drawn whole


def lobe(resolved: Resolved, incidence: float, *, cosine: bool = True) -> tuple[F64, F64]:
    """Angles (N,) in degrees from -90 to 90, and f_r (N, 3) towards them, times their cosine if asked for.

    Light comes from `incidence` degrees to the left of the normal; the mirror direction is at +incidence.
    Angles are rising and lie closer around the mirror direction.
    """
    incidence = min(max(incidence, 0.0), STEEPEST)
    own = np.array([incidence, -incidence])
    every = np.concatenate([np.linspace(-90, 90, 181), incidence + _GRADED, incidence - _GRADED, own])
    angles: F64 = np.unique(every)
    angles = angles[np.abs(angles) <= 90]
    turn = np.radians(angles)
    wi = np.stack([np.sin(turn), np.zeros_like(turn), np.cos(turn)], axis=1)
    wi[:, 2] = np.maximum(wi[:, 2], 1e-9)
    toward = np.radians(incidence)
    wo = np.array([-np.sin(toward), 0.0, np.cos(toward)])  # the other way round is the same
    terms = evaluate(resolved.brdf, _shape(resolved), wo, wi).astype(np.float64)
    made = terms @ flat_coefficients(resolved.brdf, resolved.values)
    return angles, made * np.cos(turn)[:, None] if cosine else made


def averaged(resolved: Resolved, mean: Callable[[Image], F64]) -> Resolved:
    """The material as it is on average over its pictures; `mean` gives a picture's linear RGB (3,)."""
    values = dict(resolved.typical(lambda image: float(mean(image)[0])))
    for name, texture in resolved.textures.items():
        colour, value = mean(texture.image), values[name]
        if isinstance(value, tuple):
            red, green, blue = (float(v * c) for v, c in zip(value, colour, strict=True))
            values[name] = (red, green, blue)
        else:
            values[name] = float(value) * float(colour[0])
    return dataclasses.replace(resolved, values=values, textures={}, shaping={})


def albedo(resolved: Resolved, angles: npt.ArrayLike, *, quick: bool = False) -> F64:
    """(A, 3) share of the light from degrees (A,) that comes back in all; at 90° that of nearly 90°.

    Within 0.1 %; `quick` ones, for while a hand drags, within 1 % but for Phong's lobe at grazing angles.
    """
    degrees = np.minimum(np.atleast_1d(np.asarray(angles, np.float64)), STEEPEST)
    if not quick:
        return albedo_table(resolved.brdf, resolved.values, np.radians(degrees))
    shape, rows = _shape(resolved), []
    for angle in degrees:
        own = _fan(float(angle))
        light = evaluate(resolved.brdf, shape, own.wo, own.wi) * (own.wi[:, 2] * own.solid)[:, None]
        rows.append(light.sum(axis=0, dtype=np.float64))
    return np.array(rows) @ flat_coefficients(resolved.brdf, resolved.values)


def _shape(resolved: Resolved) -> F32:
    return np.atleast_1d(np.asarray(resolved.brdf.shape(resolved.values), np.float32))


@functools.lru_cache(maxsize=128)
def _fan(angle: float) -> Fan:
    return fan(float(np.cos(np.radians(angle))))


__all__ = ["STEEPEST", "albedo", "averaged", "lobe"]
