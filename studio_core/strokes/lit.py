"""What a pipeline has made, as solvers of strokes need it."""

from __future__ import annotations

from studio_core.scene.diff import Aspect, diff
from studio_core.scene.nodes import Scene
from studio_core.shading.artifacts import Casters, Hits, Indirect, Lighting, Shapes, Surfaces
from studio_core.shading.indirect import UnrefinedShapes
from studio_core.shading.pipeline import Pipeline
from studio_core.strokes.solution import Lit

_HARMLESS = Aspect.NAME | Aspect.MATERIAL | Aspect.STROKES
"""What may differ between the scene that was lit and the one that strokes are solved in."""


def lit_of(pipeline: Pipeline, scene: Scene, unrefined: UnrefinedShapes) -> Lit | None:
    """For strokes on `scene`; None where the pipeline has not come to it, or makes no such artifacts.

    `scene` may have other paint and materials than the picture; shapes are those of the picture's.
    """
    frame = pipeline.frame
    if frame is None or diff(frame.scene, scene).aspects & ~_HARMLESS:
        return None
    surfaces, casters = pipeline.settled(Surfaces), pipeline.settled(Casters)
    shapes, lighting = pipeline.settled(Shapes), pipeline.settled(Lighting)
    if surfaces is None or casters is None or shapes is None or lighting is None:
        return None
    indirect = pipeline.artifact(Indirect) if frame.bounced is not None else None
    if indirect is not None and indirect.surfaces is not surfaces.unrefined:
        indirect = None
    late = indirect is None or pipeline.pending(Indirect) & ~_HARMLESS
    if frame.bounced is not None and late and not pipeline.is_settled(Indirect):
        return None
    shapes = unrefined(frame.scene, surfaces, shapes)
    return Lit(surfaces, casters, shapes, lighting, pipeline.settled(Hits), indirect)


__all__ = ["lit_of"]
