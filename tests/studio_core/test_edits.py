"""Edits: what each does, what it refuses, and that it leaves its scene alone."""

from __future__ import annotations

import dataclasses
from random import Random

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from random_edits import MAKERS, Dice, random_edit
from scenes import cube, fingerprint, floor, little_scene, sky

from studio_core import copies, edits
from studio_core.arrays import frozen_map
from studio_core.errors import EditError
from studio_core.scene.geometry import Geometry, Texture
from studio_core.scene.nodes import (
    Camera,
    Environment,
    Group,
    Material,
    MeshObject,
    Node,
    PointLamp,
    Scene,
)
from studio_core.scene.transform import Transform, axis_angle

SEEDS = st.integers(0, 2**32)
AWAY = Transform((3.0, 1.0, 0.0), axis_angle((1, 1, 0), 40), 0.5)
SCENE = little_scene().with_nodes(
    Group(id="outer", name="Outer", transform=AWAY),
    Group(id="inner", name="Inner", parent="outer", transform=AWAY),
    MeshObject(
        id="chair", name="Chair", parent="inner", geometry=cube(), materials=("paint",), transform=AWAY
    ),
    PointLamp(id="lamp", name="Lamp", parent="inner"),
)


def some_scene(seed: int) -> tuple[Random, Scene]:
    rng, scene = Random(seed), little_scene()
    for serial in range(rng.randint(0, 12)):
        try:
            scene = random_edit(rng, scene, serial)(scene)
        except EditError:
            continue
    return rng, scene


def slots(*faces: int) -> Geometry:
    square = floor()
    return Geometry(square.positions, square.faces, slots=np.array(faces, np.uint16))


# ---------------------------------------------------------------- all of them


@given(SEEDS)
def test_an_edit_is_a_pure_function_that_leaves_its_scene_alone(seed: int) -> None:
    rng, scene = some_scene(seed)
    before = fingerprint(scene)
    edit = random_edit(rng, scene, 99)
    try:
        made = edit(scene)
    except EditError as error:
        assert str(error)
        assert "\n" not in str(error)
    else:
        assert fingerprint(made) == fingerprint(edit(scene))
        check_invariants(made)
    assert fingerprint(scene) == before
    assert edit.label


def check_invariants(scene: Scene) -> None:
    """What everybody who reads a scene relies on."""
    for key, node in scene.nodes.items():
        assert key == node.id
        assert node.parent is None or node.parent in scene.nodes
        chain = [parent.id for parent in scene.ancestors(key)]
        assert key not in chain
        if isinstance(node, MeshObject):
            assert len(node.materials) > int(node.geometry.slots.max())  # type: ignore[union-attr]
            assert all(material in scene.materials for material in node.materials)
    for key, material in scene.materials.items():
        assert key == material.id
        assert 0 <= material.opacity <= 1


def test_the_random_edits_of_these_tests_are_of_every_kind() -> None:
    known = {
        thing
        for thing in vars(edits).values()
        if isinstance(thing, type) and dataclasses.is_dataclass(thing) and thing.__module__ == edits.__name__
    }
    rng = Random(1)
    made = {type(maker(Dice(rng, SCENE, f"n{serial}"))) for serial, maker in enumerate(MAKERS)}
    assert made == known


# ---------------------------------------------------------------- nodes


def test_compound_is_one_after_the_other_or_nothing() -> None:
    both = edits.Compound("Both", (edits.Add((Group(id="a"),)), edits.Add((Group(id="b", parent="a"),))))
    assert both(SCENE)["b"].parent == "a"
    with pytest.raises(EditError):
        edits.Compound("Both", (edits.Add((Group(id="a"),)), edits.Remove(("b",))))(SCENE)
    assert edits.Compound("Nothing", ())(SCENE) is SCENE


def test_add_puts_nodes_and_materials_last() -> None:
    wood = Material(id="wood")
    table = MeshObject(id="table", parent="set", geometry=cube(), materials=("wood",))
    made = edits.Add((Group(id="set"), table), (wood,))(SCENE)
    assert list(made.nodes)[-2:] == ["set", "table"]
    assert made.material("wood") is wood
    assert made["cube"] is SCENE["cube"]


