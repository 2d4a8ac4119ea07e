"""Random edits of every kind that the program has, most of them fitting the scene, some not."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from random import Random
from typing import Any

import numpy as np
from scenes import cube, floor, sky

from studio_core import copies, edits
from studio_core.arrays import frozen_map
from studio_core.edits import Edit
from studio_core.scene.geometry import Table, Texture
from studio_core.scene.nodes import (
    AreaLamp,
    Camera,
    DirectionalLamp,
    Environment,
    Group,
    Light,
    Material,
    MeshObject,
    Node,
    PointLamp,
    Scene,
    SpotLamp,
)
from studio_core.scene.paint import Paint
from studio_core.scene.room import SLOTS, Room
from studio_core.scene.room_shape import Opening
from studio_core.scene.transform import Transform, axis_angle

GEOMETRIES = (floor(), cube(), cube(0.3))
IMAGES = (sky(8), sky(8, 3.0))
MODELS = ("lambert", "phong", "ggx")
KINDS = (
    *(Group, MeshObject, MeshObject, Room, Camera),
    *(Environment, PointLamp, SpotLamp, DirectionalLamp, AreaLamp),
)
CROWD = 24  # nodes from which on removing gets likely


@dataclasses.dataclass
class Dice:
    """Draws parts of a scene and edits of it; `fresh` is an id that nothing has."""

    rng: Random
    scene: Scene
    fresh: str

    def node(self) -> str:
        """A node that is there, seldom one that is not."""
        known = tuple(self.scene.nodes)
        return self.rng.choice(known) if known and self.rng.random() > 0.05 else "nobody"

    def nodes(self) -> tuple[str, ...]:
        """Up to three different nodes."""
        return tuple(dict.fromkeys(self.node() for _ in range(self.rng.randint(1, 3))))

    def parent(self) -> str | None:
        """A group, or the top."""
        return self.rng.choice([None, *(group.id for group in self.scene.of(Group))])

    def material(self) -> str:
        """A material that is there."""
        return self.rng.choice(tuple(self.scene.materials) or ("nothing",))

    def colour(self) -> tuple[float, float, float]:
        """Any reflectance."""
        return (self.rng.random(), self.rng.random(), self.rng.random())

    def transform(self) -> Transform:
        """Anywhere in a room, turned any way, of half to twice the size."""
        uniform = self.rng.uniform
        turn = axis_angle((uniform(-1, 1), uniform(0.1, 1), uniform(-1, 1)), uniform(-360, 360))
        place = (uniform(-5, 5), uniform(-5, 5), uniform(-5, 5))
        return Transform(place, turn, self.rng.choice((0.5, 1.0, 2.0)))

    def new_node(self) -> Node:
        """A node of any kind."""
        base: dict[str, Any] = {
            "id": self.fresh,
            "name": self.rng.choice(("Chair", "Table", "Lamp 2", "Wall")),
            "parent": self.parent(),
            "transform": self.transform(),
            "hidden": self.rng.random() < 0.2,
        }
        kind = self.rng.choice(KINDS)
        if kind is MeshObject:
            return MeshObject(**base, geometry=self.rng.choice(GEOMETRIES), materials=(self.material(),))
        if kind is Room:
            return Room(**base, materials=(self.material(),) * len(SLOTS), width=self.rng.uniform(2, 6))
        if kind is Environment:
            return Environment(**base, image=self.rng.choice(IMAGES))
        made: Node = kind(**base)
        return made

    def new_material(self) -> Material:
        """A material of any model."""
        values = frozen_map({"base_color": self.colour()})
        return Material(id=f"m{self.fresh}", name="Oak", model=self.rng.choice(MODELS), values=values)

    def values(self, node: Node) -> dict[str, Any]:
        """New values for one or two fields of a node."""
        rng = self.rng
        choices: dict[str, Any] = {
            "name": rng.choice(("Left", "Right", "")),
            "hidden": rng.random() < 0.5,
            "locked": rng.random() < 0.5,
        }
        if isinstance(node, Light):
            choices["intensity"] = rng.uniform(0, 10)
            choices["tint"] = self.colour()
            choices["temperature"] = rng.uniform(1000, 20000)
        if isinstance(node, Camera):
            choices["fov"] = rng.uniform(10, 120)
        if isinstance(node, Environment):
            choices["azimuth"] = rng.uniform(-180, 180)
            choices["image"] = rng.choice(IMAGES)
            choices["background"] = rng.random() < 0.5
        if isinstance(node, SpotLamp):
            choices["cone"] = rng.uniform(1, 90)
        if isinstance(node, Room):
            choices["width"] = rng.uniform(0.4, 8)  # now and then too narrow
            choices["ceiling"] = rng.random() < 0.5
            choices["without"] = rng.choice(((), (1,), (2, 3), (7,)))
            choices["openings"] = rng.choice(((), (Opening(),), (Opening(wall=1, along=1.0),), ("none",)))
        if isinstance(node, AreaLamp):
            choices["width"] = rng.uniform(0.1, 3)
        return {name: choices[name] for name in rng.sample(sorted(choices), rng.randint(1, 2))}


def random_edit(rng: Random, scene: Scene, serial: int) -> Edit:
    """Any edit of the program; now and then one that does not fit. `serial` must differ each time."""
    makers = MAKERS if len(scene.nodes) < CROWD else [*MAKERS, *[_remove] * 8]
    return rng.choice(makers)(Dice(rng, scene, f"n{serial}"))


def _add(dice: Dice) -> Edit:
    return edits.Add((dice.new_node(),), (dice.new_material(),))


def _add_there(dice: Dice) -> Edit:
    return edits.Add((Group(id=dice.node()),))


def _duplicate(dice: Dice) -> Edit:
    known = tuple(node for node in dice.nodes() if node in dice.scene.nodes)
    made = copies.duplicate(dice.scene, known, offset=dice.transform())
    names = {copy.id: f"{dice.fresh}-{i}" for i, copy in enumerate(made.nodes)}  # ids that a seed repeats
    nodes = [
        dataclasses.replace(copy, id=names[copy.id], parent=names.get(copy.parent or "", copy.parent))
        for copy in made.nodes
    ]
    return edits.Add(tuple(nodes[:CROWD]), label=made.label)


def _remove(dice: Dice) -> Edit:
    return edits.Remove(dice.nodes())


def _move(dice: Dice) -> Edit:
    return edits.Move({node: dice.transform() for node in dice.nodes()})


def _set_fields(dice: Dice) -> Edit:
    node = dice.node()
    known = node in dice.scene.nodes and dice.rng.random() > 0.05
    return edits.SetFields(node, dice.values(dice.scene[node]) if known else {"wheels": 4})


def _reparent(dice: Dice) -> Edit:
    return edits.Reparent(dice.nodes(), dice.parent())


def _order(dice: Dice) -> Edit:
    return edits.Order(dice.nodes(), dice.rng.choice((None, dice.node())))


def _set_geometry(dice: Dice) -> Edit:
    return edits.SetGeometry(dice.node(), dice.rng.choice(GEOMETRIES))


def _assign(dice: Dice) -> Edit:
    return edits.Assign(dice.node(), dice.material(), dice.rng.choice((None, 0, 3)))


def _set_paint(dice: Dice) -> Edit:
    count = dice.rng.randint(1, 5)
    rng = np.random.default_rng(dice.rng.randint(0, 99))
    changes = {"base_color": rng.normal(size=(count, 3)), "roughness": rng.normal(size=count)}
    looks = rng.random((count, 3)) if dice.rng.random() < 0.5 else None
    shape = rng.normal(size=(count, 3)), rng.normal(size=(count, 3)), np.zeros(count)
    paint = Paint.of(*shape, changes, looks)
    return edits.SetPaint(dice.node(), paint if dice.rng.random() < 0.8 else None)


def _add_material(dice: Dice) -> Edit:
    return edits.AddMaterial(dice.new_material())


def _remove_material(dice: Dice) -> Edit:
    return edits.RemoveMaterial(dice.material())


def _set_material(dice: Dice) -> Edit:
    rng = dice.rng
    values = frozen_map({"base_color": dice.colour()})
    model, opacity = rng.choice((None, *MODELS)), rng.choice((None, 0.2, 1.0, 7.0))
    return edits.SetMaterial(dice.material(), values, model, rng.choice((None, "Ash")), opacity)


def _set_texture(dice: Dice) -> Edit:
    texture = Texture(dice.rng.choice(IMAGES), (dice.rng.uniform(0.1, 4), 1.0))
    return edits.SetTexture(dice.material(), "base_color", dice.rng.choice((None, texture)))


def _lay_textures(dice: Dice) -> Edit:
    scale = (dice.rng.uniform(0.1, 4), dice.rng.uniform(0.1, 4))
    return edits.LayTextures(dice.material(), scale, (0.1, 0.2), dice.rng.uniform(-180, 180), 1.5)


def _set_table(dice: Dice) -> Edit:
    table = Table(np.full((2, 1, 3, 3), dice.rng.uniform(0.0, 0.3), np.float32), "Felt")
    return edits.SetTable(dice.material(), "measurement", dice.rng.choice((None, table)))


def _compound(dice: Dice) -> Edit:
    first = edits.Add((Group(id=f"{dice.fresh}-a"),))
    then = dataclasses.replace(dice, scene=first(dice.scene), fresh=f"{dice.fresh}c")
    return edits.Compound("Both", (first, dice.rng.choice(MAKERS)(then)))


def _replace_by_another_kind(dice: Dice) -> Edit:
    node = dice.node()
    return edits.Compound("Replace", (edits.Remove((node,)), edits.Add((Camera(id=node),))))


MAKERS: list[Callable[[Dice], Edit]] = [
    *[_add] * 2,
    _add_there,
    _duplicate,
    _remove,
    *[_move] * 2,
    *[_set_fields] * 3,
    _reparent,
    _order,
    _set_geometry,
    _assign,
    _set_paint,
    _add_material,
    *[_remove_material] * 2,
    _set_material,
    _set_texture,
    _lay_textures,
    _set_table,
    _compound,
    _replace_by_another_kind,
]
