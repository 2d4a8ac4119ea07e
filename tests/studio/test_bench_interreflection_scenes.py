"""The scenes of `lucarne bench interreflection`: their sizes, their meshes, and where poses put things."""

from __future__ import annotations

import functools
import itertools
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from studio.bench.interreflection_meshes import box, bunny, shell, slab, star, teapot, vase
from studio.bench.interreflection_poses import apart, footprint, inside, obstacles, poses, room_to_go, slid
from studio.bench.interreflection_scenes import CASES, FURNACES, Setting, furnace, setting
from studio.headless import Headless
from studio_core.scene.geometry import Geometry
from studio_core.scene.surface import surface

SIZES = {
    "teapot": (3241 + 4096, 8300),
    "room": (24_500, 25_500),
    "sample": (25_000, 28_500),
    "furniture": (25_000, 28_500),
    "bleeding": (10_000, 15_000),
}


@functools.cache
def made(name: str) -> Setting:
    found = setting(name, Headless(quiet=True))
    if found is None:
        pytest.skip("the shared test data is absent")
    return found


CLOSED = {
    "teapot": teapot(),
    "vase": vase(12, 16),
    "bunny": star(20, 24, bunny),
    "slab": slab(1.0, 2.0, 0.1, (5, 7)),
    "box": box((0, 0, 0), (1, 2, 3), (2, 3, 4)),
    "shell": shell((-1, 0, -1), (1, 2, 1), 0.1, (6, 5, 4)),
}


@pytest.mark.parametrize("name", CLOSED)
def test_bodies_are_closed_and_face_outwards(name: str) -> None:
    mesh = CLOSED[name]
    assert not surface(mesh).two_sided.any()
    p, f = mesh.positions.astype(np.float64), mesh.faces.astype(np.int64)
    flat = np.cross(p[f[:, 1]] - p[f[:, 0]], p[f[:, 2]] - p[f[:, 0]])
    assert mesh.normals is not None
    assert ((flat * mesh.normals[f].sum(axis=1)).sum(axis=1) > 0).all()
    assert (p[f[:, 0]] * flat).sum() > 0


def test_the_pot_and_its_floor_have_the_papers_numbers_of_vertices() -> None:
    assert len(teapot().positions) == 3241
    top = slab(1.4, 1.4, 0.02, (63, 63))
    assert (top.positions[:, 1] == 0).sum() >= 4096


@pytest.mark.parametrize("name", CASES)
def test_scenes_have_the_sizes_they_claim(name: str) -> None:
    low, high = SIZES[name]
    assert low <= made(name).count() <= high


@pytest.mark.parametrize("albedo", FURNACES)
@pytest.mark.parametrize("curved", [False, True])
def test_furnaces_face_inwards(albedo: float, curved: bool) -> None:
    scene = furnace(albedo, curved)
    walls = scene["walls"].geometry  # type: ignore[attr-defined]
    outside = (walls.normals * walls.positions).sum(axis=1) > 0
    assert not outside.any()


@pytest.mark.parametrize("name", ["teapot", "room", "bleeding", "furniture", "sample"])
def test_poses_stay_inside_and_apart(name: str) -> None:
    start = made(name)
    several = poses(start, 4)
    assert several == poses(start, 4)
    for scene in several:
        moved = [node for node in start.movable if scene[node].transform != start.scene[node].transform]
        assert len(moved) > len(start.movable) / 2
        for node in moved:
            hull = footprint(scene, node)
            assert inside(hull, start)
            assert footprint(start.scene, node).shape[1] == 2
        for one, other in itertools.combinations(moved, 2):
            if apart(footprint(start.scene, one), footprint(start.scene, other)):
                assert apart(footprint(scene, one), footprint(scene, other))
        for node in moved:
            for still in obstacles(start, node).keys() - set(start.movable):
                assert apart(footprint(scene, node), footprint(scene, still))


@pytest.mark.parametrize("name", ["teapot", "bleeding"])
def test_a_drag_goes_on_by_small_steps(name: str) -> None:
    start = made(name)
    pose = poses(start, 1)[0]
    steps = slid(start, pose, 3, 5)
    assert steps == slid(start, pose, 3, 5)
    changed = [{n for n in start.movable if step[n].transform != pose[n].transform} for step in steps]
    assert len(steps) == 3
    assert changed[0] == changed[1] == changed[2]
    (node,) = changed[0]
    centres = [footprint(scene, node).mean(axis=0) for scene in (pose, *steps)]
    for one, other in itertools.pairwise(centres):
        assert 0 < math.dist(one, other) < 0.1
    for scene in steps:
        assert inside(footprint(scene, node), start)


def test_some_things_touch() -> None:
    start = made("room")
    nearest = math.inf
    for scene in poses(start, 6):
        for node in start.movable:
            hull = footprint(scene, node)
            nearest = min(nearest, *(hull.min(axis=0) - start.low), *(start.high - hull.max(axis=0)))
    assert 0 <= nearest < 0.002


SQUARE = np.array([(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)])


@given(st.floats(-3.0, 3.0), st.floats(0.0, 6.28), st.floats(0.5, 3.0))
def test_what_goes_as_far_as_it_may_just_touches(shift: float, angle: float, distance: float) -> None:
    way = np.array([math.cos(angle), math.sin(angle)])
    across = np.array([-way[1], way[0]])
    other = SQUARE + (2 + distance) * way + shift * across
    free = room_to_go(SQUARE, other, way)
    if math.isinf(free):
        assert all(apart(SQUARE + t * way, other) for t in np.linspace(0, 9, 50))
    else:
        assert apart(SQUARE + (free - 1e-6) * way, other)
        assert not apart(SQUARE + (free + 1e-6) * way, other) or abs(shift) > 0.9


def test_a_box_knows_its_vertices() -> None:
    mesh: Geometry = box((0, 0, 0), (1, 1, 1), (4, 4, 4))
    assert len(mesh.positions) == 6 * 25
