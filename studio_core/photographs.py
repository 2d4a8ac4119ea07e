"""Edits that let furniture stand in a photographed room."""

from __future__ import annotations

import numpy as np

from studio_core.edits import Add, Compound, Edit, SetFields
from studio_core.scene.bounds import scene_bounds
from studio_core.scene.geometry import Geometry
from studio_core.scene.nodes import ON_THE_GROUND, Environment, Material, MeshObject, Scene, new_id
from studio_core.scene.transform import Transform
from studio_core.shading.lamps import shown_environment

LEAST = 4.0  # metres across
_BEYOND = 1.5  # times the height of what stands there: how far its shadow is looked for
_GREY = (0.4, 0.4, 0.4)


def flat_floor(width: float, depth: float) -> Geometry:
    """A rectangle about the origin at y = 0, metres, facing up; uv in metres."""
    x, z = width / 2, depth / 2
    positions = np.array([[-x, 0, z], [x, 0, z], [x, 0, -z], [-x, 0, -z]], np.float32)
    uvs = np.array([[0, 0], [width, 0], [width, depth], [0, depth]], np.float32)
    normals = np.tile(np.array([0, 1, 0], np.float32), (4, 1))
    return Geometry(positions, np.array([[0, 1, 2], [0, 2, 3]], np.uint32), normals, uvs)


def shadow_floor(scene: Scene, size: float | None = None) -> Add:
    """The edit that adds a floor which only catches shadows, under what there is.

    `size` metres across, else as far as shadows of what stands there may reach. It lies where the
    environment's ground lies (y = 0 without one), locked: a click on the photograph chooses nothing.
    """
    low, high = scene_bounds(scene)
    environment = shown_environment(scene)
    level = environment.transform.translation[1] if environment is not None else 0.0
    reach = _BEYOND * max(float(high[1]) - level, 0.5)
    wide, deep = (max(float(high[axis] - low[axis]) + 2 * reach, LEAST) for axis in (0, 2))
    if size is not None:
        wide = deep = size
    material = Material(
        id=new_id("material"), name="Shadow floor", values={"base_color": _GREY}, catches=True
    )
    floor = MeshObject(
        id=new_id("mesh"),
        name="Shadow floor",
        geometry=flat_floor(wide, deep),
        materials=(material.id,),
        transform=Transform((float(low[0] + high[0]) / 2, level, float(low[2] + high[2]) / 2)),
        locked=True,
    )
    return Add((floor,), (material,), "Add shadow floor")


def stand_in_photograph(scene: Scene) -> Edit:
    """A shadow floor, and the background, where there is one, seen on the ground: one step."""
    add = shadow_floor(scene)
    environment = shown_environment(scene)
    if not isinstance(environment, Environment):
        return add
    seen = {"background": True, "projection": ON_THE_GROUND}
    return Compound("Stand in the photograph", (add, SetFields(environment.id, seen)))
