"""Coefficients at vertices: means of pictures over what a vertex stands for; only what changed is made."""

from __future__ import annotations

import dataclasses
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from captured_fits import made_up
from hypothesis import given, settings
from hypothesis import strategies as st
from scenes import cube, floor

from studio_core.arrays import frozen_map
from studio_core.contract import Services
from studio_core.registry import PluginHost
from studio_core.scene.geometry import Geometry, Image, Texture
from studio_core.scene.nodes import Material, MeshObject, Scene
from studio_core.scene.paint import Paint
from studio_core.scene.shading_mesh import shade_mesh
from studio_core.scene.transform import Transform
from studio_core.scene.world_mesh import Placed, WorldMesh, assemble
from studio_core.shading.artifacts import Surfaces
from studio_core.shading.materials import coefficients, resolve
from studio_core.transport.reflectance import VertexCoefficients
from studio_plugins.residual.material import scene_material


def painted(pixels: Any, name: str = "m", **lies: Any) -> Material:
    texture = Texture(Image(np.asarray(pixels, np.float32)), **lies)
    return Material(id=name, name=name, model="lambert", textures=frozen_map({"base_color": texture}),
                    values=frozen_map({"base_color": (1.0, 1.0, 1.0)}))  # fmt: skip


def mesh_of(
    geometry: Geometry | None = None, edge: float = 0.25, materials: tuple[int, ...] = (0,)
) -> WorldMesh:
    return assemble([Placed("o", shade_mesh(geometry or floor(2.0), edge), Transform(), materials)])


def surfaces_of(mesh: WorldMesh, *materials: Material) -> Surfaces:
    return cast(Surfaces, SimpleNamespace(mesh=mesh, materials=tuple(m.id for m in materials)))


def maker(host: PluginHost) -> VertexCoefficients:
    return VertexCoefficients(Services(None, host))


def made(host: PluginHost, mesh: WorldMesh, *materials: Material) -> np.ndarray:
    return maker(host)(Scene().with_materials(*materials), surfaces_of(mesh, *materials))


def checkered(squares: int, size: int) -> np.ndarray:
    y, x = np.indices((size, size)) * squares // size
    return np.repeat(((x + y) % 2).astype(np.float32)[..., None], 3, axis=2)


