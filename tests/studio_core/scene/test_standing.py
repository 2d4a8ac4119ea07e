"""What things stand on, against every triangle tested one by one."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from oracles.standing import first_level, height_below
from scenes import cube, floor, little_scene

from studio_core.edits import Add, Move
from studio_core.scene.bounds import exact_bounds
from studio_core.scene.geometry import Geometry
from studio_core.scene.nodes import MeshObject, Scene
from studio_core.scene.standing import Ground, dropped
from studio_core.scene.transform import Transform, axis_angle

EMPTY = Add(())(little_scene())


def scene(*meshes: tuple[str, Geometry, Transform], hidden: tuple[str, ...] = ()) -> Scene:
    materials = tuple(EMPTY.materials.values())
    nodes = tuple(
        MeshObject(id=n, name=n, geometry=g, materials=("paint",), transform=t, hidden=n in hidden)
        for n, g, t in meshes
    )
    return Add(nodes, materials)(Scene())


TABLE = Transform((1.0, 0.5, 0.0))
ROOM = scene(("floor", floor(6.0), Transform()), ("table", cube(), TABLE))


def test_the_floor_and_the_table_carry() -> None:
    ground = Ground(ROOM)
    found = ground.below([(0, 2, 0), (1, 2, 0), (1, 0.4, 0), (9, 2, 0), (0, 0, 0), (0, -1, 0)])
    assert found == pytest.approx([0.0, 1.0, 0.0, -np.inf, 0.0, -np.inf])
    assert Ground(ROOM, {"table"}).below([(1, 2, 0)])[0] == 0.0
    assert ground.below(np.zeros((0, 3))).shape == (0,)


def test_a_footprint_over_an_edge_is_carried_by_the_higher_side() -> None:
    ground = Ground(ROOM)
    assert ground.support((0.2, 3, -0.1), (0.6, 4, 0.1), 3.0) == pytest.approx(1.0)
    assert ground.support((0.0, 3, -0.1), (0.4, 4, 0.1), 3.0) == pytest.approx(0.0)
    assert ground.support((0.2, 0.0, -0.1), (0.6, 1, 0.1), 0.05) == pytest.approx(0.0), "under the table top"


def test_a_falling_ray_meets_the_first_level_surface() -> None:
    ground, eye = Ground(ROOM), np.array([1.0, 3.0, 4.0])
    seat = ground.along(eye, (np.array([1.0, 1.0, 0.2]) - eye) / np.linalg.norm((0, 2, 3.8)))
    assert seat is not None
    assert (seat.node, tuple(seat.at.round(6))) == ("table", (1.0, 1.0, 0.2))
    side = ground.along(eye, np.array([0.0, -3.0, -3.6]) / np.hypot(3.0, 3.6))
    assert side is not None
    assert side.node == "floor", "the side of the table carries nothing"
    assert ground.along(eye, (0.0, 1.0, 0.0)) is None
    assert ground.along(eye, (0.0, 0.0, -1.0)) is None


def test_what_is_hidden_carries_nothing() -> None:
    made = scene(("floor", floor(6.0), Transform()), ("table", cube(), TABLE), hidden=("table",))
    assert Ground(made).below([(1, 2, 0)])[0] == 0.0


@given(st.floats(1.1, 4.0), st.floats(-180, 180), st.floats(0.0, 1.0))
def test_what_is_dropped_touches_what_lies_below(height: float, degrees: float, x: float) -> None:
    turned = Transform((x, height, 0.0), axis_angle((1, 1, 0.3), degrees), 0.3)
    made = Add(tuple(scene(("vase", cube(), turned)).nodes.values()))(ROOM)
    low, high = exact_bounds(Move(dropped(made, ("vase",)))(made), ("vase",)) or ((), ())
    carried = 1.0 if x + (high[0] - low[0]) * 0.46 > 0.5 else 0.0
    assert low[1] == pytest.approx(carried, abs=1e-6)


def test_what_is_dropped_together_stays_a_stack() -> None:
    meshes = (("low", cube(), Transform((0, 2.0, 0))), ("high", cube(), Transform((0.1, 3.5, 0))))
    made = Add(tuple(scene(*meshes).nodes.values()))(ROOM)
    after = Move(dropped(made, ("high", "low")))(made)
    assert [after.world(n).translation[1] for n in ("low", "high")] == pytest.approx([0.5, 1.5])
    alone = Move(dropped(scene(*meshes), ("low",)))(made)
    assert alone.world("low").translation[1] == pytest.approx(0.5), "a floor without a mesh"


triangles = st.integers(0, 2**32).map(np.random.default_rng)


@settings(max_examples=60)
@given(triangles, st.floats(0, 360))
def test_as_every_triangle_one_by_one(dice: np.random.Generator, degrees: float) -> None:
    positions = dice.uniform(-2, 2, (60, 3)).astype(np.float32)
    positions[:, 1] *= 0.1
    faces = dice.integers(0, 60, (80, 3)).astype(np.uint32)
    world = Transform((0.3, 0.2, -0.1), axis_angle((0, 1, 0.1), degrees), 1.3)
    made = scene(("mesh", Geometry(positions, faces), world))
    matrix = world.matrix()
    corners = (positions @ matrix[:3, :3].T + matrix[:3, 3])[faces]
    ground = Ground(made)
    points = dice.uniform(-2, 2, (12, 3))
    for point, height in zip(points, ground.below(points), strict=True):
        assert height == pytest.approx(height_below(corners, point), abs=1e-6)
    for start in dice.uniform(-3, 3, (4, 3)):
        for goal in dice.uniform(-1.5, 1.5, (3, 3)) - (0.0, 4.0, 0.0):
            towards = (goal - start) / np.linalg.norm(goal - start)
            seat, expected = ground.along(start, towards), first_level(corners, start, towards)
            if towards[1] > -1e-6:
                assert seat is None
                continue
            distance = np.inf if seat is None else float((seat.at - start) @ towards)
            assert distance == pytest.approx(expected, abs=1e-6)