@pytest.mark.parametrize(
    ("nodes", "materials", "why"),
    [
        ((Group(id="cube"),), (), "node 'cube' is already in the scene"),
        ((Group(id="a"), Group(id="a")), (), "node 'a' is already in the scene"),
        ((), (Material(id="paint"),), "material 'paint' is already in the scene"),
        ((), (Material(id="a"), Material(id="a")), "material 'a' is already in the scene"),
        ((Group(id="a", parent="nobody"),), (), "no node 'nobody'"),
        ((Group(id="a", parent="a"),), (), "hang under itself"),
        ((Group(id="a", parent="b"), Group(id="b", parent="a")), (), "hang under itself"),
        ((MeshObject(id="a", geometry=cube(), materials=("x",)),), (), "no material 'x'"),
        ((MeshObject(id="a", geometry=cube(), materials=()),), (), "needs 1 materials"),
        ((MeshObject(id="a", geometry=slots(0, 2), materials=("matt",) * 2),), (), "needs 3 materials"),
    ],
)
def test_add_refuses(nodes: tuple[Node, ...], materials: tuple[Material, ...], why: str) -> None:
    with pytest.raises(EditError, match=why):
        edits.Add(nodes, materials)(SCENE)


def test_remove_takes_what_hangs_below() -> None:
    made = edits.Remove(("inner", "cube"))(SCENE)
    assert list(made.nodes) == ["floor", "camera", "sky", "outer"]
    with pytest.raises(EditError, match="no node 'nobody'"):
        edits.Remove(("nobody",))(SCENE)


def test_move_is_relative_to_the_parent() -> None:
    made = edits.Move({"chair": Transform((1.0, 2.0, 3.0))})(SCENE)
    assert made["chair"].transform == Transform((1.0, 2.0, 3.0))
    assert np.allclose(
        made.world("chair").matrix(), (AWAY @ AWAY).matrix() @ Transform((1.0, 2.0, 3.0)).matrix()
    )


@pytest.mark.parametrize(
    ("node", "values", "why"),
    [
        ("nobody", {"name": "x"}, "no node 'nobody'"),
        ("cube", {"intensity": 1.0}, "'Cube' has no property 'intensity'"),
        ("cube", {"geometry": cube()}, "no property 'geometry'"),
        ("cube", {"id": "x"}, "no property 'id'"),
        ("cube", {"parent": "outer"}, "no property 'parent'"),
        ("cube", {"hidden": "perhaps"}, "hidden = 'perhaps' does not fit"),
        ("lamp", {"intensity": -1.0}, "intensity = -1.0 does not fit"),
        ("lamp", {"intensity": float("nan")}, "not a finite number"),
        ("camera", {"fov": 0}, "expected 1 to 170 °"),
        ("sky", {"image": 3}, "image"),
        ("sky", {"luminance_scale": -2.0}, "luminance_scale"),
        ("sky", {"luminance_scale": "bright"}, "luminance_scale"),
    ],
)
def test_fields_are_checked(node: str, values: dict, why: str) -> None:
    with pytest.raises(EditError, match=why):
        edits.SetFields(node, values)(SCENE)


def test_fields_are_set() -> None:
    picture = sky(8)
    made = edits.SetFields("sky", {"image": picture, "tilt": 5, "luminance_scale": 120.0})(SCENE)["sky"]
    assert isinstance(made, Environment)
    assert made.image is picture
    assert made.tilt == 5.0
    assert made.luminance_scale == 120.0
    again = edits.SetFields("sky", {"luminance_scale": None})(SCENE)["sky"]
    assert isinstance(again, Environment)
    assert again.luminance_scale is None


@given(SEEDS)
def test_reparenting_keeps_everything_in_its_place(seed: int) -> None:
    rng, scene = some_scene(seed)
    scene = scene.with_nodes(Group(id="g", transform=AWAY), Group(id="h", parent="g", transform=AWAY))
    dice = Dice(rng, scene, "x")
    nodes, parent = dice.nodes(), rng.choice((dice.parent(), "g", "h", None))
    try:
        made = edits.Reparent(nodes, parent)(scene)
    except EditError:
        return
    for node in scene.nodes:
        before, after = scene.world(node).matrix(), made.world(node).matrix()
        size = 1 + np.abs(before).max()
        assert np.allclose(after, before, atol=1e-9 * size, rtol=1e-9)
    assert all(made[node].parent == parent for node in nodes)


