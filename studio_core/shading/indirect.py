"""Light that goes on between surfaces, over any backend: a stage that runs the stages of a chosen method.

The method's stages are a pipeline inside the pipeline. They see unrefined meshes alone, so that refinement,
which follows shadows of the light that comes straight from lamps and sky, disturbs none of their work; what
is handed to them counts as new only where it is another object. When nothing moves, a round of refinement
and a round of a method that can do better are the same round: neither waits for the other.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from studio_core.contract import IndirectMethod, Services
from studio_core.kernels.facing import mark_faces, mark_vertices
from studio_core.scene.diff import Aspect, Changes, diff, view_changed
from studio_core.scene.nodes import Scene
from studio_core.shading.artifacts import (
    Casters,
    DirectRadiance,
    Hits,
    Indirect,
    Lighting,
    Radiance,
    Receivers,
    Shapes,
    Surfaces,
)
from studio_core.shading.combining import CombineStage, DirectStage
from studio_core.shading.frame import Frame
from studio_core.shading.job import Job
from studio_core.shading.job_parts import InnerJob
from studio_core.shading.kept import Kept
from studio_core.shading.materials import same_shapes
from studio_core.shading.pipeline import Inputs, Pipeline, Stage, StageRun
from studio_core.shading.primary import eye_in
from studio_core.shading.varying import ShapeTable

Bools = npt.NDArray[np.bool_]
I32 = npt.NDArray[np.int32]

KIND = "indirect"
NEEDS: tuple[type, ...] = (Surfaces, Casters, Shapes, Lighting, Hits, DirectRadiance)
HANDED: tuple[type, ...] = (Surfaces, Casters, Shapes, Lighting, Receivers, DirectRadiance)


def with_indirect(stages: Sequence[Stage], services: Services) -> list[Any]:
    """A backend's stages, the last of which gives Radiance, with light between surfaces where asked for.

    Stages that do not make what methods need come back as they are.
    """
    *before, last = stages
    if last.gives is not Radiance or not {*NEEDS} - {DirectRadiance} <= {stage.gives for stage in before}:
        return list(stages)
    return [*before, DirectStage(last), IndirectStage(services), CombineStage()]


class IndirectStage:
    """Light between surfaces by the method that the frame names; None where it names none.

    What a method keeps stays until another one is chosen.
    """

    needs: tuple[type, ...] = NEEDS
    gives = Indirect
    dirtied_by = ~(Aspect.NAME | Aspect.STROKES)

    def __init__(self, services: Services) -> None:
        self._services = services
        self._handing = Handing(services)
        self._method = ""
        self._inner: Pipeline | None = None
        self._marked: Frame | None = None  # up to which changes are known to the method's stages

    def run(self, frame: Frame, inputs: Inputs, job: Job) -> Indirect | None:
        """What the method's last stage gives, after one round."""
        choice = frame.bounced
        if choice is None:
            return None
        if self._inner is None or self._method != choice.method:
            self._inner = self._marked = None
            method: IndirectMethod = self._services.registry.get(KIND, choice.method)
            self._inner, self._method = Pipeline(method.stages(self._services), HANDED), choice.method
        inner, handed, within = self._inner, self._handing(frame, inputs), InnerJob(job)
        made: Indirect
        if inputs.round:
            made = inner.refine(frame, within, handed)
        else:
            changes = changed_between(self._marked, frame)
            self._marked = frame
            if not frame.moving and job.listened_to and _strange(inner.artifact(Indirect), inputs[Surfaces]):
                job.publish(None)  # the first time takes longest: meanwhile direct light is seen
            made = inner.start(frame, changes, within, handed)
        return made

    def again(self, frame: Frame, made: Mapping[type, Any], rounds: int, job: Job) -> bool:
        """Whether the method can do better."""
        if frame.bounced is None or self._inner is None:
            return False
        self._inner.rounds = rounds
        return self._inner.wants_more(frame, InnerJob(job))

    def abandon(self) -> None:
        """The method's stages forget the round under way."""
        if self._inner is not None:
            self._inner.abandon()

    def complete(self, frame: Frame, job: Job) -> None:
        """What the method can do in idle time."""
        if frame.bounced is not None and self._inner is not None:
            self._inner.complete(frame, InnerJob(job))

    @property
    def report(self) -> list[StageRun]:
        """What the method's stages did last, as `Pipeline.report`."""
        return self._inner.report if self._inner is not None else []


