"""Small scenes that the project's tests save."""

from __future__ import annotations

import dataclasses
import sqlite3
from pathlib import Path

import numpy as np

from studio_core.arrays import frozen_map
from studio_core.scene.geometry import Geometry, Image, Texture
from studio_core.scene.nodes import Camera, Environment, Group, Material, MeshObject, Scene


def small_scene(seed: int = 0, *, faces: int = 200) -> Scene:
    """Two chairs of one mesh in a group, a camera, a sky, two materials, one texture."""
    rng = np.random.default_rng(seed)
    chair = Geometry(
        rng.random((100, 3), dtype=np.float32),
        rng.integers(0, 100, (faces, 3), dtype=np.uint32),
        uvs=rng.random((100, 2), dtype=np.float32),
        slots=rng.integers(0, 2, faces, dtype=np.uint16),
    )
    weave = Image(rng.integers(0, 256, (16, 16, 3), dtype=np.uint8), "srgb")
    sky = Image(np.exp(rng.standard_normal((16, 32, 3))).astype(np.float32))
    wood = Material(id="wood", name="Wood", values=frozen_map({"albedo": (0.5, 0.25, 0.1)}))
    cloth = Material(
        id="cloth",
        name="Cloth",
        model="ggx",
        values=frozen_map({"roughness": 0.3, "two_sided": True, "layers": 2, "note": "soft"}),
        textures=frozen_map({"albedo": Texture(weave, (2.0, 2.0), (0.0, 0.5))}),
    )
    return (
        Scene()
        .with_materials(wood, cloth)
        .with_nodes(
            Group(id="set", name="Dining set"),
            MeshObject(id="a", name="Chair", parent="set", geometry=chair, materials=("wood", "cloth")),
            MeshObject(id="b", name="Chair 2", parent="set", geometry=chair, materials=("cloth", "wood")),
            Camera(id="eye", name="Eye"),
            Environment(id="sky", name="Sky", image=sky, azimuth=30.0),
        )
    )


def renamed(scene: Scene, name: str) -> Scene:
    """The scene with its first chair under another name."""
    return scene.with_nodes(dataclasses.replace(scene["a"], name=name))


def hot_journal(path: Path) -> bytes:
    """Leave the file as a save that was killed half way leaves it; the journal."""
    journal = path.with_name(f"{path.name}-journal")
    connection = sqlite3.connect(path, isolation_level=None)
    connection.execute("PRAGMA cache_size=1")
    connection.execute("BEGIN EXCLUSIVE")
    connection.execute("UPDATE meta SET value = value || ' '")
    connection.execute("UPDATE item SET json = json || ' '")
    connection.execute("UPDATE blob SET data = data || zeroblob(10000)")
    half, data = path.read_bytes(), journal.read_bytes()
    connection.execute("ROLLBACK")
    connection.close()
    assert half != path.read_bytes()
    path.write_bytes(half)
    journal.write_bytes(data)
    return data
