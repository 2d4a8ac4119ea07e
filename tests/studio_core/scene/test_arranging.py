"""Aligning, spreading, standing: the boxes say whether it worked."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scenes import cube, little_scene

from studio_core.edits import Add, Move
from studio_core.scene.arranging import Side, aligned, distributed, placed, scaled, stood, turned
from studio_core.scene.bounds import exact_bounds
from studio_core.scene.nodes import Group, MeshObject, Node, Scene
from studio_core.scene.transform import Transform, axis_angle

place = st.tuples(*[st.floats(-5, 5)] * 3)
transforms = st.builds(
    lambda where, degrees, size: Transform(where, axis_angle((1, 2, 0.5), degrees), size),
    place,
    st.floats(-180, 180),
    st.floats(0.2, 3),
)
scenes = st.lists(transforms, min_size=1, max_size=5).map(lambda found: row(*found))


def row(*transforms: Transform) -> Scene:
    """Cubes, the last one in a group of its own that is turned and scaled."""
    nodes: list[Node] = [
        Group(id="group", name="Group", transform=Transform((1, 1, 1), axis_angle((0, 1, 0), 50), 2.0))
    ]
    for index, transform in enumerate(transforms):
        parent = "group" if index == len(transforms) - 1 else None
        nodes.append(
            MeshObject(
                id=f"c{index}",
                name=f"Cube {index}",
                parent=parent,
                geometry=cube(),
                materials=("paint",),
                transform=transform,
            )
        )
    return Add(tuple(nodes))(little_scene())


def cubes(scene: Scene) -> tuple[str, ...]:
    return tuple(n.id for n in scene.of(MeshObject) if n.id.startswith("c") and n.id[1:].isdigit())


def box(scene: Scene, node: str) -> np.ndarray:
    found = exact_bounds(scene, (node,))
    assert found is not None
    return np.stack(found)


@given(scenes, st.integers(0, 2), st.sampled_from(["low", "middle", "high"]))
def test_aligned_boxes_agree_and_nothing_else_changes(scene: Scene, axis: int, side: Side) -> None:
    nodes = cubes(scene)
    made = Move(aligned(scene, nodes, axis, side))(scene)

    def at(scene: Scene, node: str) -> float:
        low, high = box(scene, node)[:, axis]
        return {"low": low, "middle": (low + high) / 2, "high": high}[side]

    for node in nodes:
        assert at(made, node) == pytest.approx(at(made, nodes[0]), abs=1e-9)
        others = [other for other in range(3) if other != axis]
        assert np.allclose(box(made, node)[:, others], box(scene, node)[:, others], atol=1e-9)
    around = np.stack([box(scene, node) for node in nodes])
    if side == "low":
        assert at(made, nodes[0]) == pytest.approx(around[:, 0, axis].min(), abs=1e-9)


@given(scenes, st.integers(0, 2))
def test_distributed_boxes_have_equal_gaps_and_the_ends_stay(scene: Scene, axis: int) -> None:
    nodes = cubes(scene)
    moves = distributed(scene, nodes, axis)
    made = Move(moves)(scene)
    order = sorted(nodes, key=lambda n: float(box(scene, n)[:, axis].sum()))
    if len(nodes) < 3:
        assert moves == {}
        return
    gaps = [box(made, b)[0, axis] - box(made, a)[1, axis] for a, b in itertools.pairwise(order)]
    assert gaps == pytest.approx([gaps[0]] * len(gaps), abs=1e-8)
    assert made[order[0]] is scene[order[0]]
    assert made[order[-1]] is scene[order[-1]]


@given(scenes, st.floats(-3, 3))
def test_what_stands_has_its_lowest_vertex_there(scene: Scene, height: float) -> None:
    nodes = cubes(scene)
    made = Move(stood(scene, nodes, lambda *_: height))(scene)
    for node in nodes:
        assert box(made, node)[0, 1] == pytest.approx(height, abs=1e-9)
        assert np.allclose(box(made, node)[:, [0, 2]], box(scene, node)[:, [0, 2]], atol=1e-9)


@given(scenes, place, st.floats(-180, 180), st.floats(0.2, 4))
def test_turning_and_scaling_leave_the_pivot(
    scene: Scene, pivot: tuple[float, float, float], degrees: float, factor: float
) -> None:
    nodes = cubes(scene)
    there = np.array([*pivot, 1.0])
    for made in (turned(scene, nodes, degrees, pivot, (1, 1, 0)), scaled(scene, nodes, factor, pivot)):
        after = Move(made)(scene)
        for node in nodes:
            local = np.linalg.solve(scene.world(node).matrix(), there)
            assert after.world(node).matrix() @ local == pytest.approx(there, abs=1e-5)
    bigger = Move(scaled(scene, nodes, factor, pivot))(scene)
    for node in nodes:
        assert bigger.world(node).scale == pytest.approx(factor * scene.world(node).scale)


def test_a_place_in_the_world_is_kept_under_a_parent() -> None:
    scene = row(Transform(), Transform())
    goal = Transform((4.0, 5.0, 6.0))
    made = Move(placed(scene, {"c1": goal}))(scene)
    assert np.allclose(made.world("c1").matrix(), goal.matrix(), atol=1e-12)
