"""The parameters of lights as a form: dial, lens, kelvin and EV, and the background under its own heading."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import Any

from studio_core.params import ParamInfo, defaults
from studio_core.scene.nodes import Environment, Light, Node, Scene
from studio_ui.forms.fields import Field
from studio_ui.forms.param_form import ParamForm
from studio_ui.forms.sinks import Sink
from studio_ui.panels.light_fields import DirectionField, IntensityField, KelvinField, LensField
from studio_ui.panels.light_hints import calibration, light_hint

SPECIAL: Mapping[str, type[Field]] = {
    "intensity": IntensityField,
    "temperature": KelvinField,
    "azimuth": DirectionField,
    "fov": LensField,
}
_GROUND = ("ground_height", "ground_radius")
SECTIONS = {"Background": ("background", "background_azimuth", "projection", *_GROUND)}
_SKIP = ("locked", "hidden")


class NodeForm(ParamForm):
    """The parameters that nodes of one or several kinds share."""

    def __init__(
        self, kind: type[Node], infos: Mapping[str, ParamInfo], sink: Sink, skip: tuple[str, ...] = ()
    ) -> None:
        super().__init__(
            infos, sink, (*_SKIP, *skip), defaults=defaults(kind), special=SPECIAL, sections=SECTIONS
        )

    def show_nodes(self, scene: Scene, nodes: list[Node]) -> None:
        """What those nodes have, a dash where they differ."""
        values, mixed = shared_values(nodes, self.fields)
        self.show_values(values, mixed)
        intensity = self.fields.get("intensity")
        if isinstance(intensity, IntensityField):
            lights = [node for node in nodes if isinstance(node, Light)]
            hints = {light_hint(light, calibration(list(scene.of(Environment)))) for light in lights}
            intensity.tell(hints.pop() if len(hints) == 1 else "")
        if "projection" in self.fields:
            far = "projection" not in mixed and not str(values["projection"]).startswith("on")
            for name in _GROUND:
                self.show_row(name, not far)


def shared_values(nodes: list[Node], names: Collection[str]) -> tuple[dict[str, Any], set[str]]:
    """The last node's values, and the names of those in which the nodes differ."""
    last = nodes[-1]
    values = {name: getattr(last, name) for name in names}
    mixed = {name for name in names if any(getattr(node, name) != values[name] for node in nodes)}
    return values, mixed
