"""Paint goes to other programs as pictures, and looks there as it did."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
from oracles.gltf import check, parse
from oracles.meshes import box

from studio_core.arrays import frozen_map
from studio_core.contract import Services
from studio_core.imaging.io import read_image
from studio_core.registry import PluginHost
from studio_core.scene.atlas import is_atlas
from studio_core.scene.geometry import Geometry, Image, Texture
from studio_core.scene.nodes import Camera, Environment, Material, MeshObject, PointLamp, Scene
from studio_core.scene.paint import Paint
from studio_core.scene.transform import Transform, looking
from studio_core.shading.materials import linear, linear_rgb
from studio_core.shading.normal_maps import NORMAL, normals_at
from studio_core.shading.offline import backend_params, picture, scene_view
from studio_core.strokes.paintable import paintable
from studio_plugins.brdfs import plugin as brdfs
from studio_plugins.export import plugin as export
from studio_plugins.export.baking import baked
from studio_plugins.export.glb import EXPORTER
from studio_plugins.export.mitsuba import EXPORTER as MITSUBA
from studio_plugins.meshes.gltf import IMPORTER
from studio_plugins.reference import plugin as reference


def material(model: str, textures: Any = None, **values: Any) -> Material:
    return Material(
        id="m", name="Paint", model=model, values=frozen_map(values), textures=frozen_map(textures or {})
    )


def smooth(geometry: Geometry, changes: dict[str, Any], count: int = 400) -> Paint:
    """Points all over a mesh, with changes that grow from 0 to these along x + z."""
    rng = np.random.default_rng(0)
    corners = geometry.positions[geometry.faces].astype(np.float64)
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    size = np.linalg.norm(normal, axis=1)
    face = rng.choice(len(corners), count, p=size / size.sum())
    u, v = rng.random((2, count))
    u, v = np.where(u + v > 1, (1 - u, 1 - v), (u, v))
    shares = np.stack([1 - u - v, u, v], axis=1)
    places = np.einsum("nk,nkc->nc", shares, corners[face])
    along = places[:, 0] + places[:, 2]
    share = (along - along.min()) / np.ptp(along)
    slots = np.zeros(count) if geometry.slots is None else geometry.slots[face]
    made = {name: np.multiply.outer(share, np.asarray(change)) for name, change in changes.items()}
    return Paint.of(places, (normal / size[:, None])[face], slots, made)


def scene_of(look: Material, geometry: Geometry, paint: Paint | None) -> Scene:
    pixels = np.full((8, 16, 3), 0.3, np.float32)
    pixels[1:4, 3:7] = 3.0
    thing = MeshObject(id="box", name="Box", geometry=geometry, materials=(look.id,), paint=paint)
    lamp = PointLamp(id="lamp", intensity=4.0, transform=Transform((-1.2, 2.2, -1.0)))
    eye = Camera(id="eye", name="Eye", transform=looking((1.6, 1.4, 2.0), (0, 0.5, 0)))
    sky = Environment(id="sky", image=Image(pixels), background=False)
    return Scene().with_materials(look).with_nodes(thing, lamp, eye, sky)


def shaded(scene: Scene, services: Services) -> Any:
    backend = services.registry.get("backend", "reference")
    params = backend_params(backend, {"directions": "1024", "vertices": 6000})
    view = dataclasses.replace(scene_view(scene, "eye", 64, 48), antialias=1)
    return picture(scene, view, backend, params, services).linear


def again(scene: Scene, host: PluginHost, path: Path) -> tuple[Scene, tuple[str, ...]]:
    """What the file's objects are, in the place of the scene's."""
    notes = EXPORTER.save(scene, path, host)
    check(*parse(path.read_bytes()))
    model = IMPORTER.load(path)
    objects = [dataclasses.replace(node, parent=None) for node in model.objects]
    kept = {name: node for name, node in scene.nodes.items() if not isinstance(node, MeshObject)}
    bare = dataclasses.replace(scene, nodes=frozen_map(kept), materials=frozen_map())
    return bare.with_materials(*model.materials).with_nodes(*objects), notes


def cube() -> Geometry:
    plain = box((1, 1, 1), (-0.5, 0, -0.5))
    return Geometry(plain.positions, plain.faces, plain.normals)


CASES = {
    "matte": ("lambert", {"base_color": (0.5, 0.4, 0.3)}, {"diffuse": (0.3, -0.2, 0.2)}),
    "shine": (
        "lambert",
        {"base_color": (0.5, 0.4, 0.3)},
        {"diffuse": (-0.3, 0.2, 0.0), "specular": (0.4, 0.2, 0.1), "roughness": -0.25},
    ),
    "gloss": ("ggx", {"base_color": (0.5, 0.4, 0.3), "roughness": 0.3}, {"roughness": 0.5}),
    "metal": (
        "ggx",
        {"base_color": (0.9, 0.6, 0.3), "metallic": 1.0, "roughness": 0.5},
        {"specular": (-0.5, -0.2, 0.2)},
    ),
}


@pytest.mark.parametrize("case", CASES)
def test_a_painted_object_comes_back_from_a_file_as_it_was(case: str, workers: Any, tmp_path: Path) -> None:
    host = PluginHost([brdfs, export, reference])
    model, values, changes = CASES[case]
    look = paintable(material(model, **values), host)
    scene = scene_of(look, cube(), smooth(cube(), changes))
    services = Services(workers, host)
    made, notes = again(scene, host, tmp_path / "box.glb")
    assert not any("paint" in note for note in notes), notes
    expected, found = shaded(scene, services), shaded(made, services)
    plain = shaded(scene.with_nodes(dataclasses.replace(scene["box"], paint=None)), services)

    def off(one: Any) -> float:
        return float(np.sqrt(np.square(one - expected).mean() / np.square(expected).mean()))

    print(f"{case}: {off(found):.4f} off, without paint {off(plain):.4f}")
    assert off(found) < 0.02
    assert off(plain) > 5 * off(found)


def slanted(texture: Any = None) -> tuple[Geometry, Any]:
    """A sheet of 2 by 1 with coordinates that are no atlas, and the coordinates of its places."""
    positions = np.array([[0, 0, 0], [2, 0, 0], [2, 0, -1], [0, 0, -1]], np.float32)
    faces = np.array([[0, 1, 2], [0, 2, 3]], np.uint32)
    normals = np.tile(np.array([0, 1, 0], np.float32), (4, 1))
    turn = np.array([[0.8, 0.6], [-0.6, 0.8]])

    def uvs(places: Any) -> Any:
        return (places[:, [0, 2]] * [1, -1]) @ turn * 1.5 + 0.3

    return Geometry(positions, faces, normals, uvs(positions).astype(np.float32)), uvs


def waves(seed: int, low: float, channels: int = 3) -> Texture:
    rng = np.random.default_rng(seed)
    v, u = np.indices((32, 32)) / 32
    turn = rng.uniform(0, 2 * np.pi, (channels, 2))
    rows = [np.sin(2 * np.pi * u + a) * np.cos(2 * np.pi * v + b) for a, b in turn]
    pixels = low + (1 - low) * (np.stack(rows, axis=2) + 1) / 2
    return Texture(Image(pixels.astype(np.float32)), (0.5, 0.7), (0.2, 0.1), 30.0)


def looked_up(texture: Texture, places: Any, geometry: Geometry) -> Any:
    """Linear texels of a flat sheet's places, by the coordinates of its nearest corners."""
    a, b = geometry.positions[:, [0, 2]], geometry.uvs
    assert b is not None
    affine = np.linalg.lstsq(np.column_stack([a, np.ones(len(a))]), b, rcond=None)[0]
    uvs = np.column_stack([places[:, [0, 2]], np.ones(len(places))]) @ affine
    placed = texture.placed(uvs.astype(np.float32)) % 1
    height, width = texture.image.pixels.shape[:2]
    rows = linear_rgb(texture.image)[::-1]
    return rows[(placed[:, 1] * height).astype(int) % height, (placed[:, 0] * width).astype(int) % width]


