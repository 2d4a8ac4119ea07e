"""The scene as a value: who is where, who is shown, and that nobody can change it in place."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scenes import cube, fingerprint, little_scene, sky

from studio_core.arrays import frozen_map
from studio_core.errors import EditError
from studio_core.scene.nodes import (
    Camera,
    Environment,
    Group,
    Material,
    MeshObject,
    PointLamp,
    Scene,
    new_id,
)
from studio_core.scene.transform import Transform, axis_angle

TURN = Transform((1.0, 0.0, 0.0), axis_angle((0, 1, 0), 90), 2.0)


def family(**hidden: bool) -> Scene:
    """grandmother > mother > (daughter, son); aunt beside."""
    nodes = (
        Group(id="aunt", name="Aunt"),
        Group(id="grandmother", name="Grandmother", transform=TURN),
        Group(id="mother", name="Mother", parent="grandmother", transform=TURN),
        Group(id="daughter", name="Daughter", parent="mother", transform=TURN),
        Camera(id="son", name="Son", parent="mother"),
    )
    return Scene().with_nodes(*(dataclasses.replace(n, hidden=hidden.get(n.id, False)) for n in nodes))


def test_relations() -> None:
    scene = family()
    assert [n.id for n in scene.children(None)] == ["aunt", "grandmother"]
    assert [n.id for n in scene.children("mother")] == ["daughter", "son"]
    assert [n.id for n in scene.ancestors("son")] == ["mother", "grandmother"]
    assert scene.subtree("grandmother") == ["grandmother", "mother", "daughter", "son"]
    assert scene.subtree("aunt") == ["aunt"]
    assert [n.id for n in scene.of(Camera)] == ["son"]


def test_world_is_the_product_from_the_top() -> None:
    matrix = TURN.matrix()
    assert np.allclose(family().world("daughter").matrix(), matrix @ matrix @ matrix)
    assert np.allclose(family().world("son").matrix(), matrix @ matrix)


@pytest.mark.parametrize(
    ("hidden", "shown"),
    [
        ({}, {"aunt", "grandmother", "mother", "daughter", "son"}),
        ({"mother": True}, {"aunt", "grandmother"}),
        ({"son": True}, {"aunt", "grandmother", "mother", "daughter"}),
        ({"grandmother": True, "aunt": True}, set()),
    ],
)
def test_what_hangs_under_something_hidden_is_hidden(hidden: dict[str, bool], shown: set[str]) -> None:
    scene = family(**hidden)
    assert {n for n in scene.nodes if scene.shown(n)} == shown


def test_names_and_ids_find_nodes_and_a_miss_says_what_there_is() -> None:
    scene = family()
    assert scene.named("Aunt").id == scene.named("aunt").id == "aunt"
    with pytest.raises(EditError, match="no node named 'Uncle'; the scene has 'Aunt', 'Grandmother'"):
        scene.named("Uncle")
    with pytest.raises(EditError, match="the scene has nothing"):
        Scene().named("x")
    with pytest.raises(EditError, match="no node 'x'"):
        scene["x"]
    with pytest.raises(EditError, match="no material 'x'"):
        scene.material("x")


def test_replacing_keeps_the_order_and_the_old_scene() -> None:
    old = family()
    before = fingerprint(old)
    new = old.with_nodes(Group(id="grandmother", name="Oma"), Group(id="baby"))
    assert list(new.nodes) == [*old.nodes, "baby"]
    assert new["grandmother"].name == "Oma"
    assert new["aunt"] is old["aunt"]
    assert fingerprint(old) == before != fingerprint(new)


def test_nothing_can_be_changed_in_place() -> None:
    scene = little_scene(cube_values={"base_color": (1.0, 0.0, 0.0)})
    mesh = scene["cube"]
    assert isinstance(mesh, MeshObject)
    with pytest.raises(dataclasses.FrozenInstanceError):
        mesh.hidden = True  # type: ignore[misc]
    with pytest.raises(dataclasses.FrozenInstanceError):
        scene.nodes = {}  # type: ignore[misc]
    with pytest.raises(TypeError):
        scene.nodes["x"] = mesh  # type: ignore[index]
    with pytest.raises(TypeError):
        scene.material("paint").values["base_color"] = 0  # type: ignore[index]
    with pytest.raises(ValueError, match="read-only"):
        mesh.geometry.positions[0, 0] = 7
    with pytest.raises(dataclasses.FrozenInstanceError):
        mesh.transform.scale = 3.0  # type: ignore[misc]


def test_the_fingerprint_of_these_tests_sees_every_kind_of_change() -> None:
    scene = little_scene()
    variants = [
        scene,
        little_scene(cube_size=np.nextafter(1.0, 2.0)),
        little_scene(cube_values={"roughness": 0.5}),
        little_scene(environment=sky(32, 1.0001)),
        Scene(frozen_map(dict(reversed(scene.nodes.items()))), scene.materials),
        scene.with_nodes(dataclasses.replace(scene["cube"], hidden=True)),
    ]
    assert len({fingerprint(v) for v in variants}) == len(variants)
    assert fingerprint(little_scene()) == fingerprint(scene)


@given(st.floats(0, 100), st.tuples(*[st.floats(0, 2)] * 3))
def test_gain_is_linear_in_intensity_and_tint(intensity: float, tint: tuple[float, float, float]) -> None:
    assert PointLamp(id="a", intensity=intensity, tint=tint).gain() == pytest.approx(
        tuple(intensity * t for t in tint)
    )


def test_temperature_colours_without_changing_luminance() -> None:
    red, green, blue = PointLamp(id="a", intensity=2.0, temperature=2700.0).gain()
    assert red > green > blue
    assert 0.2126 * red + 0.7152 * green + 0.0722 * blue == pytest.approx(2)


def test_an_environment_is_tilted_then_turned() -> None:
    tipped = Environment(id="e", image=sky(), azimuth=90.0, tilt=90.0).rotation().matrix()[:3, :3]
    assert np.allclose(tipped @ (0, 1, 0), (1, 0, 0))  # tilted to +z, turned to +x
    assert np.allclose(tipped @ (1, 0, 0), (0, 0, -1))


@pytest.mark.parametrize(("opacity", "casts"), [(1.0, True), (0.5, True), (0.49, False), (0.0, False)])
def test_shadows_end_at_half_opacity(opacity: float, casts: bool) -> None:
    assert Material(id="m", opacity=opacity).casts_shadow is casts


def test_instances_share_and_ids_differ() -> None:
    shared = cube()
    chairs = [MeshObject(id=new_id("chair"), geometry=shared, materials=("m",)) for _ in range(60)]
    assert len({chair.id for chair in chairs}) == 60
    assert len({id(chair.geometry.positions) for chair in chairs}) == 1
