"""What somebody does while light between surfaces is timed: a lamp, a material, a thing changes stepwise."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable

from studio.bench.cuts_cases import dragged, moving
from studio.bench.interreflection_scenes import Setting
from studio_core.arrays import frozen_map
from studio_core.scene.nodes import Environment, Light, Scene
from studio_core.scene.transform import vec3

Steps = Callable[[Setting, int], list[Scene]]


def dims(setting: Setting, count: int) -> list[Scene]:
    """One light goes from 60 to 140 % and from warm to cold."""
    made = []
    for step in range(count):
        light = setting.scene[setting.light]
        assert isinstance(light, Light)
        share = 0.6 + 0.8 * step / max(count - 1, 1)
        kelvin = 2700.0 + 3800.0 * step / max(count - 1, 1)
        made.append(
            setting.scene.with_nodes(
                dataclasses.replace(light, intensity=light.intensity * share, temperature=kelvin)
            )
        )
    return made


def shifts(setting: Setting, count: int) -> list[Scene]:
    """The light moves along by 4 cm a step; an environment turns by 3.7°."""
    made = []
    for step in range(1, count + 1):
        light = setting.scene[setting.light]
        if isinstance(light, Environment):
            moved = dataclasses.replace(light, azimuth=light.azimuth + 3.7 * step)
        else:
            x, y, z = light.transform.translation
            place = dataclasses.replace(light.transform, translation=vec3((x + 0.04 * step, y, z)))
            moved = dataclasses.replace(light, transform=place)
        made.append(setting.scene.with_nodes(moved))
    return made


def glosses(setting: Setting, count: int) -> list[Scene]:
    """One material becomes sharper: exponent 6 to 16, or roughness 0.6 to 0.4."""
    material = setting.scene.material(setting.painted)
    low, high = {"exponent": (6.0, 16.0), "roughness": (0.6, 0.4)}[setting.field]
    made = []
    for step in range(count):
        value = low + (high - low) * step / max(count - 1, 1)
        values = frozen_map({**material.values, setting.field: value})
        made.append(setting.scene.with_materials(dataclasses.replace(material, values=values)))
    return made


def drags(setting: Setting, count: int) -> list[Scene]:
    """The first movable thing goes round a circle of 0.5 m, turning by up to 20°."""
    node = setting.scene[setting.movable[0]]
    angles = (2 * math.pi * step / (count + 1) for step in range(1, count + 1))
    return [moving(setting.scene, {node.id: dragged(node.transform, angle)}) for angle in angles]


EDITS: dict[str, Steps] = {"light": dims, "light_moved": shifts, "brdf": glosses, "move": drags}
"""By the name that their times have (`ms_…`)."""
