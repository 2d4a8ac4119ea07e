"""A change that spreads keeps what surface looked like: pictures, bumps, edges (the paper's figure 21)."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from PIL import Image as File
from scenes import floor
from spread_support import checkered, disc
from transport_support import Stand

from studio_core.arrays import frozen_map
from studio_core.contract import Services
from studio_core.raster import PictureStage
from studio_core.scene.diff import Changes
from studio_core.scene.geometry import Image, Texture
from studio_core.scene.nodes import Camera, Material, MeshObject, PointLamp, Scene
from studio_core.scene.transform import Transform, looking, rotation_matrix
from studio_core.shading.frame import Frame
from studio_core.shading.job import Job
from studio_core.shading.offline import backend_params, scene_view
from studio_core.shading.pipeline import Pipeline
from studio_plugins.slf.field import Decided, Field
from studio_plugins.slf.similarity import Reach
from studio_plugins.slf.spread import Spread

TEXELS = 64


@pytest.fixture(scope="module")
def services(host, workers):
    return Services(workers, host)


def bumps():
    v, u = (np.indices((TEXELS, TEXELS)) + 0.5) / TEXELS
    across, up = 0.5 * np.cos(2 * np.pi * 2 * u), 0.5 * np.cos(2 * np.pi * 3 * v)
    normals = np.stack([-across, -up, np.ones_like(across)], axis=2)
    normals /= np.linalg.norm(normals, axis=2, keepdims=True)
    return Image(((normals + 1) / 2).astype(np.float32), "data")


def brickwork(specular=0.5, roughness=0.5):
    """A textured, bumpy square under a lamp beside the eye."""
    grain = np.random.default_rng(3).uniform(0.6, 1.0, (128, 128, 1))
    picture = np.repeat(checkered(16, 128).pixels * grain, 3, axis=2)[..., :3].astype(np.float32)
    material = Material(
        id="bricks",
        name="Bricks",
        model="ggx",
        values=frozen_map({"base_color": (1.0, 0.8, 0.7), "roughness": roughness, "specular": specular}),
        textures=frozen_map({"base_color": Texture(Image(picture)), "normal": Texture(bumps(), (6.0, 6.0))}),
    )
    eye = Camera(id="eye", transform=looking((0.0, 1.6, 1.6), (0, 0, -0.1)))
    lamp = PointLamp(id="lamp", intensity=6.0, transform=Transform((0.3, 1.5, -1.4)))
    ground = MeshObject(id="floor", geometry=floor(3.0), materials=("bricks",))
    return Scene().with_materials(material).with_nodes(ground, lamp, eye)


def picture(scene, services, size=(160, 120)):
    backend = services.registry.get("backend", "reference")
    pipeline = Pipeline([*backend.stages(services), PictureStage(services)])
    view = dataclasses.replace(scene_view(scene, "eye", *size), antialias=1)
    params = backend_params(backend, {"directions": "1024", "vertices": 6000})
    return pipeline.update(Frame(scene, view, params, 1), Changes(), Job("shade")).linear


def painted(scene, services, reach, changes, where=(0, 0, 0.2), radius=0.25):
    stand = Stand(scene, 6000)
    spread = Spread(services)
    vertices = spread.spots(stand.scene, stand.surfaces)
    marks = disc(stand, vertices, 0, where, radius)
    field = Field([[Decided(marks, reach, changes)]])
    made = spread(scene, stand.surfaces, field)
    nodes = [dataclasses.replace(scene[name], paint=paint) for name, paint in made.items()]
    return scene.with_nodes(*nodes), field.at(vertices), vertices


def kept(tmp_path: Path, **pictures):
    for name, linear in pictures.items():
        bytes_ = (np.clip(linear, 0, 1) ** (1 / 2.2) * 255).astype(np.uint8)
        File.fromarray(bytes_).save(tmp_path / f"{name}.png")


def pixel_of(scene, point, size=(160, 120)):
    view = scene_view(scene, "eye", *size)
    local = (np.array(point) - view.transform.translation) @ rotation_matrix(view.transform.rotation)
    unit = size[1] / (2 * np.tan(np.radians(view.fov) / 2)) / -local[2]
    return int(size[0] / 2 + unit * local[0]), int(size[1] / 2 - unit * local[1])


def detail(linear):
    """A picture without what varies slowly."""
    grey = linear.mean(axis=2)
    return grey - sum(np.roll(grey, (y, x), (0, 1)) for y in (-3, 0, 3) for x in (-3, 0, 3)) / 9


def test_shine_that_is_painted_near_a_stroke_shows_the_bumps(services, tmp_path):
    """Within the stroke's reach as the whole material would with that change, outside as before."""
    scene = brickwork()
    before, other = picture(scene, services), picture(brickwork(1.0, 0.3), services)
    where = (0.15, 0.0, 0.05)  # the lamp's mirror image
    changes = {"specular": 0.5, "roughness": -0.2}
    coated, _, _ = painted(scene, services, Reach(near=12.0), changes, where, 0.35)
    after = picture(coated, services)
    kept(tmp_path, before=before, after=after, other=other)
    change = np.abs(other - before).mean(axis=2)
    inside, outside = np.zeros((2, *change.shape), bool)
    x, y = pixel_of(scene, where)
    inside[y - 8 : y + 9, x - 10 : x + 11] = True
    outside[:, :20] = True
    assert change[inside].mean() > 0.05 * before[inside].mean()
    assert np.abs(after - other).mean(axis=2)[inside].mean() < 0.05 * change[inside].mean()
    assert np.abs(after - before).mean(axis=2)[outside].mean() < 0.02 * change[outside].mean()
    bumpy = detail(after - before)[inside]
    expected = detail(other - before)[inside]
    assert np.corrcoef(bumpy, expected)[0, 1] > 0.99


def test_a_colour_that_is_painted_keeps_the_grain_of_a_picture(services, tmp_path):
    scene = brickwork()
    before = picture(scene, services)
    coated, _, _ = painted(scene, services, Reach(), {"base_color": (0.1, -0.02, -0.05)})
    after = picture(coated, services)
    kept(tmp_path, before=before, after=after)
    grain, left = detail(before), detail(after)
    assert np.abs(after - before).mean() > 0.03 * before.mean()
    assert np.corrcoef(grain.ravel(), left.ravel())[0, 1] > 0.98
    assert left.std() > 0.9 * grain.std()


def test_likeness_keeps_bright_squares_from_a_change_of_dark_ones(services, tmp_path):
    scene = brickwork()
    coated, wanted, vertices = painted(
        scene, services, Reach(alike=10.0, near=0.5), {"base_color": (0.3, 0.0, -0.1)}, (0.1, 0, 0.1), 0.05
    )
    before, after = picture(scene, services), picture(coated, services)
    kept(tmp_path, before=before, after=after)
    red = wanted["base_color"][:, 0]
    dark = vertices.look[:, 0] < np.quantile(vertices.look[:, 0], 0.3)
    bright = vertices.look[:, 0] > np.quantile(vertices.look[:, 0], 0.7)
    more, less = red[dark].mean(), red[bright].mean()
    assert max(more, less) > 5 * min(more, less)
