"""Hollow objects are taken apart, others are not."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from field_support import JOB, body, services
from scenes import cube, floor

from studio_core.scene.geometry import Geometry
from studio_plugins.interreflection.fields.parts import own_share, parts, piece_of, pieces


def inside_out(geometry):
    return Geometry(geometry.positions, geometry.faces[:, ::-1], -geometry.normals)


ROOM = body(inside_out(cube(3.0)), 0.5)


def test_a_rooms_light_comes_back_to_it_and_a_cubes_does_not(workers):
    share = own_share(ROOM, services(workers), JOB)  # its walls have outsides too
    assert share == pytest.approx(0.5, abs=0.06)
    assert own_share(body(cube(), 0.25), services(workers), JOB) == 0
    assert own_share(body(floor(), 0.5), services(workers), JOB) == 0


def test_a_room_is_six_walls_and_a_cube_is_one_object(workers):
    walls = parts(ROOM, services(workers), JOB)
    assert len(walls) == 6
    np.testing.assert_array_equal(np.sort(np.concatenate(walls)), np.arange(len(ROOM.mesh)))
    for wall in walls:
        assert np.ptp(np.abs(ROOM.mesh.normals[wall]), axis=0).max() < 1e-6
    assert parts(body(cube(), 0.25), services(workers), JOB) == [None]


def test_both_sides_of_an_open_sheet_are_one_piece():
    assert len(pieces(body(floor(), 0.5).mesh)) == 1


def test_small_pieces_are_the_rest_together():
    positions = np.concatenate([cube(1.0).positions, cube(0.05).positions + np.float32(2)])
    faces = np.concatenate([cube().faces, cube().faces + np.uint32(24)])
    own = body(Geometry(positions, faces, np.tile(cube().normals, (2, 1))), 0.5)
    found = pieces(own.mesh)
    assert len(found) == 7
    assert (own.mesh.positions[found[-1]] > 1).all()


def test_a_piece_has_the_faces_of_its_vertices():
    wall = pieces(ROOM.mesh)[2]
    piece = piece_of(ROOM, wall)
    used = np.concatenate([ROOM.mesh.faces[piece.opaque], ROOM.mesh.back_faces[piece.opaque]])
    np.testing.assert_array_equal(np.unique(used), wall)
    assert piece.content != ROOM.content
    assert piece.content == dataclasses.replace(piece).content
