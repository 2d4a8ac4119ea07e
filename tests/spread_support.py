"""Rooms to spread changes over, and marks on them."""

from __future__ import annotations

from typing import Any

import numpy as np
from scenes import floor
from transport_support import Stand, thing

from studio_core.arrays import frozen_map
from studio_core.scene.geometry import Image, Texture
from studio_core.scene.nodes import Material, MeshObject, Scene
from studio_core.scene.transform import Transform
from studio_plugins.slf.spots import Spots, on_object


def checkered(squares: int = 8, size: int = 256, dark: float = 0.15, bright: float = 0.8) -> Image:
    y, x = np.indices((size, size)) * squares // size
    grey = np.where((x + y) % 2, bright, dark).astype(np.float32)
    return Image(np.repeat(grey[..., None], 3, axis=2))


def checkered_floor(size: float = 4.0, squares: int = 8, where: Transform | None = None) -> Scene:
    """One square whose picture has dark and bright squares."""
    texture = Texture(checkered(squares))
    material = Material(
        id="tiles", name="Tiles", model="lambert", textures=frozen_map({"base_color": texture}),
        values=frozen_map({"base_color": (1.0, 1.0, 1.0)}),
    )  # fmt: skip
    node = MeshObject(id="floor", geometry=floor(size), materials=("tiles",), transform=where or Transform())
    return Scene().with_materials(material).with_nodes(node)


def disc(stand: Stand, vertices: Spots, index: int, centre: Any, radius: float, count: int = 300) -> Spots:
    """Marks evenly over a disc on an object's y = 0 plane, in its own frame."""
    turn = np.arange(count) * 2.399963
    away = radius * np.sqrt((np.arange(count) + 0.5) / count)
    places = np.stack([away * np.cos(turn), 0 * turn, away * np.sin(turn)], axis=1) + np.asarray(centre)
    normals = np.broadcast_to(np.array([0, 1, 0], np.float32), places.shape)
    return on_object(
        vertices, stand.mesh, index, places.astype(np.float32), normals, np.zeros(count, np.int64)
    )


__all__ = ["checkered", "checkered_floor", "disc", "thing"]
