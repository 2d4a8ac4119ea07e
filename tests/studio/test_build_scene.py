"""`lucarne new`: texts to scenes, and the scenes that come of models."""

from __future__ import annotations

import argparse
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from scenes import little_scene

import studio.build_scene
from studio.build_scene import MeshRequest, build, floor, load_model, parse_camera, set_material
from studio.cli import parser
from studio.verbs_pictures import parse_size
from studio_core.contract import ImportedModel
from studio_core.errors import InputError, LucarneError
from studio_core.imaging.encode import write_exr
from studio_core.registry import PluginHost
from studio_core.scene.bounds import scene_bounds
from studio_core.scene.nodes import Camera, Environment, MeshObject, Scene
from studio_core.session import View
from studio_core.shading.offline import scene_view
from studio_plugins.brdfs import plugin as brdfs

TRIANGLE = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"
HOST = PluginHost([brdfs])

numbers = st.floats(-1e5, 1e5).map(lambda x: f"{x:.6g}")
texts = st.text(st.sampled_from("0123456789.,-+einfa@:=xX/#µ \n"), max_size=40) | st.text(max_size=40)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A triangle, with material and without."""
    (tmp_path / "tri.obj").write_text(TRIANGLE)
    (tmp_path / "two.obj").write_text(
        "mtllib two.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\n"
        "o left\nusemtl red\nf 1 2 3\no right\nusemtl blue\nf 1 4 3\n"
    )
    (tmp_path / "two.mtl").write_text("newmtl red\nKd 1 0 0\nnewmtl blue\nKd 0 0 1\n")
    return tmp_path


def made(host: PluginHost, *arguments: object) -> tuple[Scene, list[str]]:
    """What `lucarne new` makes of options."""
    options: argparse.Namespace = parser().parse_args(["new", "x.lucarne", *map(str, arguments)])
    return build(options, host)


# --- texts --------------------------------------------------------------------------------------------


def test_a_mesh_without_a_place_stands_at_the_origin() -> None:
    request = MeshRequest.parse("a/sofa.obj")
    assert request.path == Path("a/sofa.obj")
    assert np.array_equal(request.transform.matrix(), np.eye(4))


def test_a_mesh_is_scaled_turned_and_moved() -> None:
    request = MeshRequest.parse("sofa.obj@1,2,3,90,0.5")
    corner = request.transform.matrix() @ (0, 0, 2, 1)  # +z turns to +x
    assert corner == pytest.approx([2, 2, 3, 1])


def test_the_last_at_sign_parts_the_name_from_the_numbers(tmp_path: Path) -> None:
    assert MeshRequest.parse("me@home/sofa.obj@1,2,3").path == Path("me@home/sofa.obj")
    there = tmp_path / "me@home.obj"
    there.write_text(TRIANGLE)
    assert MeshRequest.parse(str(there)).path == there
    assert MeshRequest.parse(f"{there}@1,2,3").path == there


@given(texts)
@example("a@1,2,3,4,1e-400")
@example("@1,2,3")
@example("a@1,2,3\n")
@example("a@" + ",".join(["1"] * 1000))
def test_any_text_is_a_mesh_or_refused(text: str) -> None:
    try:
        request = MeshRequest.parse(text)
    except LucarneError:
        return
    assert np.isfinite(request.transform.matrix()).all()
    assert request.transform.scale > 0


@given(texts | st.tuples(texts, texts, texts).map(lambda t: f"from={t[0]}:to={t[1]}:fov={t[2]}"))
@example("from=0,0,0:to=0,1e-320,0")
@example("from=0,1,0:to=0,0,0")
@example("from=1e6,1e6,1e6:to=-1e6,-1e6,-1e6")
@example("from=0,0,0:to=1e-300,0,0:fov=45")
@example("from=5,0,0:to=5.0000000000000001,0,0")
def test_any_text_is_a_camera_or_refused(text: str) -> None:
    try:
        transform, fov, focus = parse_camera(text)
    except LucarneError:
        return
    assert np.isfinite(transform.matrix()).all()
    assert 1 <= fov <= 170
    assert 0 < focus < math.inf


@given(st.tuples(numbers, numbers, numbers), st.tuples(numbers, numbers, numbers), st.floats(1, 170))
def test_a_camera_stands_at_from_and_looks_at_to(
    eye: tuple[str, ...], target: tuple[str, ...], fov: float
) -> None:
    a, b = np.array(eye, float), np.array(target, float)
    if np.linalg.norm(a - b) < 1e-3:
        return
    transform, angle, focus = parse_camera(f"to={','.join(target)}:fov={fov}:from={','.join(eye)}")
    assert angle == fov
    assert transform.translation == pytest.approx(a)
    seen = transform.matrix() @ (0, 0, -focus, 1)
    assert seen[:3] == pytest.approx(b, abs=1e-9 * (1 + np.abs(a).max() + focus) * 1e3)


@given(texts)
@example("1٣x5")
@example("१x२")
@example("5x5x5")
@example("1_0x1_0")
@example("9" * 5000 + "x1")
def test_any_text_is_a_size_or_refused(text: str) -> None:
    try:
        width, height = parse_size(text)
    except LucarneError:
        return
    assert 1 <= width <= 16384
    assert 1 <= height <= 16384


@given(
    texts
    | st.tuples(st.sampled_from(["lambert", "ggx", "phong", ""]), texts).map(lambda t: f"Cube={t[0]}:{t[1]}")
)
@example("Cube=ggx:roughness=nan")
@example("Cube=ggx:roughness=0.2,,base_color=#80ff00")
@example("=")
@example("Cube=")
def test_any_text_is_a_material_or_refused(text: str) -> None:
    before = little_scene()
    try:
        after = set_material(before, text, HOST)
    except LucarneError:
        return
    node = after["cube"]
    assert isinstance(node, MeshObject)
    assert after.material(node.materials[0]).model in ("lambert", "ggx", "phong")
    assert after["floor"] is before["floor"]


# --- scenes -------------------------------------------------------------------------------------------


def test_nothing_makes_a_camera_alone(host: PluginHost) -> None:
    scene, notes = made(host)
    assert [type(node) for node in scene.nodes.values()] == [Camera]
    assert notes == []


def test_everything_at_once(host: PluginHost, folder: Path) -> None:
    pixels = np.ones((4, 8, 3), np.float32)
    pixels[0, 0] = -1
    write_exr(folder / "sky.exr", pixels)
    scene, notes = made(
        host,
        *("--mesh", f"{folder / 'tri.obj'}@1,0,2,0,10", "--mesh", f"{folder / 'tri.obj'}@-1,0,0"),
        *("--env", folder / "sky.exr", "--floor", "6", "--unit", "cm"),
        *("--material", "Floor=ggx:roughness=0.25,base_color=0.1/0.2/0.3"),
        *("--camera", "from=0,1,5:to=0,0,0:fov=30"),
    )
    names = [node.name for node in scene.nodes.values()]
    assert names == ["Camera", "tri", "tri 2", "Floor", "sky"]
    first, second = scene.named("tri"), scene.named("tri 2")
    assert isinstance(first, MeshObject)
    assert isinstance(second, MeshObject)
    assert scene.world(first.id).matrix() @ (*first.geometry.positions[1], 1) == pytest.approx([1.1, 0, 2, 1])
    assert scene.world(second.id).matrix() @ (*second.geometry.positions[1], 1) == pytest.approx(
        [-0.99, 0, 0, 1]
    )
    (material,) = scene.named("Floor").materials  # type: ignore[attr-defined]
    assert scene.material(material).model == "ggx"
    assert scene.material(material).values == {"roughness": 0.25, "base_color": (0.1, 0.2, 0.3)}
    assert len(scene.materials) == 3  # the floor's first one is gone
    (note,) = notes
    assert note.startswith("sky.exr: ")
    assert (next(scene.of(Environment)).image.pixels >= 0).all()


def test_the_default_camera_shows_everything(host: PluginHost, folder: Path) -> None:
    scene, _ = made(host, "--mesh", f"{folder / 'tri.obj'}@50,3,-8,0,2", "--floor", "3")
    camera = next(scene.of(Camera))
    view = View.of(camera, scene, 960, 540)
    low, high = scene_bounds(scene)
    corners = np.array(
        [[x, y, z, 1] for x in (low[0], high[0]) for y in (low[1], high[1]) for z in (low[2], high[2])]
    )
    seen = corners @ np.linalg.inv(view.transform.matrix()).T
    up = np.tan(np.radians(view.fov) / 2) * -seen[:, 2]
    assert (seen[:, 2] < 0).all()
    assert (np.abs(seen[:, 1]) <= up).all()
    assert (np.abs(seen[:, 0]) <= up * 960 / 540).all()


def test_a_camera_that_is_asked_for_comes_before_those_of_models(
    host: PluginHost, monkeypatch: pytest.MonkeyPatch
) -> None:
    """No importer of ours reads cameras; one of a plugin may."""
    room = little_scene()
    model = ImportedModel(tuple(room.nodes.values()), tuple(room.materials.values()))
    monkeypatch.setattr(studio.build_scene, "load_model", lambda *_: model)
    scene, _ = made(host, "--mesh", "room.set")
    assert [camera.name for camera in scene.of(Camera)] == ["Camera"]
    brought = scene_view(scene, None, 8, 8).transform.translation
    assert brought == pytest.approx((2.5, 1.8, 3.2))
    scene, _ = made(host, "--mesh", "room.set", "--camera", "from=9,9,9:to=0,0,0")
    assert [camera.name for camera in scene.of(Camera)] == ["Camera 2", "Camera"]
    assert scene_view(scene, None, 8, 8).transform.translation == (9, 9, 9)
    assert scene_view(scene, "Camera", 8, 8).transform.translation == brought


def test_a_material_is_for_the_node_and_all_under_it(host: PluginHost, folder: Path) -> None:
    scene, _ = made(host, "--mesh", folder / "two.obj", "--floor", "2", "--material", "two=phong:exponent=20")
    top = scene.named("two")
    under = [scene[node] for node in scene.subtree(top.id) if isinstance(scene[node], MeshObject)]
    models: set[Any] = {scene.material(slot).model for node in under for slot in node.materials}  # type: ignore[attr-defined]
    assert len(under) == 2
    assert models == {"phong"}
    assert sorted(material.model for material in scene.materials.values()) == ["lambert", "phong"]


def test_a_material_for_a_camera_is_refused(host: PluginHost) -> None:
    with pytest.raises(InputError, match="'Camera' has no mesh"):
        set_material(little_scene(), "Camera=ggx", host)


def test_the_floor_is_flat_faces_up_and_is_textured_by_the_metre() -> None:
    node, _ = floor(3.0)
    geometry = node.geometry
    a, b, c = (geometry.positions[geometry.faces[:, k]] for k in range(3))
    cross = np.cross(b - a, c - a)
    assert (cross[:, 1] > 0).all()
    assert np.abs(cross).sum() / 2 == pytest.approx(9)
    assert geometry.positions[:, 1].tolist() == [0, 0, 0, 0]
    assert geometry.uvs is not None
    assert np.ptp(geometry.uvs, axis=0).tolist() == [3, 3]


def test_unknown_files_are_named_with_what_is_known(host: PluginHost) -> None:
    with pytest.raises(InputError, match=r"chair\.dwg cannot be imported: .*\.glb, \.gltf, .*\.stl"):
        load_model(Path("chair.dwg"), host)


def test_capital_letters_do_not_matter_to_the_kind_of_file(host: PluginHost, folder: Path) -> None:
    (folder / "tri.obj").rename(folder / "TRI.OBJ")
    assert len(load_model(folder / "TRI.OBJ", host).nodes) == 1