@pytest.mark.parametrize(
    ("nodes", "parent"), [(("outer",), "inner"), (("outer",), "outer"), (("chair", "outer"), "inner")]
)
def test_nothing_hangs_under_itself(nodes: tuple[str, ...], parent: str) -> None:
    with pytest.raises(EditError, match="cannot hang under"):
        edits.Reparent(nodes, parent)(SCENE)


@given(SEEDS)
def test_order_moves_nodes_and_nothing_else(seed: int) -> None:
    rng, scene = some_scene(seed)
    dice = Dice(rng, scene, "x")
    nodes, before = dice.nodes(), rng.choice((None, dice.node()))
    try:
        made = edits.Order(nodes, before)(scene)
    except EditError:
        assert before in nodes or {*nodes, before} - {None} - scene.nodes.keys()
        return
    assert made.nodes == scene.nodes  # as a set of items
    order = list(made.nodes)
    end = order.index(before) if before is not None else len(order)
    assert tuple(order[end - len(nodes) : end]) == nodes
    assert [n for n in order if n not in nodes] == [n for n in scene.nodes if n not in nodes]


# ---------------------------------------------------------------- meshes and materials


def test_another_mesh_must_fit_the_slots() -> None:
    mesh = edits.SetGeometry("cube", cube(2))(SCENE)["cube"]
    assert isinstance(mesh, MeshObject)
    assert np.array_equal(mesh.geometry.bounds, [(-1, -1, -1), (1, 1, 1)])
    with pytest.raises(EditError, match="'Cube' needs 2 materials"):
        edits.SetGeometry("cube", slots(0, 1))(SCENE)
    with pytest.raises(EditError, match="'Sky' is no mesh object"):
        edits.SetGeometry("sky", cube())(SCENE)


def test_materials_are_assigned_to_one_slot_or_all() -> None:
    two = MeshObject(id="two", name="Two", geometry=slots(0, 1), materials=("matt", "matt"))
    scene = SCENE.with_nodes(two)

    def assigned(slot: int | None) -> tuple[str, ...]:
        node = edits.Assign("two", "paint", slot)(scene)["two"]
        assert isinstance(node, MeshObject)
        return node.materials

    assert assigned(None) == ("paint", "paint")
    assert assigned(1) == ("matt", "paint")
    for wrong in (2, -1):
        with pytest.raises(EditError, match="no material slot"):
            assigned(wrong)
    with pytest.raises(EditError, match="no material 'gold'"):
        edits.Assign("two", "gold")(scene)


def test_a_material_in_use_stays() -> None:
    with pytest.raises(EditError, match="still used by Cube, Chair"):
        edits.RemoveMaterial("paint")(SCENE)
    spare = edits.AddMaterial(Material(id="spare"))(SCENE)
    assert edits.RemoveMaterial("spare")(spare).materials == SCENE.materials
    with pytest.raises(EditError, match="already in the scene"):
        edits.AddMaterial(Material(id="spare"))(spare)


def test_values_stay_with_their_model() -> None:
    glossy = edits.SetMaterial("paint", frozen_map({"roughness": 0.2}), "ggx", "Lacquer", 0.9)(SCENE)
    more = edits.SetMaterial("paint", frozen_map({"metallic": 1.0}))(glossy).material("paint")
    assert (more.model, more.name, more.opacity) == ("ggx", "Lacquer", 0.9)
    assert dict(more.values) == {"roughness": 0.2, "metallic": 1.0}
    other = edits.SetMaterial("paint", frozen_map({"metallic": 1.0}), "phong")(glossy).material("paint")
    assert dict(other.values) == {"metallic": 1.0}
    with pytest.raises(EditError, match="opacity = 2"):
        edits.SetMaterial("paint", opacity=2.0)(SCENE)


def test_textures_come_and_go() -> None:
    texture = Texture(sky(8))
    made = edits.SetTexture("paint", "base_color", texture)(SCENE)
    assert dict(made.material("paint").textures) == {"base_color": texture}
    assert not edits.SetTexture("paint", "base_color", None)(made).material("paint").textures


# ---------------------------------------------------------------- duplicates