def test_paint_lies_over_the_pictures_that_were_there(host: PluginHost) -> None:
    geometry, _ = slanted()
    textures = {"diffuse": waves(1, 0.2), "roughness": waves(2, 0.5, 1)}
    look = material("specgloss", textures, diffuse=(0.8, 0.7, 0.6), roughness=0.8)
    paint = smooth(geometry, {"diffuse": (0.2, -0.1, 0.1), "roughness": -0.3})
    made, notes = baked(scene_of(look, geometry, paint), host)
    assert notes == []
    node = made["box"]
    assert isinstance(node, MeshObject)
    assert node.paint is None
    assert is_atlas(node.geometry)
    new = made.material(node.materials[0])
    rng = np.random.default_rng(3)
    places = np.stack([rng.uniform(0.1, 1.9, 500), np.zeros(500), rng.uniform(-0.9, -0.1, 500)], axis=1)
    up = np.tile([0.0, 1, 0], (500, 1))
    weights = paint.weights(places, up, np.zeros(500))
    infos = {"diffuse": (0.0, 1.0), "roughness": (0.0, 1.0)}
    for name, (low, high) in infos.items():
        before = looked_up(textures[name], places, geometry) * np.asarray(look.values[name])
        expected = np.clip(before + weights(paint.change(name)), low, high)
        found = looked_up(new.textures[name], places, node.geometry) * np.asarray(new.values[name])
        assert np.abs(found - expected).mean() < 0.03
        assert np.abs(found - before).mean() > 0.06


