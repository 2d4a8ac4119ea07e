"""Shadow catchers and projected backgrounds in exported files: left out, and said so."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path
from xml.etree import ElementTree

from scenes import floor, little_scene

from studio_core.registry import PluginHost
from studio_core.scene.nodes import ON_THE_GROUND, Environment, Material, MeshObject, Scene


def photographed() -> Scene:
    scene = little_scene()
    sky = next(scene.of(Environment))
    catching = Material(id="catching", name="Floor", catches=True)
    ground = MeshObject(id="ground", name="Shadow floor", geometry=floor(), materials=("catching",))
    return scene.with_materials(catching).with_nodes(
        dataclasses.replace(sky, projection=ON_THE_GROUND, background_azimuth=10.0), ground
    )


def test_mitsuba_gets_the_furniture_alone(host: PluginHost, tmp_path: Path) -> None:
    notes = host.get("exporter", "mitsuba").save(photographed(), tmp_path, host)
    shapes = ElementTree.parse(tmp_path / "scene.xml").getroot().findall("shape")
    assert len(shapes) == len(list(little_scene().of(MeshObject)))
    told = " ".join(notes)
    assert "Shadow floor only catches shadows" in told
    assert "not on the ground" in told
    assert "turned as its light" in told


def test_glb_gets_the_furniture_alone(host: PluginHost, tmp_path: Path) -> None:
    path = tmp_path / "room.glb"
    notes = host.get("exporter", "glb").save(photographed(), path, host)
    data = path.read_bytes()
    document = json.loads(data[20 : 20 + int.from_bytes(data[12:16], "little")])
    assert len(document["meshes"]) == len(list(little_scene().of(MeshObject)))
    assert any("Shadow floor only catches shadows" in note for note in notes)
    assert not any("Hidden" in note for note in notes)
