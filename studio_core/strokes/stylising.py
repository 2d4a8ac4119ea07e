"""Sharpening the light of a whole scene: how much, and the scene that it leads to."""

from __future__ import annotations

from dataclasses import dataclass

from studio_core.contract import Services, StrokeSolver
from studio_core.params import param
from studio_core.scene.nodes import Scene
from studio_core.session import View
from studio_core.shading.job import Job
from studio_core.strokes.session import Easel
from studio_core.strokes.solution import Solution


@dataclass(frozen=True)
class Stylising:
    """What can be chosen."""

    amount: float = param(
        1.0,
        "Amount",
        "How much stronger differences of light within each object become; below 0 they become weaker",
        low=-1.0,
        high=4.0,
    )


def stylised(
    scene: Scene,
    view: View,
    chosen: Stylising,
    solver: StrokeSolver,
    easel: Easel,
    services: Services,
    job: Job,
) -> Solution:
    """Paint on all objects under which the light that a view shows, and all other, is sharper."""
    easel.picture(scene, view, job)
    return solver.open(services).stylise(scene, chosen.amount, easel.lit(), job)


__all__ = ["Stylising", "stylised"]
