"""Metres of one unit of texture coordinates, and pictures laid by their size."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from studio_core.edits import LayTextures
from studio_core.errors import EditError
from studio_core.scene.geometry import Geometry, Image, Texture
from studio_core.scene.nodes import Material, MeshObject, Scene
from studio_core.scene.pattern import (
    MOST_FACES,
    PLAIN,
    PatternRuler,
    UnitLengths,
    face_lengths,
    pattern_size,
    with_rotation,
    with_size,
)
from studio_core.scene.transform import Transform, axis_angle

PICTURE = Image(np.zeros((2, 2, 3), np.float32))
SIZES = st.floats(0.01, 10.0)


def sheet(width, depth, across, along, turned=0.0, cells=1):
    """A sheet of width × depth metres whose u runs `across` and v `along` over it."""
    steps = np.linspace(0, 1, cells + 1)
    grid = np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 2)
    angle = np.radians(turned)
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    at = (grid * (width, depth)) @ turn.T
    i = np.arange(cells * (cells + 1)).reshape(cells, cells + 1)[:, :-1].ravel()
    faces = np.concatenate([np.c_[i, i + 1, i + cells + 2], np.c_[i, i + cells + 2, i + cells + 1]])
    positions = np.stack([at[:, 0], np.zeros(len(at)), -at[:, 1]], axis=1)
    uvs = grid * (across, along)
    return Geometry(positions.astype(np.float32), faces.astype(np.uint32), uvs=uvs.astype(np.float32))


def scene_of(*meshes, material="oak"):
    objects = [
        MeshObject(id=f"m{n}", name=f"M{n}", geometry=mesh, materials=(material,), transform=transform)
        for n, (mesh, transform) in enumerate(meshes)
    ]
    return (
        Scene()
        .with_materials(Material(id="oak", name="Oak"), Material(id="ash", name="Ash"))
        .with_nodes(*objects)
    )


@given(SIZES, SIZES, st.floats(0.1, 20), st.floats(0.1, 20), st.floats(-180, 180), st.floats(0.1, 5))
def test_a_unit_is_as_long_as_it_is_drawn(width, depth, across, along, turned, scale):
    mesh = sheet(width, depth, across, along, turned)
    placed = Transform((1.0, 2.0, 3.0), axis_angle((1, 2, 3), 50.0), scale)
    lengths = PatternRuler().lengths(scene_of((mesh, placed)), "oak")
    assert lengths.u == pytest.approx(scale * width / across, rel=1e-3)
    assert lengths.v == pytest.approx(scale * depth / along, rel=1e-3)
    assert lengths.even


def test_the_larger_surface_says_and_the_range_is_told():
    small, large = sheet(1, 1, 1, 1), sheet(2, 2, 1, 2)
    ruler = PatternRuler()
    scene = scene_of((small, Transform()), (large, Transform()))
    lengths = ruler.lengths(scene, "oak")
    assert (lengths.u, lengths.v) == (2.0, 1.0)
    assert lengths.u_range == (1.0, 2.0)
    assert lengths.v_range == (1.0, 1.0)
    assert not lengths.even
    assert ruler.lengths(scene, "oak") is lengths
    assert ruler.lengths(scene, "ash") is None
    bare = dataclasses.replace(scene["m1"], geometry=Geometry(large.positions, large.faces))
    assert ruler.lengths(scene.with_nodes(bare), "oak").u == 1.0


def test_what_has_no_extent_says_nothing():
    mesh = sheet(1, 1, 1, 1)
    flat = Geometry(mesh.positions, mesh.faces, uvs=np.zeros_like(mesh.uvs))
    assert PatternRuler().lengths(scene_of((flat, Transform())), "oak") is None
    needle = mesh.positions.copy()
    needle[:, 2] = 0
    assert not len(face_lengths(Geometry(needle, mesh.faces, uvs=mesh.uvs), 0))


def test_of_many_faces_a_part_stands_for_all():
    mesh = sheet(3, 2, 6, 4, cells=160)
    found = face_lengths(mesh, 0)
    assert len(mesh.faces) > MOST_FACES >= len(found)
    assert found[:, 2].sum() == pytest.approx(6.0, rel=0.01)
    np.testing.assert_allclose(found[:, :2], 0.5, rtol=1e-3)


@given(SIZES, SIZES, SIZES, SIZES, st.floats(-360, 360), st.booleans(), st.booleans())
def test_a_size_is_what_was_asked_for_and_turning_keeps_it(u, v, width, height, degrees, mirrored, stood):
    lengths = UnitLengths(u, v, (u, u), (v, v))
    start = Texture(PICTURE, (-1.0 if mirrored else 1.0, 1.0), (0.1, 0.2), 90.0 if stood else 0.0)
    laid = with_size(start, lengths, (width, height))
    assert pattern_size(laid, lengths) == pytest.approx((width, height))
    turned = with_rotation(laid, lengths, degrees)
    assert turned.rotation == degrees
    assert turned.offset == start.offset
    assert pattern_size(turned, lengths) == pytest.approx((width, height))
    a, b, _, c, d, _ = turned.affine
    rows = np.array([[a / u, b / v], [c / u, d / v]])  # on metres: at right angles
    assert abs(rows[0] @ rows[1]) <= 1e-9 * np.linalg.norm(rows[0]) * np.linalg.norm(rows[1])
    assert (np.linalg.det(rows) < 0) == mirrored


def test_a_picture_that_never_repeats_has_no_size():
    laid = Texture(PICTURE, (0.0, 1.0))
    assert pattern_size(laid, PLAIN) == (np.inf, np.inf)
    assert with_rotation(laid, PLAIN, 30.0).rotation == 30.0


def test_pictures_are_laid_together_or_one_by_one():
    textures = {name: Texture(PICTURE) for name in ("base_color", "roughness")}
    scene = Scene().with_materials(Material(id="oak", name="Oak", textures=textures))
    made = LayTextures("oak", (2.0, 3.0), (0.5, 0.0), 30.0, 1.5)(scene).material("oak").textures
    assert {one.affine for one in made.values()} == {
        Texture(PICTURE, (2.0, 3.0), (0.5, 0.0), 30.0, 1.5).affine
    }
    one = LayTextures("oak", (2.0, 3.0), parameters=("roughness",))(scene).material("oak").textures
    assert one["base_color"] is textures["base_color"]
    assert one["roughness"].scale == (2.0, 3.0)
    assert LayTextures("oak")(scene) is scene
    with pytest.raises(EditError, match="metallic"):
        LayTextures("oak", parameters=("metallic",))(scene)
    with pytest.raises(EditError, match="finite"):
        LayTextures("oak", (np.inf, 1.0))(scene)
