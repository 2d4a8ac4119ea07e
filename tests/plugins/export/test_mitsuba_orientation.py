"""The exported scene, seen by Mitsuba, against a ray caster that shares nothing with it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from oracles.compose import place_in_picture
from oracles.primary import Seen, bilinear, environment, see

from studio_core.imaging.transfer import srgb_to_linear
from studio_core.registry import PluginHost
from studio_core.scene.nodes import Camera, Environment, MeshObject, Scene
from studio_plugins.export import mitsuba_run
from studio_plugins.export.mitsuba import EXPORTER

pytest.importorskip("mitsuba", reason="the extra `peers` (Mitsuba 3) is not installed")

WIDTH, HEIGHT = 96, 64


def seen(scene: Scene) -> tuple[Seen, list[MeshObject]]:
    eye = next(scene.of(Camera))
    objects = list(scene.of(MeshObject))
    meshes: list[Any] = [
        (
            node.geometry.positions.astype(float),
            node.geometry.faces.astype(int),
            np.asarray(node.geometry.uvs, float),
            scene.world(node.id).matrix(),
        )
        for node in objects
    ]
    return see(scene.world(eye.id).matrix(), eye.fov, WIDTH, HEIGHT, meshes), objects


def background(scene: Scene, directions: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    sky = next(scene.of(Environment))
    return environment(sky.image.pixels.astype(float), sky.azimuth, sky.tilt, directions) * sky.gain()


def inside(obj: npt.NDArray[np.int64]) -> npt.NDArray[np.bool_]:
    """Pixels whose neighbours show the same object."""
    same = np.ones(obj.shape, bool)
    for axis in (0, 1):
        step = np.diff(obj, axis=axis) == 0
        ahead, behind = [(0, 0), (0, 0)], [(0, 0), (0, 0)]
        ahead[axis], behind[axis] = (0, 1), (1, 0)
        same &= np.pad(step, ahead, constant_values=True) & np.pad(step, behind, constant_values=True)
    return same


def test_pixel_rays_meet_what_the_oracle_meets(room: Scene, host: PluginHost, tmp_path: Path) -> None:
    EXPORTER.save(room, tmp_path, host)
    scene = mitsuba_run.load(tmp_path, width=WIDTH, height=HEIGHT)
    mi = mitsuba_run.mitsuba()
    truth, objects = seen(room)
    x, y = np.meshgrid((np.arange(WIDTH) + 0.5) / WIDTH, (np.arange(HEIGHT) + 0.5) / HEIGHT)
    film = mi.Point2f(x.ravel().astype(np.float32), y.ravel().astype(np.float32))
    ray, _ = scene.sensors()[0].sample_ray(0.0, 0.5, film, mi.Point2f(0.5, 0.5))
    direction = np.array(ray.d).T.reshape(HEIGHT, WIDTH, 3)
    np.testing.assert_allclose(direction, truth.direction, atol=2e-6)

    si = scene.ray_intersect(ray)
    hit = np.array(si.is_valid()).reshape(HEIGHT, WIDTH)
    sure = inside(truth.obj)
    assert sure.mean() > 0.7
    np.testing.assert_array_equal(hit[sure], (truth.obj >= 0)[sure])
    near_clip = 1e-3  # rays start there
    distance = np.array(si.t).reshape(HEIGHT, WIDTH)
    on = sure & hit
    assert set(np.unique(truth.obj[on])) == {0, 1, 2, 3}
    np.testing.assert_allclose(distance[on], truth.distance[on], atol=3 * near_clip)

    albedo = np.array(si.bsdf().eval_diffuse_reflectance(si)).T.reshape(HEIGHT, WIDTH, 3)
    for number, node in enumerate(objects):
        material = room.material(node.materials[0])
        here = on & (truth.obj == number)
        assert here.sum() > 50
        if material.textures:
            texture = material.textures["base_color"]
            uv = (np.c_[truth.uv[here], np.ones(here.sum())] @ place_in_picture(texture).T)[:, :2] % 1
            texels = srgb_to_linear(texture.image.pixels).astype(float)
            height, width = texels.shape[:2]
            rows = (1 - uv[:, 1]) * height - 0.5
            wanted = bilinear(texels, uv[:, 0] * width - 0.5, rows)
            columns = uv[:, 0] * width
            whole = (rows > 0) & (rows < height - 1) & (columns > 1) & (columns < width - 1)
            np.testing.assert_allclose(albedo[here][whole], wanted[whole], atol=5e-3)
            assert whole.mean() > 0.5
        else:
            np.testing.assert_allclose(
                albedo[here], np.tile(material.values["base_color"], (here.sum(), 1)), rtol=1e-5
            )

    sky = np.array(scene.environment().eval(si)).T.reshape(HEIGHT, WIDTH, 3)
    np.testing.assert_allclose(sky[~hit], background(room, truth.direction)[~hit], atol=2e-3)


@pytest.mark.parametrize("variant", ["llvm_ad_rgb", "scalar_rgb"])
def test_the_picture_of_light_alone(room: Scene, host: PluginHost, tmp_path: Path, variant: str) -> None:
    EXPORTER.save(room, tmp_path, host)
    made = mitsuba_run.render(tmp_path, 8, (WIDTH, HEIGHT), variant, max_depth=1)
    assert made.shape == (HEIGHT, WIDTH, 3)
    truth, _ = seen(room)
    sure = inside(truth.obj)
    assert not made[sure & (truth.obj >= 0)].any()
    away = sure & (truth.obj < 0)
    wanted = background(room, truth.direction)
    error = np.sqrt(((made - wanted)[away] ** 2).mean()) / wanted[away].mean()
    assert error < 0.12  # eight random places in a pixel against its centre
    for axis in (0, 1):  # a mirrored one would not pass
        mirrored = np.sqrt(((np.flip(made, axis) - wanted)[away] ** 2).mean()) / wanted[away].mean()
        assert mirrored > 5 * error


@pytest.mark.parametrize(
    ("azimuth", "tilt"), [(0.0, 0.0), (90.0, 0.0), (0.0, 90.0), (-130.0, 55.0), (400.0, -170.0)]
)
def test_the_environment_everywhere(
    room: Scene, host: PluginHost, tmp_path: Path, azimuth: float, tilt: float
) -> None:
    import dataclasses

    sky = dataclasses.replace(next(room.of(Environment)), azimuth=azimuth, tilt=tilt)
    room = room.with_nodes(sky)
    EXPORTER.save(room, tmp_path, host)
    scene = mitsuba_run.load(tmp_path)
    mi = mitsuba_run.mitsuba()
    import drjit as dr

    rng = np.random.default_rng(3)
    d = rng.normal(size=(4000, 3))
    d /= np.linalg.norm(d, axis=1, keepdims=True)
    si = dr.zeros(mi.SurfaceInteraction3f, len(d))
    si.wi = mi.Vector3f(*(-d).T.astype(np.float32))
    made = np.array(scene.environment().eval(si)).T
    wanted = background(room, d)
    np.testing.assert_allclose(made, wanted, atol=5e-3)
    if azimuth == tilt == 0:
        si.wi = mi.Vector3f([-1, 0, 0], [0, 0, -1], [0, -1, 0])
        colours = np.array(scene.environment().eval(dr.gather(type(si), si, mi.UInt32(0, 1, 2)))).T
        np.testing.assert_array_equal(colours.argmax(axis=1), [0, 1, 2])