def test_normal_maps_are_turned_with_new_charts(host: PluginHost) -> None:
    geometry, _ = slanted()
    rng = np.random.default_rng(1)
    tilts = rng.uniform(0.3, 0.7, (1, 1, 3)) * np.ones((8, 8, 1))
    tilts[..., 2] = 0.95
    bumps = Texture(Image(tilts.astype(np.float32), "data"), (0.5, 0.7), (0.0, 0.0), 30.0)
    look = material("specgloss", {NORMAL: bumps, "diffuse": waves(1, 0.2)}, normal=2.0)
    paint = smooth(geometry, {"diffuse": (0.2, -0.1, 0.1)})
    made, _ = baked(scene_of(look, geometry, paint), host)
    node = made["box"]
    assert isinstance(node, MeshObject)
    new = made.material(node.materials[0])

    def in_space(mesh: Geometry, texture: Texture, strong: float) -> Any:
        assert mesh.uvs is not None
        place, uv = mesh.positions[mesh.faces[0]].astype(float), mesh.uvs[mesh.faces[0]].astype(float)
        along = np.linalg.solve(uv[1:] - uv[0], place[1:] - place[0])
        along /= np.linalg.norm(along, axis=1, keepdims=True)
        local = normals_at(texture, strong, np.array([[0.5, 0.5]], np.float32))[0]
        return local[0] * along[0] + local[1] * along[1] + local[2] * np.array([0, 1, 0])

    assert new.values[NORMAL] == 1.0
    expected = in_space(geometry, bumps, 2.0)
    np.testing.assert_allclose(in_space(node.geometry, new.textures[NORMAL], 1.0), expected, atol=1e-3)
    assert np.abs(expected[[0, 2]]).max() > 0.2


def test_coordinates_that_are_an_atlas_stay(host: PluginHost, parts: Any) -> None:
    quad = parts["quad"]()
    bumps = Texture(Image(np.full((2, 2, 3), 0.6, np.float32), "data"))
    look = material("specgloss", {NORMAL: bumps})
    made, notes = baked(scene_of(look, quad, smooth(quad, {"specular": (0.5, 0.4, 0.3)})), host)
    node = made["box"]
    assert isinstance(node, MeshObject)
    np.testing.assert_array_equal(node.geometry.uvs, quad.uvs)
    assert made.material(node.materials[0]).textures[NORMAL] is bumps
    assert notes == []


def test_only_what_is_painted_changes(host: PluginHost, parts: Any) -> None:
    cube = parts["cube"]()
    slots = np.repeat(np.array([0, 1], np.uint16), 6)
    geometry = dataclasses.replace(cube, slots=slots)
    paint = smooth(geometry, {"diffuse": (0.1, 0.1, 0.1)})
    half = paint.slots == 1
    changes = {"diffuse": paint.change("diffuse")[half]}
    paint = Paint.of(paint.places[half], paint.normals[half], paint.slots[half], changes)
    look, other = material("specgloss"), dataclasses.replace(material("specgloss"), id="other")
    scene = scene_of(look, geometry, None).with_materials(other)
    twin = MeshObject(id="twin", geometry=geometry, materials=("m", "other"))
    node = dataclasses.replace(twin, id="box", name="Box", paint=paint)
    made, _ = baked(scene.with_nodes(node, twin), host)
    assert made["twin"] is twin
    found = made["box"]
    assert isinstance(found, MeshObject)
    assert found.materials[0] == "m"
    assert found.materials[1] not in ("m", "other")
    assert made.material("other") is other
    assert found.geometry.slots is not None
    np.testing.assert_array_equal(np.bincount(found.geometry.slots), [6, 6])
    first = found.geometry.faces[found.geometry.slots == 0]
    assert found.geometry.uvs is not None
    assert cube.uvs is not None
    np.testing.assert_array_equal(found.geometry.uvs[first], cube.uvs[cube.faces[:6]])


