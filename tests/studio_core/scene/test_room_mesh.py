"""Rooms of every shape: closed, of the right volume, solid exactly where their numbers say."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from oracles.rooms import solid, winding
from oracles.solids import uses_of_edges, volume
from room_support import shapes

from studio_core.scene.geometry import Geometry
from studio_core.scene.polygon import area
from studio_core.scene.room_cells import CEILING, FLOOR, FRAMES, SKIRTING, WALLS
from studio_core.scene.room_mesh import room_geometry
from studio_core.scene.room_plans import l_plan
from studio_core.scene.room_shape import (
    PROUD,
    SLAB,
    Opening,
    RoomShape,
    rectangle,
)
from studio_core.scene.shading_mesh import prepare, shade_mesh

PLAIN = RoomShape(rectangle(5, 4), 2.6, 0.2)


def built(shape: RoomShape) -> Geometry:
    """The mesh, where the shape can be built."""
    try:
        return room_geometry(shape)
    except ValueError:
        assume(False)
        raise


def wide(geometry: Geometry) -> tuple[np.ndarray, np.ndarray]:
    return geometry.positions.astype(np.float64), geometry.faces.astype(np.int64)


def flat(geometry: Geometry) -> tuple[np.ndarray, np.ndarray]:
    """Area and unit normal of each face."""
    positions, faces = wide(geometry)
    a, b, c = (positions[faces[:, k]] for k in range(3))
    doubled = np.cross(b - a, c - a)
    size = np.linalg.norm(doubled, axis=1)
    return size / 2, doubled / size[:, None]


@given(shapes())
@settings(max_examples=60)
def test_a_room_is_one_closed_surface_with_normals_of_its_faces(shape: RoomShape) -> None:
    geometry = built(shape)
    positions, faces = wide(geometry)
    assert uses_of_edges(positions, faces) == {2}
    size, normal = flat(geometry)
    assert (size > 1e-7).all()
    assert geometry.normals is not None
    assert (np.einsum("fi,fki->fk", normal, geometry.normals[faces]) > 0.999).all()
    low, high = geometry.bounds
    assert low[1] == np.float32(-SLAB)
    top = shape.height + SLAB if shape.ceiling else shape.height
    closed = shape.ceiling or len(shape.without) < len(shape.corners)
    assert high[1] == np.float32(top if closed else 0.0)


@given(shapes(), st.integers(0, 2**32))
@settings(max_examples=40)
def test_it_is_solid_exactly_where_its_numbers_say(shape: RoomShape, seed: int) -> None:
    geometry = built(shape)
    positions, faces = wide(geometry)
    low, high = geometry.bounds
    random = np.random.default_rng(seed)
    points = low - 0.1 + random.random((60, 3)) * (high - low + 0.2)
    plan = np.array(shape.corners)
    for one in shape.placed():  # most happens in the openings
        a, b = plan[one.wall], plan[(one.wall + 1) % len(plan)]
        way = (b - a) / np.hypot(*(b - a))
        along = one.start - 0.1 + random.random(40) * (one.end - one.start + 0.2)
        out = random.random(40) * (shape.thickness + 2 * PROUD) - PROUD
        spot = a + along[:, None] * way + out[:, None] * np.array([way[1], -way[0]])
        y = max(one.low - 0.1, 0) + random.random(40) * (one.high - one.low + 0.2)
        points = np.concatenate([points, np.stack([spot[:, 0], y, spot[:, 1]], axis=1)])
    turns = winding(positions, faces, points)
    assert np.abs(turns - np.round(turns)).max() < 1e-6
    expected = solid(shape, points)
    wrong = points[(np.round(turns) == 1) != expected]
    for nudge in np.array([[1, 1, 1], [-1, -1, -1]]) * 1e-5:  # what lies on a face may be either
        wrong = wrong[solid(shape, wrong + nudge) == solid(shape, wrong)]
    assert not len(wrong)
    assert set(np.round(turns)) <= {0.0, 1.0}


@given(shapes())
@settings(max_examples=40)
def test_the_volume_is_that_of_slabs_walls_and_boards(shape: RoomShape) -> None:
    shape = dataclasses.replace(shape, openings=())
    geometry = built(shape)
    outer, inner = area(shape.rim(shape.thickness)), area(shape.corners)
    expected = outer * SLAB * (2 if shape.ceiling else 1) + (outer - inner) * shape.height
    if shape.baseboard:
        expected += (inner - area(shape.rim(-PROUD))) * shape.baseboard
    assert volume(*wide(geometry)) == pytest.approx(expected, rel=1e-4)


@given(shapes())
@settings(max_examples=40)
def test_passages_take_their_area_from_both_sides_of_a_wall(shape: RoomShape) -> None:
    passages = tuple(dataclasses.replace(o, kind="opening", sill=max(o.sill, 0.05)) for o in shape.openings)
    shape = dataclasses.replace(shape, openings=passages, skirting=0.0)
    with_holes, without = built(shape), room_geometry(dataclasses.replace(shape, openings=()))
    holes = [((one.end - one.start), (one.high - one.low)) for one in shape.placed()]
    cut = sum(width * height for width, height in holes)
    assert volume(*wide(without)) - volume(*wide(with_holes)) == pytest.approx(
        cut * shape.thickness, rel=1e-3, abs=1e-4
    )
    reveals = sum(2 * (width + height) * shape.thickness for width, height in holes)
    grown = flat(with_holes)[0].sum() - flat(without)[0].sum()
    assert grown == pytest.approx(reveals - 2 * cut, rel=1e-3, abs=1e-3)


@given(shapes())
@settings(max_examples=25)
def test_texture_is_in_metres_and_not_mirrored(shape: RoomShape) -> None:
    geometry = built(shape)
    _, faces = wide(geometry)
    assert geometry.uvs is not None
    uv = geometry.uvs.astype(np.float64)[faces]
    u, v = uv[:, 1] - uv[:, 0], uv[:, 2] - uv[:, 0]
    assert (u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]) / 2 == pytest.approx(flat(geometry)[0], rel=1e-3, abs=1e-5)


def test_a_plain_room_has_the_areas_of_its_sizes() -> None:
    shape = dataclasses.replace(PLAIN, skirting=0.1)
    geometry = room_geometry(shape)
    size, normal = flat(geometry)
    slots = np.asarray(geometry.slots)
    up, down = normal[:, 1] > 0.5, normal[:, 1] < -0.5
    within = geometry.positions[geometry.faces][:, :, [0, 2]].mean(axis=1)
    assert size[(slots == FLOOR) & up].sum() == pytest.approx((5 - 2 * PROUD) * (4 - 2 * PROUD))
    assert size[(slots == CEILING) & down].sum() == pytest.approx(20)
    assert size[(slots == SKIRTING) & up].sum() == pytest.approx(
        20 - (5 - 2 * PROUD) * (4 - 2 * PROUD), rel=1e-5
    )
    upright = ~up & ~down
    facing = np.einsum("ij,ij->i", normal[:, [0, 2]], within) < 0
    assert size[(slots == WALLS) & upright & facing].sum() == pytest.approx(18 * 2.5)
    assert size[(slots == WALLS) & upright & ~facing].sum() == pytest.approx(2 * (5.4 + 4.4) * 2.8)
    assert geometry.bounds.tolist() == np.float32([[-2.7, -0.1, -2.2], [2.7, 2.7, 2.2]]).tolist()


def test_windows_have_frames_and_doors_are_closed() -> None:
    window = Opening(wall=0, width=1.5)
    door = Opening(kind="door", wall=1, sill=0, width=0.9, height=2.05)
    geometry = room_geometry(dataclasses.replace(PLAIN, openings=(window, door)))
    size, normal = flat(geometry)
    framed = np.asarray(geometry.slots) == FRAMES
    to_room = framed & (normal[:, 2] > 0.5)
    bars = 1.5 * 1.4 - (1.5 - 3 * 0.06) * (1.4 - 2 * 0.06)  # two casements: three uprights
    assert size[to_room].sum() == pytest.approx(bars)
    leaf = framed & (normal[:, 0] < -0.5) & (geometry.positions[geometry.faces][:, :, 0].mean(axis=1) > 2.5)
    assert size[leaf].sum() == pytest.approx(0.9 * 2.05)


def test_walls_that_are_left_out_end_their_neighbours_squarely() -> None:
    geometry = room_geometry(dataclasses.replace(PLAIN, without=frozenset({2})))
    assert geometry.bounds[1, 2] == 2
    size, normal = flat(geometry)
    ends = (normal[:, 2] > 0.5) & (np.abs(geometry.positions[geometry.faces][:, :, 2] - 2) < 1e-6).all(axis=1)
    assert size[ends].sum() == pytest.approx(5.4 * 0.2 + 2 * 0.2 * 2.6)


def test_an_l_shaped_room_lacks_its_corner() -> None:
    whole = room_geometry(RoomShape(rectangle(6, 5), 2.5, 0.1))
    cut = room_geometry(RoomShape(l_plan(6, 5, 2, 1.5), 2.5, 0.1))
    assert volume(*wide(whole)) - volume(*wide(cut)) == pytest.approx(2 * 2 * 1.5 * 0.1, rel=1e-5)


def test_rooms_of_one_shape_share_their_mesh() -> None:
    assert room_geometry(PLAIN) is room_geometry(RoomShape(rectangle(5, 4), 2.6, 0.2))
    higher = dataclasses.replace(PLAIN, height=2.7)
    first = room_geometry(higher)
    key = first.key
    del first
    assert room_geometry(higher).key == key


DOOR = Opening(kind="door", wall=1, sill=0.0, width=0.9, height=2.05)


@pytest.mark.parametrize("openings", [(), (DOOR,), (Opening(), DOOR)], ids=["closed", "door", "window"])
def test_the_shading_mesh_of_a_room_has_one_side_and_no_long_edge(openings: tuple[Opening, ...]) -> None:
    geometry = room_geometry(dataclasses.replace(PLAIN, openings=openings, skirting=0.08))
    assert (prepare(geometry).back == -1).all()
    mesh = shade_mesh(geometry, 0.4)
    corners = mesh.positions[mesh.faces]
    assert np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max() < 0.4 * 1.001
    assert mesh.area.sum() == pytest.approx(flat(geometry)[0].sum(), rel=1e-5)
