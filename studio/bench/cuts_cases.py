"""The edits of `lucarne bench cuts`: a case is a path through states of the room that ends where it began.

The last state being the first one, every case can be compared with the same converged picture; errors are
also taken on the way, where nothing is as it was.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from studio_core.arrays import frozen_map
from studio_core.edits import Move
from studio_core.scene.nodes import Environment, Material, NodeId, Scene
from studio_core.scene.transform import IDENTITY, Transform, axis_angle, looking, vec3
from studio_core.session import View

CHAIR = "Chair at the front"
ONE = "Cognac leather"
RANGES: dict[str, dict[str, tuple[str, float, float]]] = {
    "glossy": {
        "ggx": ("roughness", 0.4**0.5, 0.2**0.5),
        "blinn-phong": ("exponent", 20.0, 48.0),
        "phong": ("exponent", 10.0, 20.0),
    },
    "sharp": {"ggx": ("roughness", 0.2**0.5, 0.05**0.5), "blinn-phong": ("exponent", 100.0, 1000.0)},
}
"""From soft to sharp, where a slider goes: its parameter and its ends."""


@dataclass(frozen=True)
class State:
    """What is shaded: a scene and how it is looked at."""

    scene: Scene
    view: View


Path = Callable[[State, int, str], list[State]]


@dataclass(frozen=True)
class Case:
    """`path` gives states in room materials `materials`; frames are `moving`, or at rest.

    At rest nothing is refined; `everywhere` also lights what the camera does not see.
    """

    name: str
    materials: str
    path: Path
    moving: bool = True
    everywhere: bool = False


def sliders(base: State, count: int, materials: str, only: str | None = None) -> list[State]:
    """All materials (or `only` one) from soft to sharp, then back to where they were."""
    made = []
    for step in range(count - 1):
        position = (step + 1) / (count - 1)
        chosen = [m for m in base.scene.materials.values() if only in (None, m.name)]
        made.append(
            dataclasses.replace(
                base, scene=base.scene.with_materials(*(_slid(m, materials, position) for m in chosen))
            )
        )
    return [*made, base]


def one_slider(base: State, count: int, materials: str) -> list[State]:
    """The same for one material alone."""
    return sliders(base, count, materials, ONE)


def _slid(material: Material, materials: str, position: float) -> Material:
    ranges = RANGES.get(materials.removeprefix("native-"), {})
    if material.model in ranges:
        name, soft, sharp = ranges[material.model]
        value = soft + (sharp - soft) * position
        return dataclasses.replace(material, values=frozen_map({**material.values, name: value}))
    if material.model == "lambert":
        red, green, blue = (
            float(c) for c in np.multiply(0.5 + 0.45 * position, material.values["base_color"])
        )
        values = {**material.values, "base_color": (red, green, blue)}
        return dataclasses.replace(material, values=frozen_map(values))
    return material


def orbits(base: State, count: int, materials: str) -> list[State]:
    """The camera swings about what it looks at, up to 12° to both sides."""
    view = base.view
    target = np.array(view.target)
    arm = np.array(view.transform.translation) - target
    made = []
    for step in range(1, count):
        angle = math.radians(12) * math.sin(2 * math.pi * step / count + 0.1)
        turned = np.array(
            [
                math.cos(angle) * arm[0] + math.sin(angle) * arm[2],
                arm[1] * (1 + 0.1 * math.sin(angle)),
                -math.sin(angle) * arm[0] + math.cos(angle) * arm[2],
            ]
        )
        moved = dataclasses.replace(view, transform=looking(target + turned, target))
        made.append(dataclasses.replace(base, view=moved))
    return [*made, base]


def turns(base: State, count: int, materials: str) -> list[State]:
    """The environment turns by 3.7° a step, then back at once."""
    light = next(base.scene.of(Environment))
    made = []
    for step in range(1, count):
        turned = dataclasses.replace(light, azimuth=light.azimuth + 3.7 * step)
        made.append(dataclasses.replace(base, scene=base.scene.with_nodes(turned)))
    return [*made, base]


def drags(base: State, count: int, materials: str, node: str | None = None) -> list[State]:
    """The chair (or `node`) goes round a circle of 0.5 m and turns by up to 20°."""
    moved = base.scene.named(CHAIR if node is None else node)
    made = []
    for step in range(1, count):
        angle = 2 * math.pi * step / count
        places = {moved.id: dragged(moved.transform, angle)}
        made.append(dataclasses.replace(base, scene=moving(base.scene, places)))
    return [*made, base]


def dragged(start: Transform, angle: float) -> Transform:
    """Where somebody's hand has an object that stands at `start`, by the angle on the circle."""
    away = (0.25 * (1 - math.cos(angle)), 0.0, 0.25 * math.sin(angle))
    turn = Transform(rotation=axis_angle((0, 1, 0), 20 * math.sin(angle)))
    place = Transform(vec3(np.add(start.translation, away)))
    own = dataclasses.replace(start, translation=IDENTITY.translation)
    return place @ turn @ own


def moving(scene: Scene, places: dict[NodeId, Transform]) -> Scene:
    """The scene with nodes moved."""
    return Move(places)(scene)


CASES = (
    Case("brdf", "glossy", sliders),
    Case("brdf-one", "glossy", one_slider),
    Case("brdf-sharp", "sharp", sliders),
    Case("brdf-diffuse", "diffuse", sliders),
    Case("camera", "glossy", orbits),
    Case("light-diffuse", "diffuse", turns),
    Case("light-glossy", "glossy", turns),
    Case("move-preview", "glossy", drags),
    Case("move-exact", "glossy", drags, moving=False),
    Case("move-exact-all", "glossy", drags, moving=False, everywhere=True),
)
