"""Looks of pictures, and paint that follows them."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from spread_support import checkered, checkered_floor
from transport_support import Stand

from studio_core.arrays import frozen_map
from studio_core.scene.geometry import Image, Texture
from studio_core.scene.paint import Paint
from studio_core.shading.looks import FINEST, Levels, PictureLooks, looks_vary
from studio_core.shading.painting import Coats


def test_a_look_is_the_cube_root_of_the_mean_texel():
    levels = Levels.of(checkered(4, 64, 0.1, 0.9))
    uv = np.array([[1 / 8, 7 / 8], [3 / 8, 7 / 8], [0.5, 0.5]], np.float32)
    sharp = levels.at(uv, np.zeros(3, np.float32))
    np.testing.assert_allclose(np.sort(sharp[:2, 0]), np.cbrt([0.1, 0.9]), rtol=1e-3)
    whole = levels.at(uv, np.ones(3, np.float32))
    np.testing.assert_allclose(whole, np.cbrt(0.5), rtol=1e-3)


def test_large_pictures_are_made_smaller():
    pixels = np.random.default_rng(0).random((8, 3 * FINEST, 3), np.float32)
    levels = Levels.of(Image(pixels)).levels
    assert max(levels[0].shape[:2]) <= FINEST
    assert levels[0].mean() == pytest.approx(pixels[:6].mean(), rel=0.02)


def test_looks_lie_as_the_picture_does(host):
    scene, reader = checkered_floor(), PictureLooks(host)
    stand = Stand(scene, 800)
    mesh = stand.mesh.objects[0].mesh
    pictures = reader.pictures(scene, scene["floor"])
    sharp = reader.of_mesh(pictures, mesh, sharp=True)
    squares = np.floor(mesh.uvs * 8 - 1e-6).sum(axis=1) % 2
    inside = (np.abs(mesh.uvs * 8 % 1 - 0.5) < 0.4).all(axis=1)
    for which in (0, 1):
        assert np.ptp(sharp[inside & (squares == which)]) < 0.02
    assert looks_vary(sharp)
    assert not looks_vary(reader.of_mesh((None,), mesh))


def test_paint_follows_the_picture_that_is_there_now(host):
    scene = checkered_floor()
    stand = Stand(scene, 3000)
    mesh = stand.mesh.objects[0].mesh
    reader = PictureLooks(host)
    looks = reader.of_mesh(reader.pictures(scene, scene["floor"]), mesh, sharp=True)
    change = (looks[:, 0] < 0.7).astype(np.float32)
    paint = Paint.of(
        mesh.positions, mesh.normals, mesh.slot, {"base_color": np.repeat(change[:, None], 3, 1)}, looks
    )
    coated = scene.with_nodes(dataclasses.replace(scene["floor"], paint=paint))
    coats = Coats(host)
    first = coats(coated, stand.mesh)[0]
    assert coats(coated, stand.mesh)[0] is first
    every = np.arange(len(mesh))
    made = first.changes(every)["base_color"][:, 0]
    clear = np.abs(looks - reader.of_mesh(reader.pictures(scene, scene["floor"]), mesh)).max(axis=1) < 0.02
    np.testing.assert_allclose(made[clear], change[clear], atol=0.02)
    plain = frozen_map({"base_color": Texture(Image(np.full((4, 4, 3), 0.5, np.float32)))})
    other = coated.with_materials(dataclasses.replace(coated.material("tiles"), textures=plain))
    assert coats(other, stand.mesh)[0] is not first
