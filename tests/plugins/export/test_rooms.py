"""A parametric room leaves the program as the mesh that it is."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from oracles.gltf import check, parse
from oracles.solids import uses_of_edges, volume

from studio_core.registry import PluginHost
from studio_core.rooms import new_room
from studio_core.scene.nodes import Scene
from studio_core.scene.room import SLOTS, Room
from studio_core.scene.room_shape import Opening
from studio_plugins.export import glb, mitsuba

OPENINGS = (Opening(), Opening(kind="door", wall=1, sill=0.0, width=0.9, height=2.05))


@pytest.fixture
def parlour() -> Scene:
    """A room with a window and a door."""
    return new_room(5, 4, 2.6, openings=OPENINGS)(Scene())


def test_glb_holds_the_room_with_a_material_a_slot(parlour: Scene, host: PluginHost, tmp_path: Path) -> None:
    trimesh = pytest.importorskip("trimesh")
    assert glb.EXPORTER.save(parlour, tmp_path / "out.glb", host) == ()
    document, binary = parse((tmp_path / "out.glb").read_bytes())
    check(document, binary)
    (mesh,) = document["meshes"]
    assert [document["materials"][p["material"]]["name"] for p in mesh["primitives"]] == [
        f"Room {slot.lower()}" for slot in SLOTS
    ]
    (room,) = parlour.of(Room)
    whole = trimesh.load_scene(tmp_path / "out.glb").to_mesh()
    positions, faces = np.asarray(whole.vertices, np.float64), np.asarray(whole.faces, np.int64)
    assert uses_of_edges(positions, faces) == {2}
    mine = volume(room.geometry.positions.astype(np.float64), room.geometry.faces.astype(np.int64))
    assert volume(positions, faces) == pytest.approx(mine, rel=1e-6)


def test_mitsuba_gets_every_part_of_the_room(parlour: Scene, host: PluginHost, tmp_path: Path) -> None:
    trimesh = pytest.importorskip("trimesh")
    mitsuba.EXPORTER.save(parlour, tmp_path, host)
    root = ElementTree.parse(tmp_path / "scene.xml").getroot()
    assert len(root.findall("shape[@type='ply']")) == len(SLOTS)
    (room,) = parlour.of(Room)
    parts = [trimesh.load_mesh(path) for path in sorted((tmp_path / "meshes").glob("*.ply"))]
    assert sum(len(part.faces) for part in parts) == len(room.geometry.faces)
    low = np.min([part.bounds[0] for part in parts], axis=0)
    high = np.max([part.bounds[1] for part in parts], axis=0)
    np.testing.assert_allclose([low, high], room.geometry.bounds, atol=1e-6)
