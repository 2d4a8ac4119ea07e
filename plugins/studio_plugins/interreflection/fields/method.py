"""The indirect method `fields`: the paper's, as stages."""

from __future__ import annotations

from collections.abc import Sequence

from studio_core.contract import Services
from studio_core.shading.pipeline import Stage
from studio_plugins.interreflection.fields.bounces import BounceStage
from studio_plugins.interreflection.fields.eye import FieldStage
from studio_plugins.interreflection.fields.params import Params


class RadianceFields:
    """See the package; satisfies `studio_core.contract.IndirectMethod`."""

    id = "fields"
    label = "Radiance fields (the paper's)"
    notes = "No reflections within an object, and nothing in between stops light"
    Params = Params

    def stages(self, services: Services) -> Sequence[Stage]:
        """Fresh stages, the last gives `Indirect`."""
        return [BounceStage(services), FieldStage(services)]


METHOD = RadianceFields()