@settings(max_examples=12, deadline=None)
@given(
    st.integers(0, 2**32 - 1),
    st.sampled_from([8, 64, 300, 700]),
    st.sampled_from([0.06, 0.13]),
    st.floats(-180, 180),
)
def test_the_mean_over_the_surface_is_that_of_the_picture(
    host: PluginHost, seed: int, size: int, edge: float, rotation: float
) -> None:
    """A picture that tiles, four times on the floor, turned by quarters: blobs of every size."""
    rng = np.random.default_rng(seed)
    spectrum = rng.normal(size=(8, 8, 3))
    blobs = np.kron(spectrum, np.ones((size // 8 + 1, size // 8 + 1, 1)))[:size, :size]
    pixels = np.clip(0.5 + 0.2 * blobs + 0.1 * rng.normal(size=(size, size, 3)), 0, 1)
    turned = 90.0 * round(rotation / 90)
    mesh = mesh_of(edge=edge)
    found = made(host, mesh, painted(pixels, scale=(2.0, 2.0), rotation=turned, offset=(0.3, 0.1)))
    mean = np.average(found[:, 0], weights=mesh.area, axis=0)
    whole = coefficients(resolve(painted(pixels), host))[..., 0, :].mean(axis=(0, 1))
    np.testing.assert_allclose(mean, whole, rtol=0.02)


@pytest.mark.parametrize("squares", [128, 256])
def test_squares_much_smaller_than_a_vertex_come_to_their_mean(host: PluginHost, squares: int) -> None:
    mesh = mesh_of(edge=0.5)
    found = made(host, mesh, painted(checkered(squares, 1024)))
    white = made(host, mesh, painted(np.ones((2, 2, 3))))
    np.testing.assert_allclose(found, white / 2, rtol=0.02)


def test_squares_much_larger_than_a_vertex_are_themselves(host: PluginHost) -> None:
    mesh = mesh_of(edge=0.05)
    found = made(host, mesh, painted(checkered(4, 256)))
    white = made(host, mesh, painted(np.ones((2, 2, 3))))
    place = (mesh.uvs * 4) % 1
    inside = ((place > 0.25) & (place < 0.75)).all(axis=1)
    column, row = np.floor(mesh.uvs[inside] * 4).astype(int).T
    expected = ((column + 3 - row) % 2).astype(np.float32)  # rows of pictures run down
    np.testing.assert_allclose(found[inside], white[inside] * expected[:, None, None], atol=1e-3)


def test_nothing_comes_in_from_beside_the_surface(host: PluginHost) -> None:
    """The floor shows the left half of a picture alone, which is black; the right half is white."""
    pixels = np.zeros((256, 256, 3), np.float32)
    pixels[:, 128:] = 1
    mesh = mesh_of(edge=0.2)
    found = made(host, mesh, painted(pixels, scale=(0.47, 1.0), offset=(0.01, 0.0)))
    white = made(host, mesh, painted(np.ones((2, 2, 3))))
    assert found.max() < 0.05 * white.max()


@pytest.mark.parametrize("kind", ["plain", "line", "map", "captured"])
def test_every_kind_of_material(host: PluginHost, kind: str) -> None:
    """Pictures of one colour give the coefficients of that colour; captured ones may be below 0."""
    grey = Texture(Image(np.full((4, 4, 3), 0.3, np.float32)))
    glossy = Texture(Image(np.full((4, 4, 1), 0.6, np.float32)))
    if kind == "captured":
        look = scene_material(made_up("blinn", "albedo-half")).material
    else:
        pictures = {
            "plain": {},
            "line": {"base_color": grey},
            "map": {"base_color": grey, "metallic": glossy},
        }
        values = {"base_color": (0.5, 1.0, 0.2), "metallic": 1.0}
        look = Material(id="m", name="m", model="ggx", values=values, textures=pictures[kind])
    mesh = mesh_of()
    found = made(host, mesh, look)
    own = coefficients(resolve(look, host))
    assert found.shape == (len(mesh), own.shape[-2], 3)
    assert found.dtype == np.float32
    if kind == "captured":
        assert found.min() < 0
        np.testing.assert_allclose(
            np.average(found, weights=mesh.area, axis=0), own.mean(axis=(0, 1)), atol=0.03 * np.abs(own).max()
        )
    else:
        flat = own.reshape(-1, *own.shape[-2:])[0]
        np.testing.assert_allclose(found, np.broadcast_to(flat, found.shape), rtol=1e-4, atol=1e-6)


def test_large_pictures_that_bend_are_asked_for_at_fewer_texels(host: PluginHost) -> None:
    """Two pictures of 700 texels: means over the floor are those of all texels."""
    rng = np.random.default_rng(2)
    blocks = np.ones((20, 20, 1), np.float32)
    colour = np.kron(rng.random((35, 35, 3)), blocks) + 0.05 * rng.normal(size=(700, 700, 3))
    metal = np.kron(rng.random((35, 35, 1)), blocks)
    textures = {
        "base_color": Texture(Image(np.clip(colour, 0, 1).astype(np.float32))),
        "metallic": Texture(Image(metal.astype(np.float32))),
    }
    look = Material(id="m", name="m", model="ggx", values={"metallic": 1.0}, textures=textures)
    mesh = mesh_of(edge=0.04)
    found = made(host, mesh, look)
    whole = coefficients(resolve(look, host)).mean(axis=(0, 1))
    np.testing.assert_allclose(np.average(found, weights=mesh.area, axis=0), whole, rtol=0.04, atol=1e-4)


def test_nothing_shown(host: PluginHost) -> None:
    look = painted(checkered(4, 64))
    keeper, mesh = maker(host), assemble([])
    for gain in (1.0, 0.5):
        darker = dataclasses.replace(look, values=frozen_map({"base_color": (gain, gain, gain)}))
        assert keeper(Scene().with_materials(darker), surfaces_of(mesh, darker)).shape == (0, 1, 3)


def test_only_what_changed_is_made_anew(host: PluginHost) -> None:
    one, other = painted(checkered(4, 64), "a"), painted(checkered(8, 64), "b")
    mesh = assemble(
        [
            Placed("o", shade_mesh(floor(2.0), 0.3), Transform(), (0,)),
            Placed("p", shade_mesh(cube(), 0.3), Transform((0, 2, 0)), (1,)),
        ]
    )
    keeper = maker(host)
    surfaces = surfaces_of(mesh, one, other)
    first = keeper(Scene().with_materials(one, other), surfaces)
    assert keeper.touched.all()
    assert not first.flags.writeable
    assert keeper(Scene().with_materials(one, other), surfaces) is first
    assert not keeper.touched.any()
    renamed = dataclasses.replace(other, name="Other")
    assert keeper(Scene().with_materials(one, renamed), surfaces) is first
    darker = dataclasses.replace(other, values=frozen_map({"base_color": (0.5, 0.5, 0.5)}))
    second = keeper(Scene().with_materials(one, darker), surfaces)
    np.testing.assert_array_equal(keeper.touched, mesh.material == 1)
    np.testing.assert_array_equal(second[mesh.material == 0], first[mesh.material == 0])
    np.testing.assert_allclose(second[mesh.material == 1], first[mesh.material == 1] / 2, rtol=1e-5)
    np.testing.assert_array_equal(second, made(host, mesh, one, darker))


def test_moving_leaves_everything_as_it_is(host: PluginHost) -> None:
    look = painted(checkered(4, 64))
    mesh = mesh_of()
    keeper, scene = maker(host), Scene().with_materials(look)
    first = keeper(scene, surfaces_of(mesh, look))
    moved = mesh.moved(0, Transform((1.0, 2.0, 3.0)))
    assert keeper(scene, surfaces_of(moved, look)) is first
    finer = mesh_of(edge=0.1)
    assert len(keeper(scene, surfaces_of(finer, look))) == len(finer)


def test_no_material_no_light(host: PluginHost) -> None:
    look = painted(checkered(4, 64))
    mesh = assemble(
        [
            Placed("o", shade_mesh(floor(2.0), 0.5), Transform(), (-1,)),
            Placed("p", shade_mesh(floor(2.0), 0.5), Transform((0, 1, 0)), (0,)),
        ]
    )
    found = made(host, mesh, look)
    assert not found[mesh.material < 0].any()
    assert found[mesh.material == 0].any()
    assert made(host, mesh).shape == (len(mesh), 1, 3)


def test_both_sides_of_an_open_surface_have_their_own(host: PluginHost) -> None:
    """The underside's vertices are those of the back faces alone."""
    mesh = mesh_of()
    found = made(host, mesh, painted(np.full((4, 4, 3), 0.5)))
    assert (mesh.side != mesh.side[0]).any()
    assert np.ptp(found, axis=0).max() < 1e-6
    assert found.min() > 0


def test_paint_is_added_and_marks_what_it_touches(host: PluginHost) -> None:
    grey = Material(id="m", name="m", values=frozen_map({"base_color": (0.5, 0.5, 0.5)}))
    shaded = shade_mesh(floor(2.0), 0.25)
    two = [Placed(name, shaded, Transform((at, 0.0, 0.0)), (0,)) for name, at in (("a", 0.0), ("b", 3.0))]
    mesh = assemble(two)
    one = Paint.of(
        shaded.positions, shaded.normals, shaded.slot, {"base_color": np.full((len(shaded), 3), 0.2)}
    )
    things = [MeshObject(id=name, geometry=floor(2.0), materials=("m",)) for name in "ab"]
    scene = Scene().with_materials(grey).with_nodes(*things)
    coated = scene.with_nodes(dataclasses.replace(things[1], paint=one))
    make, surfaces = maker(host), surfaces_of(mesh, grey)
    before = make(scene, surfaces)
    after = make(coated, surfaces)
    own = mesh.object == 1
    np.testing.assert_array_equal(make.touched, own)
    np.testing.assert_array_equal(after[~own], before[~own])
    np.testing.assert_allclose(after[own], before[own] * 0.7 / 0.5, rtol=1e-5)
    assert make(coated, surfaces) is after
    assert not make.touched.any()
    np.testing.assert_array_equal(make(scene, surfaces), before)
    np.testing.assert_array_equal(make.touched, own)
