"""Pictures of a small scene: silhouettes, sides, textures, transparency, background."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from oracles.radiance import lat_long

from studio_core.contract import Services
from studio_core.kernels.camera import sample_directions
from studio_core.scene.geometry import Geometry, Image, Texture
from studio_core.scene.nodes import Camera, Environment, Material, MeshObject, PointLamp, Scene
from studio_core.scene.transform import Transform, looking
from studio_core.session import View
from studio_core.shading.offline import backend_params, picture
from studio_core.shading.primary import pinhole


def rays_of(view):
    out = np.empty((view.width * view.height * view.antialias**2, 3), np.float32)
    sample_directions(pinhole(view), np.arange(len(out)), out)
    return out


@pytest.fixture(scope="module")
def services(host, workers):
    return Services(workers, host)


def draw(scene, services, host, *, width=64, height=48, antialias=1, **params):
    backend = host.get("backend", "reference")
    camera = next(scene.of(Camera))
    view = dataclasses.replace(View.of(camera, scene, width, height), antialias=antialias)
    values = {"directions": "1024", "vertices": 2000, **params}
    return picture(scene, view, backend, backend_params(backend, values), services)


def quad(z=0.0, size=1.0):
    h = size / 2
    positions = np.array([[-h, -h, z], [h, -h, z], [h, h, z], [-h, h, z]], np.float32)
    uvs = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], np.float32)
    return Geometry(positions, np.array([[0, 1, 2], [0, 2, 3]], np.uint32), None, uvs)


def constant(level=1.0):
    return Environment(id="env", name="Sky", image=Image(np.full((8, 16, 3), level, np.float32)))


CAMERA = Camera(id="cam", name="Camera", transform=Transform((0, 0, 2)), fov=45)


def test_white_matte_in_white_light_is_white(services, host):
    scene = Scene().with_materials(Material(id="m", name="m", values={"base_color": (1.0, 1.0, 1.0)}))
    scene = scene.with_nodes(
        CAMERA, constant(), MeshObject(id="q", name="q", geometry=quad(), materials=("m",))
    )
    made = draw(scene, services, host, directions="4096")
    np.testing.assert_allclose(made.linear, 1.0, atol=0.01)
    assert made.node[24, 32] == 0
    assert made.node[0, 0] == -1
    assert made.distance[24, 32] == pytest.approx(2, rel=1e-3)


def test_silhouette_is_where_the_square_projects(services, host):
    scene = Scene().with_materials(Material(id="m", name="m"))
    scene = scene.with_nodes(CAMERA, MeshObject(id="q", name="q", geometry=quad(), materials=("m",)))
    made = draw(scene, services, host, width=160, height=120)
    rays = rays_of(made.radiance.hits.view).reshape(120, 160, 3)
    at = rays / -rays[..., 2:] * 2
    inside = (np.abs(at[..., :2]) < 0.5).all(axis=2)
    assert np.array_equal(made.node == 0, inside)
    assert np.array_equal(made.coverage > 0, inside)


def test_an_open_sheet_is_lit_on_both_sides(services, host):
    lamp = PointLamp(id="lamp", name="lamp", transform=Transform((0, 0, 3)), intensity=10.0)
    sheet = MeshObject(id="q", name="q", geometry=quad(size=3), materials=("m",))
    scene = Scene().with_materials(Material(id="m", name="m")).with_nodes(CAMERA, lamp, sheet)
    lit = draw(scene, services, host).linear[24, 32]
    behind = dataclasses.replace(CAMERA, transform=looking((0, 0, -2), (0, 0, 0)))
    dark = draw(scene.with_nodes(behind), services, host).linear[24, 32]
    assert lit.min() > 0.1
    assert not dark.any()


def tube(sides=24):
    """A wall of radius 0.5 and height 1 about the y axis, open above and below, front outside."""
    turn = 2 * np.pi * np.arange(sides) / sides
    ring = np.stack([np.sin(turn) / 2, np.full(sides, -0.5), np.cos(turn) / 2], axis=1)
    here, there = np.arange(sides), (np.arange(sides) + 1) % sides
    faces = [np.stack([here, there, there + sides], 1), np.stack([here, there + sides, here + sides], 1)]
    places = np.concatenate([ring, ring + np.array([0, 1, 0])])
    return Geometry(places.astype(np.float32), np.concatenate(faces))


def test_the_light_inside_a_shade_never_shows_on_its_outside(services, host):
    lamp = PointLamp(id="lamp", name="lamp", intensity=10.0)
    shade = MeshObject(id="s", name="s", geometry=tube(), materials=("m",))
    scene = Scene().with_materials(Material(id="m", name="m")).with_nodes(CAMERA, lamp, shade)
    outside = draw(scene, services, host, width=128, height=96, vertices=500)
    assert (outside.node == 0).sum() > 1000
    assert not outside.linear.any()
    above = dataclasses.replace(CAMERA, transform=looking((0, 2, 1.0), (0, 0, 0)))
    assert draw(scene.with_nodes(above), services, host).linear.any()


def test_absurd_texture_coordinates_give_a_finite_picture(services, host):
    texture = Texture(Image(np.linspace(0, 1, 64 * 64 * 3, dtype=np.float32).reshape(64, 64, 3)))
    material = Material(id="m", name="m", textures={"base_color": texture})
    for extent in (1e10, 1e19, 3e38):
        plain = quad(size=3)
        wild = Geometry(plain.positions, plain.faces, None, (plain.uvs - 0.5) * np.float32(extent))
        node = MeshObject(id="q", name="q", geometry=wild, materials=("m",))
        made = draw(Scene().with_materials(material).with_nodes(CAMERA, constant(), node), services, host)
        assert np.isfinite(made.linear).all()
        assert made.linear.max() < 2


def test_texture_is_upright_and_not_mirrored(services, host):
    corners = np.zeros((2, 2, 3), np.float32)
    corners[0, 0], corners[0, 1], corners[1, 0] = (1, 0, 0), (0, 1, 0), (0, 0, 1)
    material = Material(
        id="m",
        name="m",
        values={"base_color": (1.0, 1.0, 1.0)},
        textures={"base_color": Texture(Image(corners))},
    )
    scene = Scene().with_materials(material)
    scene = scene.with_nodes(
        CAMERA, constant(), MeshObject(id="q", name="q", geometry=quad(), materials=("m",))
    )
    made = draw(scene, services, host).linear
    assert made[16, 24].argmax() == 0  # top left of the picture: the first texel of its first row
    assert made[16, 40].argmax() == 1
    assert made[32, 24].argmax() == 2


def test_background_is_the_environment_seen_along_each_ray(services, host):
    rng = np.random.default_rng(5)
    pixels = rng.random((16, 32, 3)).astype(np.float32)
    sky = Environment(id="env", name="Sky", image=Image(pixels), azimuth=37.0, tilt=20.0, intensity=2.0)
    scene = Scene().with_nodes(CAMERA, sky)
    made = draw(scene, services, host, width=12, height=9)
    rays = rays_of(made.radiance.hits.view)
    back = sky.rotation().matrix()[:3, :3].T
    expected = 2 * np.array([lat_long(pixels, back @ ray) for ray in rays]).reshape(9, 12, 3)
    np.testing.assert_allclose(made.linear, expected, atol=2e-3)
    hidden = draw(scene.with_nodes(dataclasses.replace(sky, background=False)), services, host)
    assert not hidden.linear.any()


@pytest.mark.parametrize("opacity", [0.0, 0.3, 0.8])
def test_transparent_sheets_are_blended_and_thin_ones_cast_no_shadow(services, host, opacity):
    white, glass = Material(id="m", name="m"), Material(id="g", name="g", opacity=opacity)
    wall = MeshObject(id="w", name="w", geometry=quad(-1, 20), materials=("m",))
    pane = MeshObject(id="p", name="p", geometry=quad(0, 0.5), materials=("g",))
    scene = Scene().with_materials(white, glass).with_nodes(CAMERA, constant(), wall)
    alone = draw(scene, services, host).linear[24, 32]
    both = draw(scene.with_nodes(pane), services, host)
    if opacity < 0.5:
        expected = (1 - opacity) * alone + opacity * 0.8 * np.ones(3)
        np.testing.assert_allclose(both.linear[24, 32], expected, rtol=0.05)
    else:
        assert (both.linear[24, 32] < opacity * 0.8 + (1 - opacity) * alone).all()


def test_more_samples_soften_edges_only(services, host):
    scene = Scene().with_materials(Material(id="m", name="m"))
    scene = scene.with_nodes(CAMERA, MeshObject(id="q", name="q", geometry=quad(), materials=("m",)))
    coverage = draw(scene, services, host, antialias=3, width=65, height=49).coverage
    assert set(np.unique(coverage[20:28, 25:40])) == {1.0}
    assert ((coverage > 0) & (coverage < 1)).any()


def test_hidden_objects_are_gone(services, host, little_scene):
    scene = little_scene()
    shown = draw(scene, services, host)
    first = next(scene.of(MeshObject))
    gone = draw(scene.with_nodes(dataclasses.replace(first, hidden=True)), services, host)
    assert first.id in shown.nodes
    assert first.id not in gone.nodes
    assert not np.array_equal(shown.linear, gone.linear)


def test_an_empty_scene_is_black(services, host):
    made = draw(Scene().with_nodes(CAMERA), services, host)
    assert not made.linear.any()
    assert (made.node == -1).all()
