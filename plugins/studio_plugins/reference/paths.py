"""`paths`: light between surfaces by path tracing, without bias; what other methods are compared with.

It starts with a few paths a vertex and goes on to as many as asked for, four times as many each time, and
shows every step.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from studio_core.contract import Services
from studio_core.params import param
from studio_core.scene.diff import Aspect
from studio_core.shading.artifacts import (
    Casters,
    Indirect,
    LayerRadiance,
    Lighting,
    Receivers,
    Shapes,
    Surfaces,
)
from studio_core.shading.brute_force import all_points, blank_layer
from studio_core.shading.frame import Frame
from studio_core.shading.job import Job
from studio_core.shading.path_tracing import (
    CONVERGED,
    PathCounts,
    PathSettings,
    bounces_of,
    chosen_points,
    growing,
    indirect_layer,
    mean_layer,
)
from studio_core.shading.path_world import PathWorlds
from studio_core.shading.pipeline import Inputs

IN_HAND = 16
"""Paths a vertex while something moves."""

CONCERNED = Aspect.STRUCTURE | Aspect.MATERIAL | Aspect.LIGHT | Aspect.GAIN | Aspect.QUALITY | Aspect.VIEW


@dataclass(frozen=True)
class Params:
    """Parameters of path tracing."""

    bounces: int = param(3, "Bounces", "How often light goes on from surface to surface", low=1, high=16)
    converged: bool = param(
        False, "Until it settles", f"Follow light until nothing is left to see: {CONVERGED} bounces"
    )
    samples: int = param(
        256,
        "Paths",
        "How many paths every point follows; four times as many halve the noise",
        low=4,
        high=65536,
        scale="log",
    )


class PathStage:
    """Indirect light of the receivers, shown at every step of its samples."""

    needs: tuple[type, ...] = (Surfaces, Casters, Shapes, Lighting, Receivers)
    gives = Indirect
    dirtied_by = CONCERNED

    def __init__(self, services: Services) -> None:
        self._workers = services.workers
        self._worlds = PathWorlds(services.registry)
        self._key: tuple[object, ...] = ()

    def run(self, frame: Frame, inputs: Inputs, job: Job) -> Indirect:
        """All receivers; the previous where nothing differs that light depends on. Raises Cancelled."""
        assert frame.indirect is not None
        params: Params = frame.indirect.params
        surfaces, shapes, receivers = inputs[Surfaces], inputs[Shapes], inputs[Receivers]
        bounces = bounces_of(frame)
        samples = min(IN_HAND, params.samples) if frame.moving else params.samples
        scene = frame.scene
        key = (inputs[Casters], inputs[Lighting], surfaces, shapes, receivers, bounces, samples, scene)
        previous: Indirect | None = inputs.previous
        if previous is not None and _same(self._key, key):
            return previous
        world = self._worlds(scene, surfaces, inputs[Casters], inputs[Lighting])
        points = all_points(surfaces.mesh, receivers.seen)
        some, own = chosen_points(surfaces.mesh, points), shapes.of_points(points)
        counts, parts, done = PathCounts(), list[tuple[LayerRadiance, float]](), 0
        steps = list(growing(samples)) if job.listened_to and not frame.moving else [samples]
        made: Indirect | None = None
        for number, more in enumerate(steps):
            settings = PathSettings(bounces, more, number)
            traced = indirect_layer(
                some, own, receivers.eye, world, settings, self._workers, job, counts=counts
            )
            parts = [(mean_layer([*parts, (traced, float(more))]), float(done + more))]
            done += more
            layer = blank_layer(surfaces.mesh, shapes)
            layer.terms[points], layer.irradiance[points] = parts[0][0].terms, parts[0][0].irradiance
            if layer.tilts is not None and parts[0][0].tilts is not None:
                layer.tilts[points] = parts[0][0].tilts
            told = {"paths": counts.paths, "segments": counts.segments}
            facts = {"paths a vertex": float(done), "bounces": float(bounces)}
            final = done >= params.samples
            made = Indirect(surfaces, layer, receivers.seen, final, told, facts)
            if done < samples:
                job.publish(made)
        assert made is not None
        self._key = key
        return made


def _same(a: tuple[object, ...], b: tuple[object, ...]) -> bool:
    same = (x is y or (isinstance(x, int) and x == y) for x, y in zip(a, b, strict=True))
    return len(a) == len(b) and all(same)


class PathTraced:
    """See the module; satisfies `studio_core.contract.IndirectMethod`."""

    id = "paths"
    label = "Path traced (truth)"
    Params = Params

    def stages(self, services: Services) -> Sequence[Any]:
        """One stage, gives Indirect."""
        return [PathStage(services)]


METHOD = PathTraced()
