"""What the export writes, read without Mitsuba; and that its own script renders it."""

from __future__ import annotations

import dataclasses
import subprocess
import sys
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest

from studio_core.errors import InputError
from studio_core.imaging.io import read_image
from studio_core.registry import PluginHost
from studio_core.scene.geometry import Geometry, Image, Texture
from studio_core.scene.nodes import AreaLamp, Environment, Group, Material, MeshObject, Scene, SpotLamp
from studio_core.scene.transform import Transform
from studio_core.shading.offline import scene_view
from studio_plugins.export.mitsuba import EXPORTER, MitsubaExporter
from studio_plugins.export.mitsuba_lights import resampled


def written(scene: Scene, host: PluginHost, folder: Path) -> tuple[Any, tuple[str, ...]]:
    notes = EXPORTER.save(scene, folder, host)
    return ElementTree.parse(folder / "scene.xml").getroot(), notes


def named(element: Any, name: str) -> str:
    return next(child.get("value") for child in element if child.get("name") == name)


def test_equal_meshes_are_written_once_and_instanced(room: Scene, host: PluginHost, tmp_path: Path) -> None:
    root, notes = written(room, host, tmp_path)
    assert notes == ()
    assert len(list((tmp_path / "meshes").glob("*.ply"))) == 2  # cube, quad
    groups = root.findall("shape[@type='shapegroup']")
    assert len(groups) == 1  # both red cubes; the blue one stands alone
    assert len(root.findall("shape[@type='instance']")) == 2
    assert len(root.findall("shape[@type='ply']")) == 2
    for name in ("bsdfs.py", "emitters.py", "render.py", "env.exr", "textures/0.png"):
        assert (tmp_path / name).is_file(), name


def test_an_instance_stands_where_its_parents_put_it(room: Scene, host: PluginHost, tmp_path: Path) -> None:
    root, _ = written(room, host, tmp_path)
    instance = root.findall("shape[@type='instance']")[1]
    matrix = np.array(instance.find("transform/matrix").get("value").split(), float).reshape(4, 4)
    np.testing.assert_allclose(matrix, room.world("right").matrix(), rtol=1e-6, atol=1e-7)


def test_hidden_things_are_left_out(room: Scene, host: PluginHost, tmp_path: Path) -> None:
    group, sky = room["group"], room["sky"]
    room = room.with_nodes(dataclasses.replace(group, hidden=True), dataclasses.replace(sky, hidden=True))
    root, _ = written(room, host, tmp_path)
    assert not root.findall("shape[@type='instance']")
    assert not root.findall("emitter")


def test_every_slot_has_its_material(host: PluginHost, parts: Any, tmp_path: Path) -> None:
    cube = parts["cube"]()
    slots = np.zeros(12, np.uint16)
    slots[4:] = 1
    mesh = Geometry(cube.positions, cube.faces, cube.normals, cube.uvs, slots)
    scene = (
        Scene()
        .with_materials(Material(id="a", values={"base_color": (0.1, 0.2, 0.3)}), Material(id="b"))
        .with_nodes(MeshObject(id="box", geometry=mesh, materials=("a", "b")))
    )
    root, notes = written(scene, host, tmp_path)
    assert len(root.findall("shape")) == 2
    used = [shape.find("ref").get("id") for shape in root.findall("shape")]
    assert len(set(used)) == 2
    assert notes == ("The scene has no camera; one that sees everything was added.",)
    view = scene_view(scene, None, EXPORTER.width, EXPORTER.height)
    matrix = np.array(root.find("sensor/transform/matrix").get("value").split(), float).reshape(4, 4)
    np.testing.assert_allclose(matrix @ np.diag([-1, 1, -1, 1]), view.transform.matrix(), atol=1e-6)


@pytest.mark.parametrize(
    ("material", "plugin"),
    [
        (Material(id="m"), "diffuse"),
        (Material(id="m", model="phong"), "lucarne_phong"),
        (Material(id="m", model="blinn-phong"), "lucarne_blinn_phong"),
        (Material(id="m", model="ggx"), "lucarne_ggx"),
        (Material(id="m", model="specgloss"), "lucarne_specgloss"),
        (
            Material(id="m", model="ggx", values={"metallic": 1.0, "base_color": (1.0, 1.0, 1.0)}),
            "lucarne_ggx",
        ),
        (
            Material(
                id="m",
                model="ggx",
                values={"metallic": 1.0, "base_color": (1.0, 1.0, 1.0), "keep_energy": False},
            ),
            "roughconductor",
        ),
    ],
)
def test_models_are_native_where_they_exist(
    host: PluginHost, parts: Any, tmp_path: Path, material: Material, plugin: str
) -> None:
    box = MeshObject(id="box", geometry=parts["cube"](), materials=("m",))
    root, _ = written(Scene().with_materials(material).with_nodes(box), host, tmp_path)
    side = next(b for b in root.findall("bsdf") if b.get("type") != "twosided")
    assert side.get("type") == plugin
    if material.model in ("ggx", "specgloss"):
        assert float(named(side, "alpha")) == 0.25


