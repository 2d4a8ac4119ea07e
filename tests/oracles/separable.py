"""Means of reflectance kernels over pairs of cells, and what their products come to: slow and plain."""

from __future__ import annotations

import numpy as np

from studio_core.brdfs.calls import evaluate
from studio_core.contract import Brdf
from studio_core.transport.cells import CELLS, PARTS, RINGS, cell_projected_angles
from studio_core.transport.separable import Separated


def directions_in(cell: int, count: int) -> tuple[np.ndarray, np.ndarray]:
    """(count², 3) regular in angle over a cell, and weights sinθ cosθ, 1 in sum."""
    ring, part = divmod(cell, PARTS)
    inside = (np.arange(count) + 0.5) / count
    theta, phi = np.meshgrid(
        (ring + inside) * np.pi / 2 / RINGS, (part + inside) * 2 * np.pi / PARTS, indexing="ij"
    )
    made = np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], -1)
    weight = (np.sin(theta) * np.cos(theta)).ravel()
    return made.reshape(-1, 3).astype(np.float32), weight / weight.sum()


def cell_mean(brdf: Brdf, shape: np.ndarray, light: int, view: int, count: int) -> np.ndarray:
    """(T,) the cosine-weighted mean over both cells."""
    wi, weights = directions_in(light, count)
    wo, others = directions_in(view, count)
    rows = [weights @ evaluate(brdf, shape, o, wi).astype(np.float64) for o in wo]
    return np.asarray(others @ np.array(rows))


def made(separated: Separated, row: int, term: int, clamped: bool = True) -> np.ndarray:
    """(CELLS of light, CELLS of view) what a term of a row was made into."""
    incoming, outgoing, which = separated.functions(row)
    own = which == term
    total = incoming[:, own].astype(np.float64) @ outgoing[:, own].astype(np.float64).T
    total += separated.matte[row, term]
    return np.maximum(total, 0) if clamped and not separated.signed[row, term] else total


def relative_error(found: np.ndarray, true: np.ndarray) -> float:
    """Cosine-weighted over both directions, of matrices (CELLS, CELLS)."""
    w = cell_projected_angles().astype(np.float64)
    return float(np.sqrt((w @ (found - true) ** 2 @ w) / (w @ true**2 @ w)))


def dense_means(brdf: Brdf, shape: np.ndarray, term: int, count: int) -> np.ndarray:
    """(CELLS of light, CELLS of view) for a kernel that turns with the normal: one part of view, turned."""
    made = np.zeros((CELLS, RINGS, PARTS))
    for ring in range(RINGS):
        wo, others = directions_in(ring * PARTS, count)
        for cell in range(CELLS):
            wi, weights = directions_in(cell, count)
            mean = sum(
                w * (weights @ evaluate(brdf, shape, o, wi)[:, term]) for o, w in zip(wo, others, strict=True)
            )
            light, part = divmod(cell, PARTS)
            for turn in range(PARTS):
                made[light * PARTS + (part + turn) % PARTS, ring, turn] = mean
    return made.reshape(CELLS, CELLS)
