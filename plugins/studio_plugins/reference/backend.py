"""`reference`: equation (2) of the cuts paper by brute force, and lamps by traced shadow rays.

Exact up to the number of directions: it goes from 2^10 to the number asked for and shows every step.
Slow on purpose; all other backends are compared with it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from studio_core.contract import Services
from studio_core.params import param
from studio_core.scene.diff import Aspect
from studio_core.shading.artifacts import Casters, Hits, LayerRadiance, Lighting, Radiance, Shapes, Surfaces
from studio_core.shading.brute_force import (
    VisibilityBits,
    all_points,
    environment_layer,
    lamp_layer,
)
from studio_core.shading.frame import Frame
from studio_core.shading.job import Job
from studio_core.shading.pipeline import Inputs
from studio_core.shading.primary import visible_vertices
from studio_core.shading.stages import SurfaceParams, common_stages

STEPS = (10, 12, 15, 17)


@dataclass(frozen=True)
class Params(SurfaceParams):
    """Parameters of the reference."""

    directions: str = param(
        "32768",
        "Directions",
        "How many directions light comes from; more shows sharper shadows",
        choices=tuple(str(1 << level) for level in range(10, 18)),
    )
    quarters: bool = param(
        True, "Split bright directions", "Look at the brightest directions in four parts each", advanced=True
    )
    lamp_samples: int = param(64, "Lamp samples", "Shadow rays to an area lamp or a sun", low=1, high=256)
    everywhere: bool = param(False, "Hidden places too", "Also light what the camera does not see")


class VisibilityStage:
    """Where traced visibility is kept: a new store for new geometry."""

    needs: tuple[type, ...] = (Surfaces, Casters)
    gives = VisibilityBits
    dirtied_by = Aspect.NONE

    def __init__(self, services: Services) -> None:
        self._workers = services.workers

    def run(self, frame: Frame, inputs: Inputs, job: Job) -> VisibilityBits:
        """Empty, it fills as light is summed; the previous one while nothing has moved."""
        mesh, shadow = inputs[Surfaces].mesh, inputs[Casters].shadow
        previous: VisibilityBits | None = inputs.previous
        if previous is not None and previous.belongs_to(mesh, shadow):
            return previous
        return VisibilityBits(mesh, shadow, self._workers)


class ReferenceStage:
    """Radiance by brute force, shown at every step of fineness."""

    needs: tuple[type, ...] = (Surfaces, Casters, Shapes, Lighting, Hits, VisibilityBits)
    gives = Radiance
    dirtied_by = Aspect.QUALITY

    def __init__(self, services: Services) -> None:
        self._workers = services.workers

    def run(self, frame: Frame, inputs: Inputs, job: Job) -> Radiance:
        """All layers; raises Cancelled at checkpoints."""
        surfaces, lighting, params = inputs[Surfaces], inputs[Lighting], frame.params
        hits, shapes, casters = inputs[Hits], inputs[Shapes], inputs[Casters]
        seen = None if params.everywhere else visible_vertices(surfaces, hits)
        points = all_points(surfaces.mesh, seen)
        eye = np.asarray(frame.view.transform.translation, np.float64)
        layers: dict[str, LayerRadiance] = {}
        for lamp in lighting.lamps:
            layers[lamp.node] = lamp_layer(
                surfaces.mesh,
                shapes,
                casters.shadow,
                lamp,
                eye,
                points,
                params.lamp_samples,
                self._workers,
                job,
            )
        valid = np.zeros(len(surfaces.mesh.positions), np.bool_)
        valid[points] = True
        last = int(params.directions).bit_length() - 1
        if lighting.tree is not None:
            last = min(last, lighting.tree.k)  # fewer while a hand turns the light
        steps = STEPS if lighting.environment is not None and job.listened_to else ()
        levels = [*(level for level in steps if level < last), last]
        made: Radiance | None = None
        for level in levels:
            if lighting.environment is not None:
                layers[lighting.environment.id] = environment_layer(
                    surfaces.mesh,
                    shapes,
                    lighting,
                    inputs[VisibilityBits],
                    eye,
                    points,
                    level,
                    self._workers,
                    job,
                    params.quarters,
                )
            final = level == last
            traced = inputs[VisibilityBits]
            counts = {"rays": traced.rays, "packets_below_horizon": traced.skipped}
            made = Radiance(surfaces, hits, dict(layers), valid, 1 << level, final, counts)
            if not final:
                job.publish(made)
        assert made is not None
        return made


class Reference:
    """See the module; satisfies `studio_core.contract.ShadingBackend`."""

    id = "reference"
    label = "Reference (brute force)"
    Params = Params

    def stages(self, services: Services) -> Sequence[Any]:
        """Fresh stages, the last gives Radiance."""
        return [*common_stages(services), VisibilityStage(services), ReferenceStage(services)]


BACKEND = Reference()
