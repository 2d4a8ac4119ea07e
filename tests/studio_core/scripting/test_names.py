"""The names of scripts: found as a person would find them, and each change an edit of the document."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scenes import little_scene as make_little_scene

from studio_core.contract import Services
from studio_core.document import Document
from studio_core.edits import Add, Reparent, SetFields
from studio_core.errors import EditError, InputError
from studio_core.parallel import Workers
from studio_core.project.store import load, save
from studio_core.registry import PluginHost
from studio_core.scene.nodes import Camera, Environment, Group, Material, MeshObject, Scene
from studio_core.scene.transform import Transform, axis_angle, looking
from studio_core.scripting import Names
from studio_core.session import Session, View

Make = Callable[..., Scene]


@pytest.fixture
def names(little_scene: Make, host: PluginHost, workers: Workers) -> Names:
    """Names over a document with a cube, in a turned group, twice: `Set/Cube` and `Cube`."""
    scene = little_scene()
    inner = MeshObject(
        id="inner", name="Cube", parent="set", geometry=scene["cube"].geometry, materials=("paint",)
    )
    turned = Transform((1.0, 0.0, 2.0), axis_angle((0, 1, 0), 30.0), 2.0)
    scene = Add((Group(id="set", name="Set", transform=turned), inner))(scene)
    return Names(Document(scene), Session(), host, lambda: Services(workers, host))


def world(names: Names, thing: Any) -> np.ndarray:
    return np.array(names.scene.world(names.find(thing).id).translation)


def test_things_are_found_by_id_name_path_and_other_case(names: Names) -> None:
    assert names.find("cube").id == "cube"
    assert names.find("Set/Cube").id == "inner"
    assert names.find("set").name == "Set"
    assert names.find("SET").id == "set"
    assert names.find(names.find("inner")).id == "inner"
    assert names.material("PAINT").id == "paint"
    assert [node.id for node in names.find_all("c*", MeshObject)] == ["cube", "inner"]
    assert [node.id for node in names.find_all("set/*")] == ["inner"]
    assert [one.id for one in names.materials("pai*")] == ["paint"]
    assert len(names.find_all()) == len(names.scene.nodes)


def test_what_is_not_there_is_answered_with_what_is_like_it(names: Names) -> None:
    with pytest.raises(EditError, match="no node named 'Cbue'; did you mean 'Cube'"):
        names.find("Cbue")
    with pytest.raises(EditError, match="no material named 'Paintt'; did you mean 'Paint'"):
        names.material("Paintt")
    with pytest.raises(EditError, match="is no camera; known: "):
        names.look_through("cube")


@given(
    to=st.tuples(*[st.floats(-50, 50)] * 3),
    by=st.tuples(*[st.floats(-50, 50)] * 3),
    angle=st.floats(-180, 180),
)
def test_moves_are_in_the_world_whatever_a_thing_hangs_under(
    to: tuple[float, ...], by: tuple[float, ...], angle: float
) -> None:
    scene = make_little_scene()
    tilted = Transform((1.0, 3.0, 2.0), axis_angle((1, 2, 0.5), angle), 0.5)
    scene = Add((Group(id="set", name="Set", transform=tilted),))(scene)
    scene = Reparent(("cube",), "set")(scene)
    names = Names(Document(scene), Session(), PluginHost(), lambda: pytest.fail("nothing is rendered"))
    names.move("cube", to=to)
    assert np.allclose(world(names, "cube"), to, atol=1e-9)
    names.move("cube", by=by)
    assert np.allclose(world(names, "cube"), np.add(to, by), atol=1e-9)
    before = names.bounds("cube")
    names.turn("cube", 360.0)
    assert np.allclose(names.bounds("cube"), before, atol=1e-6)


def test_turning_keeps_the_middle(names: Names) -> None:
    middle = np.mean(names.bounds("Set"), axis=0)
    names.turn("Set", 90.0)
    assert np.allclose(np.mean(names.bounds("Set"), axis=0), middle, atol=1e-6)
    size = names.size("cube")
    names.turn("cube", 90.0)
    assert names.size("cube") == pytest.approx((size.depth, size.width, size.height), abs=1e-6)


def test_copies_share_their_mesh(names: Names) -> None:
    copy = names.copy("Set", by=(0.0, 0.0, 1.5))
    assert np.allclose(world(names, copy) - world(names, "set"), (0.0, 0.0, 1.5))
    (inner,) = names.scene.children(copy.id)
    assert inner.geometry is names.scene["inner"].geometry


def test_every_change_is_an_edit_that_undo_takes_back(names: Names) -> None:
    before = names.scene
    names.change("Cube", hidden=True, name="Box")
    assert names.scene["cube"].hidden
    names.change("Paint", base_color=(0.1, 0.2, 0.3), name="Red")
    names.change(names.material("Red"), model="ggx", roughness=0.25, opacity=0.75)
    made = names.scene.material("paint")
    assert (made.name, made.model, made.opacity, made.values["roughness"]) == ("Red", "ggx", 0.75, 0.25)
    names.remove("Set")
    assert "inner" not in names.scene.nodes
    names.undo(4)
    assert names.scene is before
    names.redo(2)
    assert names.scene.material("paint").name == "Red"


@pytest.mark.parametrize(
    ("values", "why"),
    [({"base_colr": (0, 0, 0)}, "no parameter 'base_colr'; known: base_color"), ({"opacity": 2}, "0 to 1")],
)
def test_values_that_do_not_fit_are_refused(names: Names, values: dict[str, Any], why: str) -> None:
    before = names.scene
    with pytest.raises((EditError, InputError), match=why):
        names.change("Paint", **values)
    assert names.scene is before


def test_materials_are_replaced_everywhere(names: Names) -> None:
    names.apply(Add((), (Material(id="blue", name="Blue"),)))
    users = [node for node in names.scene.of(MeshObject) if "paint" in node.materials]
    assert names.replace_material("Paint", "Blue") == len(users) == 2
    assert all("paint" not in node.materials for node in names.scene.of(MeshObject))
    names.assign("Set", "Paint")
    assert names.scene["inner"].materials == ("paint",)
    assert names.scene["cube"].materials == ("blue",)
    with pytest.raises(EditError, match="has no mesh"):
        names.assign(next(names.scene.of(Camera)), "Paint")


def test_the_scene_among_the_names_is_the_current_one(names: Names) -> None:
    assert names.namespace["scene"] is names.scene
    names.apply(SetFields("cube", {"name": "Box"}))
    assert names.namespace["scene"] is names.scene
    names.undo()
    assert names.namespace["scene"]["cube"].name == "Cube"
    names.close()
    names.redo()
    assert names.namespace["scene"] is not names.scene


def test_choosing_and_looking(names: Names) -> None:
    names.select("Set/Cube", names.find("cube"))
    assert [node.id for node in names.selected()] == ["inner", "cube"]
    names.remove("Set")
    assert [node.id for node in names.selected()] == ["cube"]
    camera = next(names.scene.of(Camera))
    names.look_through(camera)
    session = names.namespace["session"]
    assert session.view == View.of(camera, names.scene, session.view.width, session.view.height)


def test_a_model_stands_where_it_is_put(names: Names, tmp_path: Path) -> None:
    file = tmp_path / "board.obj"
    file.write_text("v 10 5 0\nv 30 5 0\nv 30 25 0\nf 1 2 3\n")
    made = names.add_model(file, at=(1.0, 0.5, 2.0), unit=0.01)
    low, high = names.bounds(made)
    assert np.allclose(low, (0.9, 0.5, 2.0), atol=1e-6)
    assert np.allclose(high, (1.1, 0.7, 2.0), atol=1e-6)
    assert names.size(made) == pytest.approx((0.2, 0.0, 0.2), abs=1e-6)
    with pytest.raises(InputError, match="cannot be imported"):
        names.add_model(tmp_path / "board.xyz")


def test_a_measured_material_comes_from_a_file(names: Names, tmp_path: Path) -> None:
    from studio_core.brdfs import merl

    merl.write(tmp_path / "felt.binary", np.full((*merl.SHAPE, 3), 0.1))
    made = names.add_model(tmp_path / "felt.binary")
    assert (made.name, made.model) == ("felt", "measured")
    assert names.material("felt") is made


def test_pictures_of_light_keep_the_settings(names: Names, tmp_path: Path) -> None:
    from studio_core.imaging.encode import write_exr

    write_exr(tmp_path / "noon.exr", np.full((8, 16, 3), 0.5, np.float32))
    old = next(names.scene.of(Environment))
    names.change(old, azimuth=30.0)
    names.light_from(tmp_path / "noon.exr")
    new = next(names.scene.of(Environment))
    assert (new.id, new.name, new.azimuth) == (old.id, "noon", 30.0)
    names.remove(new)
    assert names.light_from(tmp_path / "noon.exr").id in names.scene.nodes


def test_pictures_are_rendered_from_cameras_and_from_the_view(names: Names, tmp_path: Path) -> None:
    names._session.shade_with("reference", {"directions": "1024"})
    camera = next(names.scene.of(Camera))
    one = names.picture((24, 16), camera, antialias=1)
    assert one.shape == (16, 24, 3)
    assert np.isfinite(one).all()
    assert one.max() > 0
    names._session.look(View(looking((0, 50, 0), (0, 100, 0)), width=24, height=16))
    assert not np.array_equal(names.picture((24, 16), antialias=1), one)
    path = names.render(tmp_path / "room.png", (24, 16), camera, antialias=1)
    assert path.read_bytes()[:4] == b"\x89PNG"
    with pytest.raises(InputError, match=r"written as .png or .exr"):
        names.render(tmp_path / "room.jpg")


def test_saving_is_done_by_whoever_holds_the_project(names: Names, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no project to save"):
        names.save()
    kept: list[Path | None] = []
    own = Names(names._document, Session(), names._registry, names._services, save=kept.append)
    own.save()
    assert own.save(str(tmp_path / "copy.lucarne")) == tmp_path / "copy.lucarne"
    assert kept == [None, tmp_path / "copy.lucarne"]


def test_help_tells_of_every_name(names: Names, capsys: pytest.CaptureFixture[str]) -> None:
    names.help()
    said = capsys.readouterr().out
    for name in ("find", "move", "render", "scene", "np"):
        assert f"\n  {name} " in said
    assert all(len(line) <= 115 for line in said.splitlines())
    names.help(names.namespace["move"])
    assert capsys.readouterr().out.startswith("move(thing, to=None, by=None)\nPut a thing")


def test_a_saved_scene_is_what_the_names_made(names: Names, tmp_path: Path) -> None:
    names.move("cube", by=(0.25, 0.0, 0.0))
    save(tmp_path / "a.lucarne", names.scene)
    assert load(tmp_path / "a.lucarne").scene["cube"].transform == names.scene["cube"].transform
