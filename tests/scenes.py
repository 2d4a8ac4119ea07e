"""A small scene to start from, and a fingerprint that sees every bit of one."""

from __future__ import annotations

import dataclasses
import hashlib
from collections.abc import Mapping
from typing import Any

import numpy as np

from studio_core.arrays import frozen_map
from studio_core.scene.geometry import Geometry, Image
from studio_core.scene.nodes import Camera, Environment, Material, MeshObject, Node, Scene
from studio_core.scene.transform import Transform, looking


def floor(size: float = 4.0) -> Geometry:
    """A square at y = 0 that faces up, uv over all of it."""
    half = size / 2
    positions = [(-half, 0, half), (half, 0, half), (half, 0, -half), (-half, 0, -half)]
    uvs = [(0, 0), (1, 0), (1, 1), (0, 1)]
    return Geometry(
        np.array(positions, np.float32),
        np.array([(0, 1, 2), (0, 2, 3)], np.uint32),
        np.tile(np.array([0, 1, 0], np.float32), (4, 1)),
        np.array(uvs, np.float32),
    )


def cube(size: float = 1.0) -> Geometry:
    """A cube about the origin with flat faces: 24 positions, 12 triangles."""
    positions, normals, faces = [], [], []
    for axis in range(3):
        for side in (-1.0, 1.0):
            normal = np.eye(3)[axis] * side
            across = np.eye(3)[(axis + 1) % 3]
            up = np.cross(normal, across)
            start = len(positions)
            for u, v in ((-1, -1), (1, -1), (1, 1), (-1, 1)):
                positions.append(size / 2 * (normal + u * across + v * up))
                normals.append(normal)
            faces += [(start, start + 1, start + 2), (start, start + 2, start + 3)]
    uvs = np.tile(np.array([(0, 0), (1, 0), (1, 1), (0, 1)], np.float32), (6, 1))
    return Geometry(
        np.array(positions, np.float32), np.array(faces, np.uint32), np.array(normals, np.float32), uvs
    )


def sky(width: int = 32, level: float = 1.0) -> Image:
    """An equirectangular sky, brighter and bluer towards the top, warm on the +x side; all positive."""
    height = width // 2
    v, u = np.meshgrid((np.arange(height) + 0.5) / height, (np.arange(width) + 0.5) / width, indexing="ij")
    up = np.cos(np.pi * v)
    side = np.cos(2 * np.pi * (u - 0.25)) * np.sin(np.pi * v)
    rgb = level * np.stack([0.6 + 0.2 * up + 0.2 * side, 0.6 + 0.3 * up, 0.6 + 0.4 * up], axis=2)
    return Image(rgb.astype(np.float32))


def little_scene(
    *,
    floor_size: float = 4.0,
    cube_size: float = 1.0,
    cube_model: str = "lambert",
    cube_values: Mapping[str, Any] | None = None,
    environment: Image | None = None,
) -> Scene:
    """A cube on a floor under a sky, seen by a camera; the ids are `floor`, `cube`, `camera`, `sky`."""
    materials = (
        Material(id="matt", name="Matt", values=frozen_map({"base_color": (0.5, 0.5, 0.5)})),
        Material(id="paint", name="Paint", model=cube_model, values=frozen_map(cube_values)),
    )
    nodes: tuple[Node, ...] = (
        MeshObject(id="floor", name="Floor", geometry=floor(floor_size), materials=("matt",)),
        MeshObject(
            id="cube",
            name="Cube",
            geometry=cube(cube_size),
            materials=("paint",),
            transform=Transform((0.0, cube_size / 2, 0.0)),
        ),
        Camera(id="camera", name="Camera", transform=looking((2.5, 1.8, 3.2), (0, 0.4, 0)), focus=4.3),
        Environment(id="sky", name="Sky", image=environment or sky()),
    )
    return Scene().with_materials(*materials).with_nodes(*nodes)


def fingerprint(scene: Scene) -> str:
    """Hex digest of everything in a scene, order and last bits included; shares no code with the project."""
    digest = hashlib.sha256()
    _feed(digest, scene)
    return digest.hexdigest()


def _feed(digest: Any, value: Any) -> None:
    match value:
        case np.ndarray():
            digest.update(f"A{value.dtype.str}{value.shape}".encode())
            digest.update(value.tobytes())
        case float():
            digest.update(f"F{value.hex()}".encode())
        case Mapping():
            digest.update(b"{")
            for key, item in value.items():
                _feed(digest, key)
                _feed(digest, item)
            digest.update(b"}")
        case tuple() | list():
            digest.update(b"(")
            for item in value:
                _feed(digest, item)
            digest.update(b")")
        case _ if dataclasses.is_dataclass(value):
            digest.update(type(value).__name__.encode())
            for field in dataclasses.fields(value):
                digest.update(field.name.encode())
                _feed(digest, getattr(value, field.name))
        case _:
            digest.update(f"{type(value).__name__}{value!r}".encode())
