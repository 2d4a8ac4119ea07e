"""Boxes around what is in a scene."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scenes import cube, little_scene

from studio_core.edits import Add, SetFields
from studio_core.scene.bounds import exact_bounds, mesh_box
from studio_core.scene.nodes import Group, MeshObject, PointLamp, Scene
from studio_core.scene.transform import Transform, axis_angle, vec3


def scene(transform: Transform) -> Scene:
    nodes = (
        Group(id="group", name="Group", transform=transform),
        MeshObject(id="box", name="Box", parent="group", geometry=cube(2.0), materials=("paint",)),
        PointLamp(id="lamp", name="Lamp", parent="group", transform=Transform((9.0, 0.0, 0.0))),
    )
    return Add(nodes)(little_scene())


@given(st.floats(-180, 180), st.sampled_from([(1, 0, 0), (0, 1, 0), (1, 2, 3)]), st.floats(0.1, 5))
def test_a_box_touches_the_outermost_vertices(
    degrees: float, axis: tuple[int, int, int], size: float
) -> None:
    made = scene(Transform(vec3((1, 2, 3)), axis_angle(axis, degrees), size))
    matrix = made.world("box").matrix()
    points = cube(2.0).positions @ matrix[:3, :3].T + matrix[:3, 3]
    low, high = mesh_box(made, "box")
    assert low == pytest.approx(points.min(axis=0), abs=1e-6)
    assert high == pytest.approx(points.max(axis=0), abs=1e-6)


def test_lamps_count_where_there_is_no_mesh_and_what_is_hidden_never() -> None:
    made = scene(Transform((0.0, 5.0, 0.0)))
    found = exact_bounds(made, ("group",))
    assert found is not None
    assert np.allclose(found, [(-1, 4, -1), (1, 6, 1)])
    lamp = exact_bounds(made, ("lamp",))
    assert lamp is not None
    assert np.allclose(lamp, [(9, 5, 0), (9, 5, 0)])
    assert exact_bounds(SetFields("group", {"hidden": True})(made), ("box", "lamp")) is None
    assert exact_bounds(made, ()) is None
    with pytest.raises(TypeError, match="no mesh"):
        mesh_box(made, "lamp")
