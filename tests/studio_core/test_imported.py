"""Models in other units and with another axis up."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from studio_core.contract import ImportedModel
from studio_core.scene.geometry import Geometry
from studio_core.scene.imported import UPRIGHT, converted, likely_up
from studio_core.scene.nodes import Camera, Group, MeshObject, Node, Scene
from studio_core.scene.size import model_size
from studio_core.scene.transform import Transform, axis_angle, rotation_matrix

TETRA = Geometry(
    np.array([[0, 0, 0], [1, 0, 0], [0, 2, 0], [0, 0, 3]], np.float32),
    np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]], np.uint32),
    np.array([[1, 0, 0], [0, 1, 0], [0, 0, 1], [0, 1, 0]], np.float32),
)
TURN = rotation_matrix(UPRIGHT)


def model(*placed: Transform) -> ImportedModel:
    """A group of instances and a camera."""
    top = Group(id="top", name="Top", transform=placed[0])
    nodes: list[Node] = [top, Camera(id="eye", name="Eye", parent="top", transform=placed[-1])]
    nodes += [
        MeshObject(id=f"m{i}", name="M", parent="top", geometry=TETRA, materials=(), transform=one)
        for i, one in enumerate(placed)
    ]
    return ImportedModel(tuple(nodes), ())


places = st.builds(
    lambda at, axis, degrees, scale: Transform(at, axis_angle(axis, degrees), scale),
    st.tuples(*[st.floats(-5, 5)] * 3),
    st.sampled_from([(1, 0, 0), (0, 1, 0), (1, 2, 3)]),
    st.floats(-180, 180),
    st.floats(0.1, 10),
)


@given(st.lists(places, min_size=1, max_size=3), st.sampled_from([1.0, 0.01, 0.0254]), st.sampled_from("yz"))
def test_every_point_goes_where_the_unit_and_the_axis_say(placed: list[Transform], unit: float, up) -> None:
    before = model(*placed)
    after = converted(before, unit, up)
    turn = TURN if up == "z" else np.eye(3)
    scenes = [Scene().with_nodes(*m.nodes) for m in (before, after)]
    for old, new in zip(before.objects, after.objects, strict=True):
        points = []
        for scene, node in zip(scenes, (old, new), strict=True):
            matrix = scene.world(node.id).matrix()
            points.append(node.geometry.positions @ matrix[:3, :3].T + matrix[:3, 3])
        assert points[1] == pytest.approx(unit * points[0] @ turn.T, abs=2e-4 * unit)
    assert len({id(node.geometry) for node in after.objects}) == 1
    looks = [scene.world("eye").matrix()[:3, 2] / scene.world("eye").scale for scene in scenes]
    assert looks[1] == pytest.approx(turn @ looks[0], abs=1e-5)


def test_normals_turn_with_the_mesh_and_nothing_is_copied_without_need() -> None:
    before = model(Transform())
    assert converted(before) is before
    turned = converted(before, up="z").objects[0].geometry.normals
    assert np.array_equal(turned, TETRA.normals @ TURN.T.round())


def test_a_unit_is_a_positive_number() -> None:
    for unit in (0.0, -1.0, float("nan"), float("inf")):
        with pytest.raises(ValueError, match="unit"):
            converted(model(Transform()), unit)


def test_what_stands_on_z_is_taken_for_z_up() -> None:
    chair = np.array([[-0.2, -0.3, 0], [0.2, -0.3, 0], [0.2, 0.3, 0], [-0.2, 0.3, 0.9]], np.float32)
    lying = Geometry(chair, TETRA.faces)
    made = ImportedModel((MeshObject(id="m", name="M", geometry=lying, materials=()),), ())
    assert likely_up(made) == "z"
    upright = converted(made, up="z")
    assert likely_up(upright) == "y"
    assert model_size(upright) == pytest.approx((0.4, 0.6, 0.9))
    assert likely_up(ImportedModel((), ())) == "y"