@pytest.mark.parametrize(
    "edit",
    [
        edits.Add(()),
        edits.Remove(()),
        edits.Move({}),
        edits.Move({"cube": Transform((0.0, 0.5, 0.0))}),
        edits.SetFields("cube", {"name": "Cube", "hidden": False}),
        edits.SetFields("lamp", {"intensity": 1, "tint": [1, 1, 1]}),
        edits.Reparent(("chair",), "inner"),
        edits.Order(("chair",), "lamp"),
        edits.Order((), None),
        edits.SetGeometry("cube", SCENE["cube"].geometry),
        edits.Assign("cube", "paint"),
        edits.Assign("cube", "paint", 0),
        edits.SetMaterial("matt", {"base_color": (0.5, 0.5, 0.5)}),
        edits.SetMaterial("matt", model="lambert", name="Matt", opacity=1.0),
        edits.SetTexture("matt", "base_color", None),
        edits.Compound("Nothing", (edits.Remove(()), edits.Move({}))),
    ],
    ids=repr,
)
def test_what_changes_nothing_gives_the_same_scene(edit: edits.Edit) -> None:
    assert edit(SCENE) is SCENE


@pytest.mark.parametrize(("above", "scale"), [(1e-320, 1.0), (1e-200, 1e200), (1e200, 1e-200)])
def test_absurd_scales_are_refused_in_a_sentence(above: float, scale: float) -> None:
    scene = SCENE.with_nodes(
        Group(id="far", name="Far", transform=Transform((1.0, 0.0, 0.0), scale=above)),
        Group(id="own", name="Own", transform=Transform((1e200, 0.0, 0.0), scale=scale)),
    )
    with pytest.raises(EditError, match="'Own' cannot hang"):
        edits.Reparent(("own",), "far")(scene)


def test_duplicates_share_meshes_and_hang_together() -> None:
    add = copies.duplicate(SCENE, ("outer", "chair"), offset=Transform((1.0, 0.0, 0.0)))
    made = add(SCENE)
    new = [made[n] for n in made.nodes if n not in SCENE.nodes]
    assert [type(n).__name__ for n in new] == ["Group", "Group", "MeshObject", "PointLamp"]
    assert [n.name for n in new] == ["Outer 2", "Inner", "Chair", "Lamp"]
    outer, inner, chair, lamp = new
    assert (outer.parent, inner.parent, chair.parent, lamp.parent) == (None, outer.id, inner.id, inner.id)
    original = SCENE["chair"]
    assert isinstance(chair, MeshObject)
    assert isinstance(original, MeshObject)
    assert chair.geometry is original.geometry
    moved = Transform((1.0, 0.0, 0.0)).matrix() @ SCENE.world("chair").matrix()
    assert np.allclose(made.world(chair.id).matrix(), moved)


def test_copies_are_numbered_from_the_first_free_name() -> None:
    scene = Scene().with_nodes(Camera(id="a", name="Front"), Camera(id="b", name="Front 2"))
    assert copies.duplicate(scene, ("a",)).nodes[0].name == "Front 3"
    assert copies.duplicate(scene, ("b",)).nodes[0].name == "Front 3"


def test_copies_can_have_materials_of_their_own() -> None:
    plain = copies.duplicate(SCENE, ("outer",))
    assert plain.materials == ()
    own = copies.duplicate(SCENE, ("outer", "lamp"), own_materials=True)
    made = own(SCENE)
    (chair,) = [n for n in own.nodes if isinstance(n, MeshObject)]
    (paint,) = own.materials
    assert chair.materials == (paint.id,)
    assert chair.geometry is SCENE["chair"].geometry  # type: ignore[attr-defined]
    assert paint.name not in {m.name for m in SCENE.materials.values()}
    assert dataclasses.replace(paint, id="paint", name=SCENE.material("paint").name) == SCENE.material(
        "paint"
    )
    assert made["chair"] is SCENE["chair"]


def test_copies_of_several_have_several_names() -> None:
    two = SCENE.with_nodes(
        Group(id="a", name="Chair"), Group(id="b", name="Chair"), Group(id="c", name="Chair 2")
    )
    names = [node.name for node in copies.duplicate(two, ("a", "b", "c")).nodes]
    assert names == ["Chair 3", "Chair 4", "Chair 5"]


def test_a_material_is_made_its_own_only_where_others_use_it() -> None:
    other = MeshObject(id="other", name="Other", geometry=cube(), materials=("paint",))
    both = edits.Add((other,))(SCENE)
    made = copies.with_own_materials(both, ("outer",))(both)
    (mine,) = made["chair"].materials  # type: ignore[attr-defined]
    assert mine != "paint"
    assert made["other"] is both["other"]
    assert copies.with_own_materials(made, ("outer",))(made) is made, "nobody else uses it any more"