def changed_between(before: Frame | None, now: Frame) -> Changes:
    """What a method's stages must know; nothing where there was no frame: they begin with everything."""
    if before is None:
        return Changes()
    changes = diff(before.scene, now.scene)
    if before.view != now.view or before.moving != now.moving:
        changes |= view_changed(Aspect.VIEW)
    if before.bounced != now.bounced:
        changes |= view_changed(Aspect.QUALITY | Aspect.INDIRECT)
    return changes


def _strange(before: Indirect | None, surfaces: Surfaces) -> bool:
    """Whether nothing of what is lit was there before."""
    return before is None or {*before.surfaces.nodes}.isdisjoint(surfaces.nodes)


class Handing:
    """What a method's stages get, made from what the backend's stages gave; the same while it is equal."""

    def __init__(self, services: Services) -> None:
        self._shapes = UnrefinedShapes(services)
        self._receivers: Receivers | None = None
        self._roots: Kept[I32] = Kept()

    def __call__(self, frame: Frame, inputs: Inputs) -> dict[type, Any]:
        """By kind: `HANDED`."""
        return {
            Surfaces: inputs[Surfaces].unrefined,
            Casters: inputs[Casters],
            Shapes: self._shapes(frame.scene, inputs[Surfaces], inputs[Shapes]),
            Lighting: inputs[Lighting],
            Receivers: self._seen(frame, inputs),
            DirectRadiance: inputs[DirectRadiance],
        }

    def _seen(self, frame: Frame, inputs: Inputs) -> Receivers:
        surfaces, known = inputs[Surfaces], self._receivers
        eye = np.asarray(frame.view.transform.translation, np.float64)
        if getattr(frame.params, "everywhere", False):
            seen = np.ones(len(surfaces.unrefined.mesh), np.bool_)
        else:
            tree = surfaces.tree
            roots = None if tree is None else self._roots(tree.origins, tree)
            seen = unrefined_seen(surfaces, inputs[Hits], roots)
        if known is None or not (np.array_equal(known.seen, seen) and np.array_equal(known.eye, eye)):
            known = self._receivers = Receivers(seen, eye)
        return known


class UnrefinedShapes:
    """Rows of the vertices that there are without refinement; the same while they are equal."""

    def __init__(self, services: Services) -> None:
        self._table = ShapeTable(services.registry)
        self._known: Shapes | None = None
        self._own: Kept[Shapes] = Kept()

    def __call__(self, scene: Scene, surfaces: Surfaces, shapes: Shapes) -> Shapes:
        """From the rows of what may be refined."""
        base, table = surfaces.base, self._table
        if shapes.row is not None and base is not None:
            shapes = self._own(lambda: table(scene, base.materials, base.mesh), shapes, base)
        known = self._known
        if known is None or (known is not shapes and not same_shapes(known, shapes)):
            known = self._known = shapes
        return known


def unrefined_seen(surfaces: Surfaces, hits: Hits, origins: I32 | None) -> Bools:
    """(V,) the corners of every unrefined face that a sample sees a part of, on the side it sees.

    `origins` are those of `surfaces.tree`; None where nothing is refined.
    """
    mesh = surfaces.unrefined.mesh
    touched = np.zeros(len(surfaces.mesh.faces), np.bool_)
    layers = [hits] if hits.edges is None else [hits, hits.edges.hits]
    for layer in layers:
        mark_faces(layer.face, touched)
        layers.extend(rest for _, rest in layer.behind)
    if origins is not None:
        finer, touched = touched, np.zeros(len(mesh.faces), np.bool_)
        touched[origins[finer]] = True
    seen = np.zeros(len(mesh), np.bool_)
    mark_vertices(touched, mesh.positions, mesh.faces, mesh.back_faces, eye_in(surfaces, hits.view), seen)
    return seen


__all__ = ["KIND", "IndirectStage", "UnrefinedShapes", "changed_between", "unrefined_seen", "with_indirect"]