def test_what_cannot_be_a_picture_is_said(host: PluginHost) -> None:
    look = material("phong", diffuse=(0.3, 0.2, 0.1), specular=(0.2, 0.2, 0.2), exponent=40.0)
    made, notes = baked(scene_of(look, cube(), smooth(cube(), {"exponent": 1.0})), host)
    assert notes == ["Box: Paint is Phong; painted, it goes as Colour and shine."]
    (new,) = (made.material(name) for name in made["box"].materials)  # type: ignore[attr-defined]
    assert new.model == "specgloss"
    widths = new.textures["roughness"].image.pixels
    assert widths.min() == pytest.approx((2 / (160 * np.e + 2)) ** 0.25, rel=0.02)
    assert widths.max() == pytest.approx((2 / 162) ** 0.25, rel=0.02)
    look = material("plastic")
    _, notes = baked(scene_of(look, cube(), smooth(cube(), {"ior": 0.3})), host)
    assert notes == ["Box: what was painted of the index of refraction of Paint was left out."]
    look = material("ggx", {"base_color": waves(1, 0.2)})
    sheet, _ = slanted()
    _, notes = baked(scene_of(look, sheet, smooth(sheet, {"base_color": (0.1, 0.1, 0.1)})), host, 16)
    assert len(notes) == 1
    assert "instead of" in notes[0]


def test_mitsuba_gets_the_pictures(host: PluginHost, tmp_path: Path) -> None:
    look = paintable(material("lambert", base_color=(0.5, 0.4, 0.3)), host)
    paint = smooth(cube(), {"diffuse": (0.3, -0.2, 0.2), "specular": (0.3, 0.2, 0.1), "roughness": -0.2})
    notes = MITSUBA.save(scene_of(look, cube(), paint), tmp_path, host)
    assert any("roughness was written as its mean" in note for note in notes)
    root = ElementTree.parse(tmp_path / "scene.xml").getroot()
    side = root.find("bsdf[@type='lucarne_specgloss']")
    assert side is not None
    files = {t.get("name"): t.find("string[@name='filename']") for t in side.findall("texture")}
    pixels = linear(read_image(tmp_path / str(files["specular"].get("value"))))  # type: ignore[union-attr]
    assert pixels.max() == pytest.approx(0.3, abs=0.02)


def test_paint_that_follows_a_picture_stays_on_what_looks_alike(host: PluginHost) -> None:
    """Dark and light squares; what was painted on light ones alone does not run over."""
    geometry, _ = slanted()
    squares = np.kron(np.indices((4, 4)).sum(axis=0) % 2, np.ones((8, 8)))[..., None] * np.ones(3) * 0.8 + 0.1
    checks = Texture(Image(squares.astype(np.float32)))
    paint = smooth(geometry, {"diffuse": (0.0, 0.0, 0.0)}, 2000)
    light = looked_up(checks, paint.places, geometry)
    changes = {"diffuse": np.where(light > 0.5, np.array([-0.3, 0, 0]), 0)}
    paint = Paint.of(paint.places, paint.normals, paint.slots, changes, np.cbrt(light))
    look = material("specgloss", {"diffuse": checks}, diffuse=(1.0, 1.0, 1.0))
    made, _ = baked(scene_of(look, geometry, paint), host)
    node = made["box"]
    assert isinstance(node, MeshObject)
    rng = np.random.default_rng(3)
    places = np.stack([rng.uniform(0.1, 1.9, 900), np.zeros(900), rng.uniform(-0.9, -0.1, 900)], axis=1)
    before = looked_up(checks, places, geometry)
    found = looked_up(made.material(node.materials[0]).textures["diffuse"], places, node.geometry)
    change = (found - before)[:, 0]
    bright = before[:, 0] > 0.5
    assert np.median(change[bright]) == pytest.approx(-0.3, abs=0.02)
    assert np.median(change[~bright]) == pytest.approx(0, abs=0.02)
    assert (np.abs(change[~bright]) > 0.1).mean() < 0.15