def test_what_cannot_be_said_is_noted(host: PluginHost, parts: Any, tmp_path: Path) -> None:
    glass = Material(id="glass", name="Glass", opacity=0.25)
    odd = Material(id="odd", name="Odd", model="made-up")
    image = Image(np.ones((4, 8, 3), np.float32))
    scene = (
        Scene()
        .with_materials(glass, odd)
        .with_nodes(
            MeshObject(id="a", geometry=parts["cube"](), materials=("glass",)),
            MeshObject(id="b", geometry=parts["quad"](), materials=("odd",)),
            Environment(id="first", image=image, background=False),
            Environment(id="second", name="Second", image=image),
            AreaLamp(id="lamp", name="Panel"),
        )
    )
    root, notes = written(scene, host, tmp_path)
    text = "\n".join(notes)
    for part in ("Glass", "Odd", "Second", "Panel"):
        assert part in text
    mask = root.find("bsdf[@type='mask']")
    assert float(named(mask, "opacity")) == 0.25
    assert named(root.find("integrator"), "hide_emitters") == "true"


def test_the_camera_size_and_depth_are_parameters(room: Scene, host: PluginHost, tmp_path: Path) -> None:
    MitsubaExporter(width=320, height=200, spp=7, max_depth=5).save(room, tmp_path, host)
    root = ElementTree.parse(tmp_path / "scene.xml").getroot()
    defaults = {d.get("name"): d.get("value") for d in root.findall("default")}
    known = {"width": "320", "height": "200", "spp": "7", "sampler": "independent", "max_depth": "5"}
    assert defaults == known
    assert {s.get("type") for s in root.iter("sampler")} == {"$sampler"}


def test_textures_are_multiplied_with_their_parameter(host: PluginHost, parts: Any, tmp_path: Path) -> None:
    pixels = np.linspace(0, 1, 24, dtype=np.float32).reshape(2, 4, 3)
    material = Material(
        id="m",
        model="ggx",
        values={"base_color": (0.5, 0.25, 1.0), "metallic": 0.5},
        textures={"base_color": Texture(Image(pixels)), "metallic": Texture(Image(pixels[..., :1]))},
    )
    box = MeshObject(id="box", geometry=parts["cube"](), materials=("m",))
    root, _ = written(Scene().with_materials(material).with_nodes(box), host, tmp_path)
    side = root.find("bsdf[@type='lucarne_ggx']")
    files = {t.get("name"): tmp_path / named(t, "filename") for t in side.findall("texture")}
    np.testing.assert_allclose(read_image(files["base_color"]).pixels, pixels * [0.5, 0.25, 1], rtol=1e-6)
    np.testing.assert_allclose(read_image(files["metallic"]).pixels, pixels[..., :1] / 2, rtol=1e-6)


def test_the_gain_is_in_the_environment(room: Scene, host: PluginHost, tmp_path: Path) -> None:
    written(room, host, tmp_path)
    sky = room["sky"]
    assert isinstance(sky, Environment)
    made = read_image(tmp_path / "env.exr").pixels
    np.testing.assert_allclose(made[1::2], 0.5 * sky.image.pixels, rtol=1e-6)


def test_resampled_rows_interpolate_alike() -> None:
    image = Image(np.random.default_rng(1).uniform(0, 9, (5, 7, 3)).astype(np.float32))
    made = resampled(image)
    v = np.linspace(0, 1, 501)
    ours = np.clip(v * 5 - 0.5, 0, 4)
    theirs = v * 10
    for column in range(7):
        a = np.interp(ours, np.arange(5), image.pixels[:, column, 0])
        b = np.interp(theirs, np.arange(11), made[:, column, 0])
        np.testing.assert_allclose(b, a, rtol=1e-5)


def test_a_place_that_cannot_be_written_is_named(room: Scene, host: PluginHost, tmp_path: Path) -> None:
    taken = tmp_path / "taken"
    taken.write_text("a file")
    with pytest.raises(InputError, match="taken"):
        EXPORTER.save(room, taken, host)


def test_the_folder_renders_by_itself(room: Scene, host: PluginHost, tmp_path: Path) -> None:
    pytest.importorskip("mitsuba", reason="the extra `peers` (Mitsuba 3) is not installed")
    shiny = Material(id="red", model="phong", values={"exponent": 20.0})
    spot = SpotLamp(id="spot", transform=Transform((0.0, 0.0, 4.0)), intensity=30.0)
    EXPORTER.save(room.with_materials(shiny).with_nodes(spot, Group(id="empty")), tmp_path, host)
    command = [
        sys.executable,
        tmp_path / "render.py",
        "--spp",
        "4",
        "--size",
        "24x16",
        "-o",
        tmp_path / "out.exr",
    ]
    done = subprocess.run([*command, "--variant", "scalar_rgb"], capture_output=True, text=True, cwd="/")
    assert done.returncode == 0, done.stderr
    made = read_image(tmp_path / "out.exr").pixels
    assert made.shape == (16, 24, 3)
    assert np.isfinite(made).all()
    assert made.std() > 0.01
