"""The stages every backend shares: surfaces, ray casters and BRDF shapes, and the list of them all."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from studio_core.contract import Services
from studio_core.scene.diff import Aspect
from studio_core.shading.artifacts import Shapes, Surfaces
from studio_core.shading.frame import Frame
from studio_core.shading.job import Job
from studio_core.shading.lighting import LightingStage
from studio_core.shading.materials import same_shapes
from studio_core.shading.pipeline import Inputs
from studio_core.shading.refinement import Adaptive, AdaptiveSurfaceStage, LocatedPrimaryStage
from studio_core.shading.surfaces import BODIES, CasterStage, SurfaceParams, SurfaceStage
from studio_core.shading.varying import ShapeTable


class ShapeStage:
    """BRDF kernels and their parameters; a change of colour alone gives the previous one back."""

    needs: tuple[type, ...] = (Surfaces,)
    gives = Shapes
    dirtied_by = Aspect.MATERIAL | BODIES

    def __init__(self, services: Services) -> None:
        self._table = ShapeTable(services.registry)

    def run(self, frame: Frame, inputs: Inputs, job: Job) -> Shapes:
        """The table for the materials and vertices of `Surfaces`."""
        surfaces = inputs[Surfaces]
        made = self._table(frame.scene, surfaces.materials, surfaces.mesh)
        previous: Shapes | None = inputs.previous
        if previous is not None and same_shapes(previous, made) and previous.problems == made.problems:
            return previous
        return made


def common_stages(services: Services, adaptive: Callable[[Any], Adaptive | None] | None = None) -> list[Any]:
    """Surfaces, casters, shapes, lighting, hits: the first stages of every backend.

    `adaptive` tells from the backend's parameters how far the meshes are refined where light needs it
    (None: not at all); without it, never.
    """
    return [
        SurfaceStage() if adaptive is None else AdaptiveSurfaceStage(services, adaptive),
        CasterStage(),
        ShapeStage(services),
        LightingStage(services),
        LocatedPrimaryStage(services),
    ]


__all__ = [
    "Adaptive",
    "AdaptiveSurfaceStage",
    "CasterStage",
    "LocatedPrimaryStage",
    "ShapeStage",
    "SurfaceParams",
    "SurfaceStage",
    "common_stages",
]
