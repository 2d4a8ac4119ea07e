"""Fits that nobody had to make: any model, basis and table, with texels that differ."""

from __future__ import annotations

import numpy as np

from studio.bench.lab import dome
from studio_plugins.residual.bases import BASES
from studio_plugins.residual.parametric import SHAPES, Parametric
from studio_plugins.residual.reflectance_map import slopes
from studio_plugins.residual.result import ResidualFit
from studio_plugins.residual.shading import Shared
from studio_plugins.residual.tables import NODES, Table

_START = {"ggx": (0.15, 0.4)}


def made_up(
    model: str = "rough-blinn", basis: str = "albedo-half", table: bool = False, size: int = 9
) -> ResidualFit:
    """Of one hue, so that a scene can show it without loss; values stay above 0."""
    rng = np.random.default_rng(size)
    hue = np.array([0.5, 0.35, 0.2])
    count = SHAPES[model]
    start = _START.get(model[-3:], (300.0, 20.0))
    shares = [0.6, *([0.3] if model.startswith("rough-") else []), *[0.15, 0.1][:count]]
    own = Parametric(model, start[:count], np.outer(shares, hue))
    normals = slopes(size)
    nodes = rng.uniform(0, 0.1, (*NODES, 1)) * hue
    coefficients = rng.uniform(-0.02, 0.02, (size, size, BASES[basis].size, 3)).astype(np.float32)
    return ResidualFit(
        Shared(own, Table(nodes.astype(np.float32)) if table else None),
        BASES[basis],
        coefficients,
        np.zeros((size, size), np.uint8),
        normals,
        np.broadcast_to(np.array([0, 0, 1], np.float32), normals.shape),
        dome((-40.0, 0.0, 40.0)),
    )
