"""GLB files against the rules of glTF, and read back by trimesh."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from oracles.gltf import check, parse, read

from studio_core.errors import InputError
from studio_core.imaging.io import read_image
from studio_core.registry import PluginHost
from studio_core.scene.geometry import Geometry, Image, Texture
from studio_core.scene.nodes import (
    AreaLamp,
    Camera,
    DirectionalLamp,
    Environment,
    Group,
    Material,
    MeshObject,
    PointLamp,
    Scene,
    SpotLamp,
)
from studio_core.scene.transform import Transform, looking
from studio_core.shading.materials import linear
from studio_core.shading.normal_maps import unit_normals
from studio_plugins.export.glb import EXPORTER
from studio_plugins.meshes.gltf import IMPORTER


def exported(scene: Scene, host: PluginHost, folder: Path) -> tuple[dict[str, Any], bytes, tuple[str, ...]]:
    notes = EXPORTER.save(scene, folder / "out.glb", host)
    document, binary = parse((folder / "out.glb").read_bytes())
    check(document, binary)
    return document, binary, notes


def node(document: dict[str, Any], name: str) -> dict[str, Any]:
    return next(n for n in document["nodes"] if n["name"] == name)


def test_hierarchy_and_instances(room: Scene, host: PluginHost, tmp_path: Path) -> None:
    document, _, notes = exported(room, host, tmp_path)
    assert notes == ("Sky: glTF holds no environment; it was left out.",)
    group = node(document, "Group")
    assert [document["nodes"][child]["name"] for child in group["children"]] == ["Left", "Right"]
    assert node(document, "Left")["mesh"] == node(document, "Right")["mesh"]
    alone = document["meshes"][node(document, "Alone")["mesh"]]["primitives"][0]
    left = document["meshes"][node(document, "Left")["mesh"]]["primitives"][0]
    assert alone["attributes"] == left["attributes"]
    assert alone["material"] != left["material"]
    camera = document["cameras"][node(document, "Eye")["camera"]]
    np.testing.assert_allclose(camera["perspective"]["yfov"], np.radians(50))


def test_trimesh_reads_what_stood_there(room: Scene, host: PluginHost, tmp_path: Path) -> None:
    trimesh = pytest.importorskip("trimesh")
    EXPORTER.save(room, tmp_path / "out.glb", host)
    read_back = trimesh.load_scene(tmp_path / "out.glb")
    for name, key in (("Left", "left"), ("Right", "right"), ("Alone", "alone"), ("Wall", "wall")):
        matrix, mesh = read_back.graph[name]
        original = room[key]
        assert isinstance(original, MeshObject)
        np.testing.assert_allclose(matrix, room.world(key).matrix(), atol=1e-6)
        made = read_back.geometry[mesh]
        np.testing.assert_allclose(made.vertices, original.geometry.positions, atol=1e-7)
        np.testing.assert_array_equal(made.faces, original.geometry.faces)
        np.testing.assert_allclose(made.vertex_normals, original.geometry.normals, atol=1e-6)
        np.testing.assert_allclose(made.visual.uv, original.geometry.uvs, atol=1e-6)
        colour = room.material(original.materials[0]).values["base_color"]
        factor = np.asarray(made.visual.material.baseColorFactor, float)
        factor = factor / 255 if factor.max() > 1 else factor
        np.testing.assert_allclose(factor[:3], colour, atol=1 / 255)
        assert made.visual.material.metallicFactor == 0
        assert made.visual.material.roughnessFactor == 1
    picture = np.asarray(read_back.geometry[read_back.graph["Wall"][1]].visual.material.baseColorTexture)
    wall = room.material("poster").textures["base_color"].image
    np.testing.assert_array_equal(picture, wall.pixels)


def test_texture_coordinates_meet_the_same_texel(room: Scene, host: PluginHost, tmp_path: Path) -> None:
    document, binary, _ = exported(room, host, tmp_path)
    primitive = document["meshes"][node(document, "Wall")["mesh"]]["primitives"][0]
    uv = read(document, binary, primitive["attributes"]["TEXCOORD_0"])
    info = document["materials"][primitive["material"]]["pbrMetallicRoughness"]["baseColorTexture"]
    moved = info["extensions"]["KHR_texture_transform"]
    theirs = khr_texture_transform(moved, uv)  # from the top left
    texture = room.material("poster").textures["base_color"]
    wall = room["wall"]
    assert isinstance(wall, MeshObject)
    ours = texture.placed(np.asarray(wall.geometry.uvs))  # from the bottom left
    np.testing.assert_allclose(theirs, np.stack([ours[:, 0], 1 - ours[:, 1]], axis=1), atol=1e-6)


def khr_texture_transform(moved: dict[str, Any], uv: npt.NDArray[np.float32]) -> npt.NDArray[np.float64]:
    """(P, 2): scaled, then turned counter-clockwise as one sees it where v runs down, then moved."""
    angle = moved.get("rotation", 0.0)
    turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    return np.asarray((uv * moved.get("scale", 1)) @ turn.T + moved.get("offset", 0))


def test_what_gltf_cannot_turn_is_said(room: Scene, host: PluginHost, tmp_path: Path) -> None:
    poster = room.material("poster")
    uneven = dataclasses.replace(poster.textures["base_color"], scale=(1.0, 3.0))
    changed = dataclasses.replace(poster, textures={"base_color": uneven})
    notes = exported(room.with_materials(changed), host, tmp_path)[2]
    assert any("sheared" in note for note in notes)
    square = dataclasses.replace(uneven, rotation=90.0)
    changed = dataclasses.replace(poster, textures={"base_color": square})
    notes = exported(room.with_materials(changed), host, tmp_path)[2]
    assert not any("sheared" in note for note in notes)


def test_lamps_are_punctual(host: PluginHost, tmp_path: Path) -> None:
    scene = Scene().with_nodes(
        PointLamp(id="p", name="Bulb", intensity=4.0, tint=(0.5, 1.0, 0.25)),
        SpotLamp(id="s", name="Spot", cone=40.0, inner=40.0, transform=looking((0, 3, 0), (0, 0, 0))),
        DirectionalLamp(id="d", name="Sun", intensity=2.0),
        AreaLamp(id="a", name="Panel", intensity=3.0, width=2.0, height=0.5, transform=Transform(scale=2.0)),
        PointLamp(id="o", name="Off", intensity=0.0),
        Environment(id="e", name="Sky", image=Image(np.ones((2, 4, 3), np.float32)), luminance_scale=100.0),
    )
    document, _, notes = exported(scene, host, tmp_path)
    lights = document["extensions"]["KHR_lights_punctual"]["lights"]
    by_name = {light["name"]: light for light in lights}
    assert by_name["Bulb"]["type"] == "point"
    assert by_name["Bulb"]["intensity"] == 400
    assert by_name["Bulb"]["color"] == [0.5, 1.0, 0.25]
    np.testing.assert_allclose(by_name["Spot"]["spot"]["outerConeAngle"], np.radians(40))
    assert by_name["Sun"]["type"] == "directional"
    assert by_name["Panel"]["intensity"] == 3 * 4 * 100
    for name in ("Sun", "Panel", "Off", "Sky"):
        assert sum(name in note for note in notes) == 1, name


def box(material: Material, mesh: Geometry) -> Scene:
    return Scene().with_materials(material).with_nodes(MeshObject(id="box", geometry=mesh, materials=("m",)))


@pytest.mark.parametrize("specular", [0.0, 0.25, 1.0])
def test_ggx_keeps_its_reflectance(host: PluginHost, parts: Any, tmp_path: Path, specular: float) -> None:
    values = {"base_color": (0.2, 0.4, 0.6), "metallic": 0.25, "roughness": 0.3, "specular": specular}
    document, _, notes = exported(
        box(Material(id="m", model="ggx", values=values), parts["cube"]()), host, tmp_path
    )
    made = document["materials"][0]
    assert made["pbrMetallicRoughness"]["baseColorFactor"] == [0.2, 0.4, 0.6, 1.0]
    assert made["pbrMetallicRoughness"]["metallicFactor"] == 0.25
    assert made["pbrMetallicRoughness"]["roughnessFactor"] == 0.3
    ior = made["extensions"]["KHR_materials_ior"]["ior"]
    np.testing.assert_allclose(((ior - 1) / (ior + 1)) ** 2, 0.08 * specular, atol=1e-12)
    assert notes == ()


def test_phong_becomes_the_nearest_gloss(host: PluginHost, parts: Any, tmp_path: Path) -> None:
    metal = {"diffuse": (0.0, 0.0, 0.0), "specular": (0.9, 0.6, 0.3), "exponent": 100.0}
    document, _, notes = exported(
        box(Material(id="m", model="phong", values=metal), parts["cube"]()), host, tmp_path
    )
    made = document["materials"][0]["pbrMetallicRoughness"]
    assert made["metallicFactor"] == 1
    np.testing.assert_allclose(made["baseColorFactor"][:3], (0.9, 0.6, 0.3))
    assert 2 / 402 < made["roughnessFactor"] ** 4 < 2 * 2 / 402
    assert len(notes) == 1
    assert "% off" in notes[0]
    plastic = {"diffuse": (0.5, 0.5, 0.5), "specular": (0.2, 0.2, 0.2), "exponent": 400.0}
    material = Material(id="m", model="blinn-phong", values=plastic)
    document, _, _ = exported(box(material, parts["cube"]()), host, tmp_path)
    made = document["materials"][0]
    assert made["pbrMetallicRoughness"]["metallicFactor"] == 0
    assert 2 / 402 < made["pbrMetallicRoughness"]["roughnessFactor"] ** 4 < 2 * 2 / 402
    ior = made["extensions"]["KHR_materials_ior"]["ior"]
    weight = made["extensions"]["KHR_materials_specular"]["specularFactor"]
    np.testing.assert_allclose(weight * ((ior - 1) / (ior + 1)) ** 2, 0.2)
    assert weight == pytest.approx(0.8)  # what it reflects at the rim


def test_textures_of_metal_and_of_light(host: PluginHost, parts: Any, tmp_path: Path) -> None:
    pixels = np.linspace(0, 1, 12, dtype=np.float32).reshape(2, 2, 3)
    material = Material(
        id="m",
        model="ggx",
        opacity=0.5,
        textures={"base_color": Texture(Image(pixels)), "metallic": Texture(Image(pixels[..., :1]))},
    )
    document, binary, _ = exported(box(material, parts["cube"]()), host, tmp_path)
    made = document["materials"][0]
    assert made["alphaMode"] == "BLEND"
    assert made["pbrMetallicRoughness"]["baseColorFactor"][3] == 0.5
    view = document["bufferViews"][document["images"][1]["bufferView"]]
    data = binary[view["byteOffset"] :][: view["byteLength"]]
    metal = read_image(data, "metal.png").pixels
    np.testing.assert_array_equal(metal[..., 2], np.rint(pixels[..., 0] * 255))
    assert (metal[..., 1] == 255).all()


def test_textures_of_metal_and_roughness_are_one(host: PluginHost, parts: Any, tmp_path: Path) -> None:
    """Of two sizes; read again, they are the pictures they were."""
    rough = np.linspace(0.1, 1, 16).reshape(4, 4, 1)
    metal = np.array([[0.0, 1.0], [1.0, 0.4]]).reshape(2, 2, 1)
    pictures = {
        "roughness": Texture(Image(np.rint(255 * rough).astype(np.uint8), "data")),
        "metallic": Texture(Image(np.rint(255 * metal).astype(np.uint8), "data")),
    }
    material = Material(id="m", model="ggx", values={"roughness": 0.7, "metallic": 0.9}, textures=pictures)
    scene = box(material, parts["cube"]())
    document, _, _ = exported(scene, host, tmp_path)
    assert len(document["images"]) == 1
    again = IMPORTER.load(next(tmp_path.glob("*.glb"))).materials[0]
    assert again.values["roughness"] == pytest.approx(0.7)
    assert again.values["metallic"] == pytest.approx(0.9)
    np.testing.assert_array_equal(
        again.textures["roughness"].image.pixels, pictures["roughness"].image.pixels
    )
    doubled = pictures["metallic"].image.pixels.repeat(2, axis=0).repeat(2, axis=1)
    np.testing.assert_array_equal(again.textures["metallic"].image.pixels, doubled)
    moved = {**pictures, "metallic": Texture(pictures["metallic"].image, (2.0, 2.0))}
    scene = box(dataclasses.replace(material, textures=moved), parts["cube"]())
    document, _, notes = exported(scene, host, tmp_path)
    made = document["materials"][0]["pbrMetallicRoughness"]
    assert made["roughnessFactor"] == pytest.approx(0.7 * rough.mean(), abs=2e-3)
    assert any("roughness" in note for note in notes)


def test_meshes_without_normals_get_the_studios(host: PluginHost, parts: Any, tmp_path: Path) -> None:
    cube = parts["cube"]()
    corners, index = np.unique(cube.positions, axis=0, return_inverse=True)
    plain = Geometry(corners, index.reshape(-1)[cube.faces.astype(int)].astype(np.uint32))
    document, binary, _ = exported(box(Material(id="m"), plain), host, tmp_path)
    attributes = document["meshes"][0]["primitives"][0]["attributes"]
    normals = read(document, binary, attributes["NORMAL"])
    np.testing.assert_allclose(np.abs(normals).max(axis=1), 1, atol=1e-6)  # creases: flat faces
    positions = read(document, binary, attributes["POSITION"])
    np.testing.assert_allclose(
        0.5 * normals[np.abs(normals) > 0.5], positions[np.abs(normals) > 0.5], atol=1e-6
    )


def test_slots_are_primitives_on_the_same_vertices(host: PluginHost, parts: Any, tmp_path: Path) -> None:
    cube = parts["cube"]()
    slots = np.repeat([0, 1, 1], 4).astype(np.uint16)
    mesh = Geometry(cube.positions, cube.faces, cube.normals, cube.uvs, slots)
    scene = (
        Scene()
        .with_materials(Material(id="a"), Material(id="b"))
        .with_nodes(MeshObject(id="box", geometry=mesh, materials=("a", "b")))
    )
    document, binary, _ = exported(scene, host, tmp_path)
    first, second = document["meshes"][0]["primitives"]
    assert first["attributes"] == second["attributes"]
    assert [len(read(document, binary, p["indices"])) for p in (first, second)] == [12, 24]


def test_large_meshes_have_wide_indices(host: PluginHost, tmp_path: Path) -> None:
    count = 70_000
    positions = np.random.default_rng(0).random((count, 3), np.float32)
    normals = np.tile(np.float32([0, 0, 1]), (count, 1))
    faces = np.arange(count - 1, dtype=np.uint32)[: 3 * (count // 3)].reshape(-1, 3)
    document, _, _ = exported(box(Material(id="m"), Geometry(positions, faces, normals)), host, tmp_path)
    primitive = document["meshes"][0]["primitives"][0]
    assert document["accessors"][primitive["indices"]]["componentType"] == 5125


def test_hidden_and_empty_things(room: Scene, host: PluginHost, parts: Any, tmp_path: Path) -> None:
    hidden = room.with_nodes(dataclasses.replace(room["group"], hidden=True))
    document, _, notes = exported(hidden, host, tmp_path)
    names = {n["name"] for n in document["nodes"]}
    assert names == {"Alone", "Wall", "Eye"}
    assert "Hidden nodes were left out." in notes
    nothing = Geometry(np.zeros((0, 3), np.float32), np.zeros((0, 3), np.uint32))
    document, _, notes = exported(box(Material(id="m"), nothing), host, tmp_path)
    assert "mesh" not in document["nodes"][0]
    document, binary, _ = exported(Scene(), host, tmp_path)
    assert "nodes" not in document
    assert binary == b""
    exported(Scene().with_nodes(Group(id="g"), Camera(id="c", name="C", parent="g")), host, tmp_path)


def test_a_place_that_cannot_be_written_is_named(room: Scene, host: PluginHost, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="nowhere"):
        EXPORTER.save(room, tmp_path / "nowhere" / "out.glb", host)
    assert not list(tmp_path.iterdir())


def test_what_hangs_on_the_sky_stays_in_place(room: Scene, host: PluginHost, tmp_path: Path) -> None:
    sky, alone = (
        dataclasses.replace(room[key], parent=parent) for key, parent in (("sky", None), ("alone", "sky"))
    )
    sky = dataclasses.replace(sky, transform=Transform((1.0, 2.0, 3.0)))
    document, _, _ = exported(room.with_nodes(sky, alone), host, tmp_path)
    parent = node(document, "Sky")
    assert parent["translation"] == [1.0, 2.0, 3.0]
    assert [document["nodes"][child]["name"] for child in parent["children"]] == ["Alone"]


def round_trip(
    made: Material, mesh: Geometry, host: PluginHost, folder: Path
) -> tuple[Material, tuple[str, ...]]:
    _, _, notes = exported(box(made, mesh), host, folder)
    return IMPORTER.load(folder / "out.glb").materials[0], notes


@pytest.mark.parametrize(
    ("model", "values", "again"),
    [
        ("lambert", {"base_color": (0.3, 0.2, 0.1)}, "lambert"),
        ("ggx-dielectric", {"tint": (0.9, 0.8, 0.7), "ior": 1.7, "roughness": 0.3}, "ggx-dielectric"),
        ("plastic", {"base_color": (0.3, 0.2, 0.1), "gloss": 0.6, "ior": 1.4, "roughness": 0.3}, "plastic"),
        ("ward", {"diffuse": (0.0,) * 3, "specular": (0.9, 0.8, 0.7), "direction": 25.0}, "ward"),
    ],
)
def test_models_come_back_as_themselves(
    host: PluginHost, parts: Any, tmp_path: Path, model: str, values: dict[str, Any], again: str
) -> None:
    made = Material(id="m", name="Thing", model=model, values=values)
    found, notes = round_trip(made, parts["cube"](), host, tmp_path)
    assert found.model == again
    for name in {"tint", "ior", "gloss", "direction", "base_color"} & set(values):
        if (model, name) != ("plastic", "base_color"):  # there the colour below is written as what it returns
            np.testing.assert_allclose(found.values[name], values[name], rtol=1e-5)
    assert any("% off" in note for note in notes) == (model != "lambert")


def test_sheen_is_written_for_cloth(host: PluginHost, parts: Any, tmp_path: Path) -> None:
    from studio_core.exchange.surface import Surface
    from studio_plugins.export.gltf_buffer import Buffer
    from studio_plugins.export.gltf_materials import Materials

    picture = Texture(Image(np.full((2, 2, 3), 0.5, np.float32)))
    writer = Materials(Scene(), host, Buffer())
    made = writer.written(
        Surface(
            sheen_color=(0.2, 0.3, 0.4),
            sheen_roughness=0.6,
            textures={"sheen_color": picture, "sheen_roughness": picture},
        )
    )
    told = made["extensions"]["KHR_materials_sheen"]
    assert told["sheenColorFactor"] == [0.2, 0.3, 0.4]
    assert told["sheenRoughnessFactor"] == pytest.approx(0.3)
    assert told["sheenColorTexture"] == {"index": 0}
    assert any("sheen roughness" in note for note in writer.notes)


@pytest.mark.parametrize("strong", [1.0, 0.4, -1.5])
@pytest.mark.parametrize("eight", [True, False])
def test_normal_maps_come_back(
    host: PluginHost, parts: Any, tmp_path: Path, strong: float, eight: bool
) -> None:
    rng = np.random.default_rng(3)
    pixels = rng.integers(60, 256, (4, 3, 3), dtype=np.uint8)
    pixels[..., 2] = np.maximum(pixels[..., 2], 180)
    image = Image(pixels, "data") if eight else Image(pixels.astype(np.float32) / 255, "data")
    texture = Texture(image, (2.0, 2.0), (0.25, 0.5), 40.0)
    made = Material(id="m", model="ggx", values={"normal": strong}, textures={"normal": texture})
    found, notes = round_trip(made, parts["cube"](), host, tmp_path)
    np.testing.assert_allclose(found.textures["normal"].affine, texture.affine, atol=1e-6)
    back = unit_normals(found.textures["normal"].image, float(found.values["normal"]))  # type: ignore[arg-type]
    np.testing.assert_allclose(back, unit_normals(image, strong), atol=0.02)
    assert notes == ()
    if eight and strong > 0:
        np.testing.assert_array_equal(found.textures["normal"].image.pixels, pixels)


@settings(max_examples=4, suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
@given(seed=st.integers(0, 1000), gloss=st.floats(0.1, 1), roughness=st.floats(0, 1))
def test_pictures_come_back_within_eight_bits(
    host: PluginHost, parts: Any, tmp_path: Path, seed: int, gloss: float, roughness: float
) -> None:
    rng = np.random.default_rng(seed)
    laid = (0.25, 0.125), float(rng.uniform(-90, 90))
    colour = Texture(Image(rng.random((3, 4, 3), np.float32)), (2.0, 2.0), *laid)
    share = Texture(Image(rng.random((5, 2, 1), np.float32), "data"), (2.0, 2.0), *laid)
    made = Material(
        id="m", model="ggx", values={"roughness": roughness, "metallic": gloss},
        textures={"base_color": colour, "metallic": share, "roughness": share},
    )  # fmt: skip
    found, _ = round_trip(made, parts["cube"](), host, tmp_path)
    assert set(found.textures) == {"base_color", "metallic", "roughness"}
    for name, texture in made.textures.items():
        np.testing.assert_allclose(found.textures[name].affine, texture.affine, atol=1e-6)
        np.testing.assert_allclose(
            linear(found.textures[name].image)[..., 0],
            np.asarray(texture.image.pixels)[..., 0],
            atol=0.006 if name == "base_color" else 0.5 / 255 + 1e-6,
        )
    glossy = Material(id="m", model="plastic", values={"gloss": gloss}, textures={"gloss": share})
    found, _ = round_trip(glossy, parts["cube"](), host, tmp_path)
    np.testing.assert_allclose(
        linear(found.textures["gloss"].image), share.image.pixels, atol=0.5 / 255 + 1e-6
    )
