"""A small asymmetric room: coloured cubes, a textured quad, an environment with a colour for each axis."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from studio_core.imaging.latlong import pixel_directions
from studio_core.registry import PluginHost
from studio_core.scene.geometry import Geometry, Image, Texture
from studio_core.scene.nodes import Camera, Environment, Group, Material, MeshObject, Scene
from studio_core.scene.transform import Transform, axis_angle, looking
from studio_plugins.brdfs import plugin as brdfs
from studio_plugins.export import plugin as export


def cube() -> Geometry:
    """Side 1, flat faces, outward."""
    positions, normals, uvs, faces = [], [], [], []
    for axis in range(3):
        for side in (-1.0, 1.0):
            corners, normal = np.zeros((4, 3)), np.zeros((4, 3))
            corners[:, axis], normal[:, axis] = side / 2, side
            corners[:, (axis + 1) % 3] = np.array([-1, 1, 1, -1]) / 2
            corners[:, (axis + 2) % 3] = np.array([-1, -1, 1, 1]) / 2
            order = np.array([[0, 1, 2], [0, 2, 3]] if side > 0 else [[0, 2, 1], [0, 3, 2]])
            faces.append(order + 4 * len(positions))
            positions.append(corners)
            normals.append(normal)
            uvs.append([[0, 0], [1, 0], [1, 1], [0, 1]])
    stacked = [np.concatenate(part).astype(np.float32) for part in (positions, normals, uvs)]
    return Geometry(stacked[0], np.concatenate(faces).astype(np.uint32), stacked[1], stacked[2])


def quad() -> Geometry:
    """In the xy plane, facing +z, u right and v up."""
    positions = np.array([[-1, -0.5, 0], [1, -0.5, 0], [1, 0.5, 0], [-1, 0.5, 0]], np.float32)
    uvs = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], np.float32)
    normals = np.tile(np.array([0, 0, 1], np.float32), (4, 1))
    return Geometry(positions, np.array([[0, 1, 2], [0, 2, 3]], np.uint32), normals, uvs)


def axes_environment(height: int = 32) -> Image:
    """Grey, with red around +x, green around +z, blue around +y, yellow around −z."""
    width = 2 * height
    d = pixel_directions(height, width)
    pixels = np.full((height, width, 3), 0.1, np.float32)
    pixels[d[..., 0] > 0.9] = [5, 0, 0]
    pixels[d[..., 2] > 0.9] = [0, 4, 0]
    pixels[d[..., 1] > 0.85] = [0, 0, 3]
    pixels[d[..., 2] < -0.92] = [2, 2, 0]
    return Image(pixels)


def picture() -> Image:
    """8-bit sRGB, every corner of another colour."""
    pixels = np.full((6, 8, 3), 128, np.uint8)
    pixels[:3, :4], pixels[:3, 4:] = [255, 0, 0], [0, 255, 0]
    pixels[3:, :4], pixels[3:, 4:] = [0, 0, 255], [200, 200, 40]
    return Image(pixels, "srgb")


@pytest.fixture
def host() -> PluginHost:
    """Reflectance models and exporters."""
    return PluginHost([brdfs, export])


@pytest.fixture
def parts() -> dict[str, Any]:
    """The builders above, for tests that make scenes of their own."""
    return {"cube": cube, "quad": quad, "environment": axes_environment, "picture": picture}


@pytest.fixture
def room() -> Scene:
    """The room, with a group that moves two instances and a camera that looks askew."""
    box = cube()
    materials = [
        Material(id="red", name="Red", values={"base_color": (0.8, 0.1, 0.05)}),
        Material(id="blue", name="Blue", values={"base_color": (0.1, 0.2, 0.7)}),
        Material(
            id="poster",
            name="Poster",
            values={"base_color": (1.0, 1.0, 1.0)},
            textures={"base_color": Texture(picture(), (1.5, 1.5), (0.125, 0.0625), 20.0, 0.5)},
        ),
    ]
    tilted = Transform((0.3, 0.2, -0.4), axis_angle((1, 2, 0.5), 40), 1.5)
    nodes = [
        Environment(id="sky", name="Sky", image=axes_environment(), azimuth=35.0, tilt=20.0, intensity=0.5),
        Group(id="group", name="Group", transform=tilted),
        MeshObject(
            id="left", name="Left", parent="group", geometry=box, materials=("red",),
            transform=Transform((-1.0, 0.1, 0.0)),
        ),
        MeshObject(
            id="right", name="Right", parent="group", geometry=box, materials=("red",),
            transform=Transform((0.6, -0.4, 0.2), axis_angle((0, 1, 0), 25), 0.5),
        ),
        MeshObject(
            id="alone", name="Alone", geometry=box, materials=("blue",),
            transform=Transform((0.5, 1.1, 0.0), axis_angle((0, 0, 1), 10), 0.7),
        ),
        MeshObject(
            id="wall", name="Wall", geometry=quad(), materials=("poster",),
            transform=Transform((-0.4, -1.0, 0.8), axis_angle((0, 1, 0), -20)),
        ),
        Camera(
            id="eye", name="Eye", fov=50.0, transform=looking((1.0, 1.5, 5.0), (0, 0, 0), (0.2, 1, 0))
        ),
    ]  # fmt: skip
    return Scene().with_materials(*materials).with_nodes(*nodes)
