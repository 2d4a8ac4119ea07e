"""`cuts`: the engine of the studio (Iwasaki et al., section V, and what goes beyond it)."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from studio_core.contract import Services
from studio_core.params import param
from studio_core.scene.diff import Changes
from studio_core.scene.nodes import Scene
from studio_core.session import View
from studio_core.shading.frame import Frame
from studio_core.shading.job import Job
from studio_core.shading.pipeline import Pipeline
from studio_core.shading.stages import Adaptive, SurfaceParams, common_stages
from studio_plugins.cuts.focus_stage import FocusStage
from studio_plugins.cuts.light_stage import LightStage
from studio_plugins.cuts.lobes import LobeTable
from studio_plugins.cuts.quality import quality
from studio_plugins.cuts.radiance_stage import RadianceStage
from studio_plugins.cuts.visibility_stage import EXACT, PAPER, VisibilityStage


@dataclass(frozen=True)
class Params(SurfaceParams):
    """Parameters of the cuts."""

    quality: float = param(
        0.5, "Quality", "From faster to truer: how far sums and shading meshes are refined", low=0.0, high=1.0
    )
    refine: bool = param(
        True, "Refine at rest", "Split the shading mesh where shadows and highlights need it"
    )
    directions: str = param(
        "32768",
        "Directions",
        "How many directions light comes from; more shows sharper shadows",
        choices=tuple(str(1 << level) for level in range(10, 18)),
        advanced=True,
    )
    method: str = param(
        EXACT,
        "Method",
        "exact: visibility traced; svc-vcf: the paper's precomputed shadow fields, for comparison",
        choices=(EXACT, PAPER),
        advanced=True,
    )
    shells: int = param(
        32,
        "Shells",
        "Of the paper's shadow fields, and cells along a side of each",
        low=4,
        high=128,
        advanced=True,
    )
    lamp_samples: int = param(
        64, "Lamp samples", "Shadow rays to an area lamp", low=1, high=256, advanced=True
    )
    pixel_lamps: bool = param(
        False,
        "Lamps in every pixel",
        "Point, spot and directional lamps light every pixel by itself: slower, with true highlights",
        advanced=True,
    )
    everywhere: bool = param(
        False, "Hidden places too", "Also light what the camera does not see", advanced=True
    )


def _adaptive(params: Params) -> Adaptive | None:
    if not params.refine or params.method != EXACT:
        return None
    return Adaptive(target=quality(params.quality).picture)


class Cuts:
    """See the module; satisfies `studio_core.contract.ShadingBackend`."""

    id = "cuts"
    label = "Cuts (fast)"
    Params = Params

    def stages(self, services: Services) -> Sequence[Any]:
        """Fresh stages, the last gives Radiance."""
        lobes = LobeTable()
        return [
            *common_stages(services, _adaptive),
            VisibilityStage(services),
            LightStage(services, lobes),
            FocusStage(services, lobes),
            RadianceStage(services),
        ]

    def precompute(
        self, scene: Scene, view: View, params: Any, services: Services, job: Job
    ) -> Mapping[str, int | float]:
        """Brings what is kept on disk for a scene to completeness: light over directions, visibility.

        `vertices_traced` is 0 where all was there already.
        """
        frame = Frame(scene, view, dataclasses.replace(params, refine=False), 1)
        stages = self.stages(services)
        Pipeline(stages).update(frame, Changes(), job)
        visibility = next(stage for stage in stages if isinstance(stage, VisibilityStage))
        return visibility.complete(frame, job)


BACKEND = Cuts()
