"""Directions that light and reflectance are multiplied at, for one angle of view.

Half vectors lie on rings around the normal whose radii grow by a constant factor, from 2e-5 rad on: lobes of
every sharpness are resolved alike (in log θ they are as wide as their falloff). Directions spread over the
hemisphere take over where lobes are wide. Both sets are combined by the balance heuristic (Veach & Guibas
1995): every direction is weighted by how densely all of them lie there. Nothing depends on the model, so
light that is looked up once serves every material.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]

LEAST = 2e-5  # radians: the innermost disc of half vectors, a fifth of GGX's sharpest α
RINGS = 36
HEIGHTS, TURNS = 8, 16  # of the directions over the hemisphere
_STEP = np.log(np.pi / 2 / LEAST) / RINGS
_AROUND = ((0.01, 4), (0.06, 8), (np.inf, 16))  # half vectors on a ring, by its radius


@dataclass(frozen=True, eq=False)
class Fan:
    """Directions towards light in the shading frame, the view in its xz plane.

    wo (3,); wi (J, 3) unit, z > 0; solid (J,) steradians each stands for. J is the same for all views;
    directions that would lie below the surface have 0.
    """

    wo: F32
    wi: F32
    solid: F32


def fan(cosine: float) -> Fan:
    """The directions for a view at that cosine (0, 1] from the normal."""
    wo = np.array([np.sqrt(max(1 - cosine * cosine, 0.0)), 0.0, cosine])
    half, cell = _HALVES
    toward = half @ wo
    rings = 2 * toward[:, None] * half - wo
    own = 4 * toward * cell
    wi = np.concatenate([rings, _SPREAD[0]])
    solid = np.concatenate([own, _SPREAD[1]])
    usable = np.concatenate([toward > 1e-6, np.ones(len(_SPREAD[0]), bool)]) & (wi[:, 2] > 1e-6)
    wi[~usable] = (0.0, 0.0, 1.0)
    # how densely each set lies at every direction: any positive function would do, this one is smooth
    middle = wi + wo
    middle /= np.linalg.norm(middle, axis=1, keepdims=True)
    flat = np.hypot(middle[:, 0], middle[:, 1])
    angle = np.maximum(np.arctan2(flat, middle[:, 2]), LEAST)
    on_rings = 1 / (4 * (middle @ wo) * angle * np.sin(angle) * _STEP * 2 * np.pi / _AROUND[-1][1])
    over_all = HEIGHTS * TURNS / (2 * np.pi)
    share = on_rings / (on_rings + over_all)
    share[len(rings) :] = 1 - share[len(rings) :]
    solid = np.where(usable, solid * share, 0.0)
    return Fan(wo.astype(np.float32), wi.astype(np.float32), solid.astype(np.float32))


def _halves() -> tuple[F64, F64]:
    """Half vectors (B, 3) and the solid angle (B,) of their cells."""
    vectors, cells = [np.array([[0.0, 0.0, 1.0]])], [np.array([2 * np.pi * (1 - np.cos(LEAST))])]
    edges = LEAST * np.exp(_STEP * np.arange(RINGS + 1))
    for ring, (inner, outer) in enumerate(itertools.pairwise(edges)):
        angle = np.sqrt(inner * outer)
        count = next(many for below, many in _AROUND if angle < below)
        turn = 2 * np.pi * (np.arange(count) + 0.5 * (ring % 2)) / count
        sine = np.sin(angle)
        vectors.append(np.stack([sine * np.cos(turn), sine * np.sin(turn), np.full(count, np.cos(angle))], 1))
        # dω = θ sin θ d(log θ) dφ: equal steps in log θ sum smooth lobes up almost exactly
        cells.append(np.full(count, angle * sine * _STEP * 2 * np.pi / count))
    return np.concatenate(vectors), np.concatenate(cells)


def _spread() -> tuple[F64, F64]:
    """Directions (A, 3) over the hemisphere and their solid angles: Gauss–Legendre in height."""
    nodes, weights = np.polynomial.legendre.leggauss(HEIGHTS)
    rows, solid = [], []
    for row, (node, weight) in enumerate(zip(nodes, weights, strict=True)):
        z = (node + 1) / 2
        turn = 2 * np.pi * (np.arange(TURNS) + 0.5 * (row % 2)) / TURNS
        flat = np.sqrt(1 - z * z)
        rows.append(np.stack([flat * np.cos(turn), flat * np.sin(turn), np.full(TURNS, z)], 1))
        solid.append(np.full(TURNS, np.pi * weight / TURNS))
    return np.concatenate(rows), np.concatenate(solid)


_HALVES = _halves()
_SPREAD = _spread()
DIRECTIONS = len(_HALVES[0]) + len(_SPREAD[0])
"""J of every fan."""

__all__ = ["DIRECTIONS", "Fan", "fan"]
