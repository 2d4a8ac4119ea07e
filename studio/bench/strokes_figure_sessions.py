"""What is painted in each of the paper's figures, and what is claimed of it."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from studio.bench import strokes_figure_scenes as scenes
from studio.bench.strokes_figures import Act, Played, Session


def _any(played: Played) -> dict[str, float]:
    return {}

FIGURES: Mapping[int, Session] = {
    14: Session(
        "Painting in shadow, under light between surfaces",
        scenes.shadow,
        (
            Act(({"colour": [0.11, 0.12, 0.05], "shading": True, "path": [[0.36, 0.62], [0.42, 0.64]], "brush": {"size": 0.07}},), rounds=3),
            Act(({"colour": [0.2, 0.24, 0.4], "shading": True, "path": [[0.62, 0.8], [0.75, 0.84]], "brush": {"size": 0.1}},), rounds=3),
        ),
        _any,
        {},
        bounces=3,
    ),
    15: Session(
        "Solving again over bounces",
        scenes.closed,
        tuple(
            Act(({"colour": [0.15, 0.19, 0.24], "shading": True, "path": [[0.35, 0.3], [0.65, 0.27]], "brush": {"size": 0.14}},), rounds=rounds, afresh=True)
            for rounds in (1, 2, 3, 4)
        ),
        _any,
        {},
        bounces=8,
    ),
    16: Session(
        "Sketching shine",
        scenes.still_life,
        (
            Act(({"colour": [0.07, 0.14, 0.11], "path": [[0.22, 0.45], [0.22, 0.5]], "brush": {"size": 0.08}},)),
            Act(({"colour": [0.9, 0.7, 0.1], "path": [[0.5, 0.45]], "brush": {"size": 0.06}},)),
            Act(({"colour": [0.9, 0.9, 0.9], "path": [[0.845, 0.335]], "brush": {"size": 0.08}},)),
            Act(({"tool": "sharpen", "radius": 0.04, "amount": 2.0, "path": [[0.845, 0.335]], "brush": {"size": 0.3}},)),
        ),
        _any,
        {},
    ),
    17: Session(
        "Painting with light from matte walls",
        scenes.corner,
        (
            Act(({"colour": [0.34, 0.39, 0.30], "shading": True, "indirect": True, "path": [[0.2, 0.85], [0.3, 0.8]], "brush": {"size": 0.15}},)),
        ),
        _any,
        {},
        bounces=3,
    ),
    18: Session(
        "Painting what shows in a glossy floor",
        scenes.glossy_corner,
        (
            Act(({"colour": [0.25, 0.14, 0.05], "indirect": True, "path": [[0.84, 0.85], [0.9, 0.9]], "brush": {"size": 0.15}},)),
        ),
        _any,
        {},
        bounces=3,
    ),
    19: Session(
        "A caustic, two fixates, and a golden ring",
        scenes.ring,
        (
            Act(({"colour": [0.6, 0.6, 0.6], "indirect": True, "path": [[0.46, 0.55], [0.5, 0.6]], "brush": {"size": 0.06}},)),
        ),
        _any,
        {},
        bounces=3,
    ),
    20: Session(
        "A highlight under a captured sky",
        scenes.pot,
        (Act(({"colour": [1.0, 1.0, 1.0], "path": [[0.42, 0.63]], "brush": {"size": 0.05}},)),),
        _any,
        {},
    ),
    21: Session(
        "A change that keeps grain and bumps",
        scenes.bricks,
        (Act(({"colour": [0.8, 0.6, 0.1], "path": [[0.5, 0.4]], "brush": {"size": 0.1}, "reach": {"near": 4}},)),),
        _any,
        {},
    ),
    22: Session("Unsharp stylisation", scenes.furnished, (Act(stylise=1.5),), _any, {}, bounces=3),
}

__all__ = ["FIGURES"]
