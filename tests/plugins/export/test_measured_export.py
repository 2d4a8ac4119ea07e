"""Materials that other programs have no model for keep their brightness and colour."""

from __future__ import annotations

import dataclasses
import json
import struct
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
from scenes import little_scene

from studio_core.arrays import frozen_map
from studio_core.scene.geometry import Table
from studio_core.scene.nodes import Scene


@pytest.fixture
def scene() -> Scene:
    """A cube that was measured: matte, 40 %, 20 % and 10 %."""
    values = np.broadcast_to(np.array([0.4, 0.2, 0.1]) / np.pi, (4, 4, 4, 3)).astype(np.float32)
    whole = little_scene()
    paint = dataclasses.replace(
        whole.material("paint"), model="measured", tables=frozen_map({"measurement": Table(values)})
    )
    return whole.with_materials(paint)


def test_in_gltf(scene: Scene, host: Any, tmp_path: Path) -> None:
    notes = host.get("exporter", "glb").save(scene, tmp_path / "x.glb", host)
    data = (tmp_path / "x.glb").read_bytes()
    made = json.loads(data[20 : 20 + struct.unpack_from("<I", data, 12)[0]])
    (paint,) = (m for m in made["materials"] if m["name"] == "Paint")
    found = paint["pbrMetallicRoughness"]["baseColorFactor"]
    np.testing.assert_allclose(found, [0.4, 0.2, 0.1, 1.0], rtol=0.01)
    assert not any("Paint" in note for note in notes)  # it is matte, and written as such


def test_in_mitsuba(scene: Scene, host: Any, tmp_path: Path) -> None:
    notes = host.get("exporter", "mitsuba").save(scene, tmp_path / "out", host)
    tree = ElementTree.parse(tmp_path / "out" / "scene.xml")
    colours = [
        [float(n) for n in rgb.attrib["value"].replace(",", " ").split()]
        for rgb in tree.iter("rgb")
        if rgb.attrib["name"] == "reflectance"
    ]
    assert any(np.allclose(colour, [0.4, 0.2, 0.1], rtol=0.01) for colour in colours)
    assert any(note.startswith("Paint: Mitsuba has no Measured; written as ") for note in notes)
