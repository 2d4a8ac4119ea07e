"""`residual`: equation 6 of the paper for every pixel, f_r + s(P) · H under each lamp, shadows traced.

    B(P) = Σ_lamps V L (f_r n·l + s(P) · H)

Point, spot and directional lamps light every hit of the picture by itself (`shading.pixel_lamps`), at its own
normal, half vector and texel. The environment and area lamps, of which the paper has none, are summed at the
shading vertices by brute force, E_H among the terms. Any material may stand beside captured ones: all of them
are sums of coloured terms.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from studio_core.contract import Services
from studio_core.params import param
from studio_core.scene.diff import Aspect
from studio_core.shading.artifacts import Casters, Hits, Lighting, Radiance, Shapes, Surfaces
from studio_core.shading.brute_force import VisibilityBits, all_points, environment_layer, lamp_layer
from studio_core.shading.frame import Frame
from studio_core.shading.job import Job
from studio_core.shading.pipeline import Inputs
from studio_core.shading.pixel_lamps import NEEDS, PixelLampsMaker
from studio_core.shading.primary import visible_vertices
from studio_core.shading.stages import SurfaceParams, common_stages


@dataclass(frozen=True)
class Params(SurfaceParams):
    """Parameters of the residual backend."""

    directions: str = param(
        "4096",
        "Directions",
        "How many directions the environment's light comes from",
        choices=tuple(str(1 << level) for level in range(10, 18)),
    )
    lamp_samples: int = param(64, "Lamp samples", "Shadow rays to an area lamp", low=1, high=256)


class ResidualStage:
    """Layers at the vertices, and lamps for every pixel."""

    needs: tuple[type, ...] = NEEDS
    gives = Radiance
    dirtied_by = Aspect.QUALITY

    def __init__(self, services: Services) -> None:
        self._workers = services.workers
        self._lamps = PixelLampsMaker(services)
        self._bits: VisibilityBits | None = None

    def run(self, frame: Frame, inputs: Inputs, job: Job) -> Radiance:
        """All layers; raises Cancelled at checkpoints."""
        surfaces, lighting, hits = inputs[Surfaces], inputs[Lighting], inputs[Hits]
        shapes, shadow = inputs[Shapes], inputs[Casters].shadow
        mesh, workers = surfaces.mesh, self._workers
        seen = visible_vertices(surfaces, hits)
        points, eye = all_points(mesh, seen), np.asarray(frame.view.transform.translation, np.float64)
        if self._bits is None or not self._bits.belongs_to(mesh, shadow):
            self._bits = VisibilityBits(mesh, shadow, workers)
        made = {
            lamp.node: lamp_layer(
                mesh, shapes, shadow, lamp, eye, points, frame.params.lamp_samples, workers, job
            )
            for lamp in lighting.lamps
        }
        level = int(frame.params.directions).bit_length() - 1
        if lighting.environment is not None:
            made[lighting.environment.id] = environment_layer(
                mesh, shapes, lighting, self._bits, eye, points, level, workers, job
            )
        counts = {"rays": self._bits.rays, "vertices_shaded": len(points)}
        return self._lamps(frame, inputs, Radiance(surfaces, hits, made, seen, 1 << level, True, counts))


class Residual:
    """See the module; satisfies `studio_core.contract.ShadingBackend`."""

    id = "residual"
    label = "Captured (lamps in every pixel)"
    Params = Params

    def stages(self, services: Services) -> Sequence[Any]:
        """Fresh stages, the last gives Radiance."""
        return [*common_stages(services), ResidualStage(services)]


BACKEND = Residual()
