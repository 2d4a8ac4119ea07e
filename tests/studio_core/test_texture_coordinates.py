"""Objects without texture coordinates are found, and get some: one edit, instances alike."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from scenes import cube

from studio_core.errors import EditError
from studio_core.rooms import new_room
from studio_core.scene.geometry import Geometry
from studio_core.scene.nodes import Group, Material, MeshObject, Scene
from studio_core.scene.pattern import PatternRuler
from studio_core.scene.transform import Transform
from studio_core.texture_coordinates import bare_objects, coordinates_for, has_coordinates

BARE = Geometry(cube().positions, cube().faces)


def scene():
    laid = dataclasses.replace(BARE, uvs=BARE.positions[:, :2])
    flat = dataclasses.replace(BARE, uvs=np.ones((len(BARE.positions), 2)))
    made = {"one": BARE, "two": BARE, "large": BARE, "laid": laid, "flat": flat}
    objects = [
        MeshObject(
            id=name,
            name=name.title(),
            geometry=mesh,
            materials=("oak" if name != "two" else "ash",),
            parent="set" if name in ("one", "laid") else None,
            transform=Transform(scale=3.0 if name == "large" else 1.0),
        )
        for name, mesh in made.items()
    ]
    materials = Material(id="oak", name="Oak"), Material(id="ash", name="Ash")
    return Scene().with_materials(*materials).with_nodes(Group(id="set", name="Set"), *objects)


def test_what_has_no_coordinates_is_found():
    start = scene()
    assert [node.id for node in bare_objects(start)] == ["one", "two", "large", "flat"]
    assert [node.id for node in bare_objects(start, ["set"])] == ["one"]
    assert [node.id for node in bare_objects(start, material="ash")] == ["two"]
    assert not has_coordinates(start["flat"].geometry)
    lone = np.zeros((1000, 2), np.float32)
    lone[777] = 1
    many = Geometry(np.zeros((1000, 3), np.float32), BARE.faces, uvs=lone)
    assert has_coordinates(many)


def test_rooms_are_left_alone():
    room = new_room(4.0, 3.0)
    assert not bare_objects(room(Scene()))


def test_all_get_coordinates_in_metres_as_one_edit():
    start = scene()
    found = coordinates_for(start, bare_objects(start))
    made = found.edit(start)
    assert found.edit.label == "Texture coordinates of 4 objects"
    assert not bare_objects(made)
    assert made["one"].geometry is made["two"].geometry is not made["large"].geometry
    assert made["laid"] is start["laid"]
    only = made.with_nodes(dataclasses.replace(made["laid"], materials=("ash",)))
    lengths = PatternRuler().lengths(only, "oak")
    assert lengths.even
    assert (lengths.u, lengths.v) == pytest.approx((1, 1), rel=1e-3)
    with pytest.raises(EditError, match="has texture coordinates"):
        coordinates_for(made, bare_objects(made))
