"""glTF: hierarchy, instances, baking, attributes, materials, and damaged files."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from gltf_writer import SQUARE, TRIANGLE, Writer, square

from studio_core.contract import ImportedModel
from studio_core.errors import InputError
from studio_core.imaging.encode import encode_png
from studio_core.scene.nodes import Group, MeshObject, Scene
from studio_plugins.meshes.gltf import IMPORTER


def load(folder: Path, data: bytes | Writer, unit: float = 1.0, name: str = "model.glb") -> ImportedModel:
    path = folder / name
    path.write_bytes(data.glb() if isinstance(data, Writer) else data)
    return IMPORTER.load(path, unit)


def world(model: ImportedModel, node: MeshObject) -> np.ndarray:
    """World positions of an object."""
    matrix = Scene().with_nodes(*model.nodes).world(node.id).matrix()
    made: np.ndarray = node.geometry.positions.astype(float) @ matrix[:3, :3].T + matrix[:3, 3]
    return made


@pytest.mark.parametrize("text", [False, True])
def test_a_single_mesh_is_one_object(tmp_path: Path, text: bool) -> None:
    made = square()
    model = load(tmp_path, made.gltf() if text else made.glb(), 0.01)
    (node,) = model.nodes
    assert isinstance(node, MeshObject)
    assert node.name == "seat"
    np.testing.assert_allclose(node.geometry.positions, SQUARE * 0.01, atol=1e-9)
    assert node.geometry.faces.tolist() == [[0, 1, 2], [0, 2, 3]]
    assert node.geometry.normals is None


def test_external_buffers_are_read_from_beside_the_file(tmp_path: Path) -> None:
    made = square()
    whole = made.whole()
    whole["buffers"][0]["uri"] = "Some%20data.bin"
    (tmp_path / "some data.bin").write_bytes(bytes(made.data))
    assert load(tmp_path, json.dumps(whole).encode(), name="model.gltf").objects
    whole["buffers"][0]["uri"] = "absent.bin"
    with pytest.raises(InputError, match=r"model\.gltf.*absent\.bin.*missing"):
        load(tmp_path, json.dumps(whole).encode(), name="model.gltf")


@pytest.mark.parametrize(("mode", "faces"), [(4, 1), (5, 4), (6, 4)])
def test_triangles_strips_and_fans(tmp_path: Path, mode: int, faces: int) -> None:
    """A fan and a strip over the same flat hexagon or band have one orientation and no overlap."""
    made = Writer()
    if mode == 6:
        angles = np.arange(6) / 6 * 2 * np.pi
        points = np.stack([np.cos(angles), np.sin(angles), 0 * angles], axis=1)
        area = 6 * math.sqrt(3) / 4
    else:
        points = np.array([[i // 2, i % 2, 0] for i in (1, 0, 3, 2, 5, 4)])
        area = 2.0
    count = 3 if mode == 4 else 6
    position = made.accessor(points[:count].astype(np.float32))
    made.json |= {
        "meshes": [{"primitives": [{"attributes": {"POSITION": position}, "mode": mode}]}],
        "nodes": [{"mesh": 0}],
    }
    geometry = load(tmp_path, made).objects[0].geometry
    a, b, c = (geometry.positions[geometry.faces[:, i]] for i in range(3))
    across = np.cross(b - a, c - a)[:, 2] / 2
    assert len(across) == faces
    assert (across > 0).all()
    if mode != 4:
        assert across.sum() == pytest.approx(area, rel=1e-5)


def test_hierarchy_stays_and_instances_share_their_geometry(tmp_path: Path) -> None:
    made = square()
    half = math.sqrt(0.5)
    made.json["nodes"] = [
        {"name": "table", "translation": [1, 2, 3], "children": [1, 2, 4]},
        {"name": "left", "mesh": 0, "rotation": [0, 0, half, half], "scale": [2, 2, 2]},
        {"name": "right", "children": [3], "translation": [5, 0, 0]},
        {"name": "far", "mesh": 0},
        {"name": "empty", "children": []},
    ]
    model = load(tmp_path, made, 0.5)
    names = {node.name: node for node in model.nodes}
    assert set(names) == {"table", "left", "right", "far"}  # what holds no mesh is left out
    assert isinstance(model.nodes[0], Group)
    assert names["far"].parent == names["right"].id
    left, far = names["left"], names["far"]
    assert isinstance(left, MeshObject)
    assert isinstance(far, MeshObject)
    assert left.geometry is far.geometry
    turned = SQUARE[:, [1, 0, 2]] * [-1, 1, 1]
    np.testing.assert_allclose(world(model, left), 0.5 * (2 * turned + [1, 2, 3]), atol=1e-6)
    np.testing.assert_allclose(world(model, far), 0.5 * (SQUARE + np.array([6, 2, 3])), atol=1e-6)


def random_matrix(rng: np.random.Generator, mirrored: bool) -> np.ndarray:
    while True:
        made = np.eye(4)
        made[:3] = rng.normal(size=(3, 4))
        if abs(np.linalg.det(made)) > 0.2 and (np.linalg.det(made) < 0) == mirrored:
            return made


@pytest.mark.parametrize("mirrored", [False, True])
@pytest.mark.parametrize("seed", range(4))
def test_shear_and_mirroring_are_baked_down_the_hierarchy(tmp_path: Path, mirrored: bool, seed: int) -> None:
    rng = np.random.default_rng(seed)
    made = square()
    normal = made.accessor(np.tile(np.array([[0, 0, 1]], np.float32), (4, 1)))
    made.json["meshes"][0]["primitives"][0]["attributes"]["NORMAL"] = normal
    outer, inner = random_matrix(rng, mirrored), random_matrix(rng, False)
    made.json["nodes"] = [
        {"matrix": outer.T.ravel().tolist(), "children": [1, 2]},
        {"matrix": inner.T.ravel().tolist(), "mesh": 0},
        {"mesh": 0},
    ]
    model = load(tmp_path, made)
    homogeneous = np.concatenate([SQUARE, np.ones((4, 1))], axis=1)
    for node, matrix in zip(model.objects, (outer @ inner, outer), strict=True):
        expected = (homogeneous @ matrix.T)[:, :3]
        np.testing.assert_allclose(world(model, node), expected, atol=1e-5)
        a, b, c = (world(model, node)[node.geometry.faces[:, i]] for i in range(3))
        flat = np.cross(b - a, c - a)[0]
        flat /= np.linalg.norm(flat)
        outward = np.linalg.inv(matrix[:3, :3]).T @ [0, 0, 1]
        outward /= np.linalg.norm(outward)
        turn = Scene().with_nodes(*model.nodes).world(node.id).matrix()[:3, :3]
        assert node.geometry.normals is not None
        shown = node.geometry.normals[0] @ turn.T
        np.testing.assert_allclose(shown / np.linalg.norm(shown), outward, atol=1e-4)
        np.testing.assert_allclose(flat, outward, atol=1e-4)


def test_attributes_normalised_integers_sparse_values_and_uv_sets(tmp_path: Path) -> None:
    made = Writer()
    position = made.accessor(SQUARE)
    indices = made.view(np.array([3], np.uint8).tobytes())
    values = made.view(np.array([[0, 4, 0]], np.float32).tobytes())
    made.json["accessors"][position]["sparse"] = {
        "count": 1,
        "indices": {"bufferView": indices, "componentType": 5121},
        "values": {"bufferView": values},
    }
    unused = made.accessor(np.zeros((4, 2), np.float32))
    uv = made.accessor(np.array([[0, 0], [255, 0], [255, 255], [0, 51]], np.uint8), normalized=True)
    picture = made.view(encode_png(np.full((2, 2, 3), 128, np.uint8)))
    made.json |= {
        "meshes": [
            {
                "primitives": [
                    {
                        "attributes": {"POSITION": position, "TEXCOORD_0": unused, "TEXCOORD_1": uv},
                        "mode": 6,
                        "material": 0,
                    }
                ]
            }
        ],
        "nodes": [{"mesh": 0}],
        "images": [{"bufferView": picture, "mimeType": "image/png"}],
        "textures": [{"source": 0}],
        "materials": [
            {
                "pbrMetallicRoughness": {
                    "baseColorTexture": {
                        "index": 0,
                        "texCoord": 1,
                        "extensions": {"KHR_texture_transform": {"scale": [2, 4], "offset": [0.5, 0.25]}},
                    }
                }
            }
        ],
    }
    model = load(tmp_path, made)
    geometry = model.objects[0].geometry
    assert [0, 4, 0] in geometry.positions.tolist()
    assert geometry.uvs is not None
    corner = geometry.positions.tolist().index([0, 4, 0])
    np.testing.assert_allclose(geometry.uvs[corner], [0, 0.8], atol=1e-6)
    texture = model.materials[0].textures["base_color"]
    # the format's v runs down: (0, 0.2) ↦ (0.5, 0.25 + 4 · 0.2 = 1.05) from the top
    (placed,) = texture.placed(geometry.uvs[corner : corner + 1])
    np.testing.assert_allclose([placed[0], 1 - placed[1]], [0.5, 1.05], atol=1e-5)


def test_turned_pictures_lie_as_in_other_programs(tmp_path: Path) -> None:
    # the format's own example: the lower left quarter of the picture, turned clockwise by a quarter
    moved = {"offset": [0, 1], "rotation": np.pi / 2, "scale": [0.5, 0.5]}
    picture = square(material=0)
    image = picture.view(encode_png(np.full((2, 2, 3), 128, np.uint8)))
    reference = {"index": 0, "extensions": {"KHR_texture_transform": moved}}
    picture.json["images"] = [{"bufferView": image, "mimeType": "image/png"}]
    picture.json["textures"] = [{"source": 0}]
    picture.json["materials"] = [{"pbrMetallicRoughness": {"baseColorTexture": reference}}]
    texture = load(tmp_path, picture).materials[0].textures["base_color"]
    # the surface's corners, from its upper left clockwise, meet the quarter's from its lower left clockwise
    corners = np.array([[0, 1], [1, 1], [1, 0], [0, 0]], np.float32)
    wanted = [[0, 0], [0, 0.5], [0.5, 0.5], [0.5, 0]]
    np.testing.assert_allclose(texture.placed(corners), wanted, atol=1e-6)
    assert texture.rotation == pytest.approx(-90)
    moved |= {"scale": [2, 0.5], "rotation": 0.3, "offset": [0.25, 0.5]}
    texture = load(tmp_path, picture).materials[0].textures["base_color"]
    uv = np.random.default_rng(0).random((5, 2))
    scaled = uv * [2, 0.5]
    u = np.cos(0.3) * scaled[:, 0] + np.sin(0.3) * scaled[:, 1] + 0.25
    v = np.cos(0.3) * scaled[:, 1] - np.sin(0.3) * scaled[:, 0] + 0.5
    made = texture.placed(np.stack([uv[:, 0], 1 - uv[:, 1]], axis=1).astype(np.float32))
    np.testing.assert_allclose(made, np.stack([u, 1 - v], axis=1), atol=1e-6)


def with_material(folder: Path, **material: Any) -> tuple[Any, ImportedModel]:
    made = square(material=0)
    made.json["materials"] = [{"name": "m", **material}]
    model = load(folder, made)
    return model.materials[0], model


def test_materials_keep_their_exact_numbers(tmp_path: Path) -> None:
    made, _ = with_material(
        tmp_path,
        pbrMetallicRoughness={"baseColorFactor": [0.00123, 0.5, 0.9, 1], "metallicFactor": 0.25},
    )
    assert made.model == "ggx"
    assert made.values["base_color"] == pytest.approx((0.00123, 0.5, 0.9))
    assert (made.values["metallic"], made.values["roughness"]) == (0.25, 1.0)
    assert made.values["specular"] == pytest.approx(0.5)
    assert made.opacity == 1


def test_transparency(tmp_path: Path) -> None:
    pbr = {"baseColorFactor": [1, 1, 1, 0.3]}
    assert with_material(tmp_path, pbrMetallicRoughness=pbr)[0].opacity == 1
    assert with_material(tmp_path, pbrMetallicRoughness=pbr, alphaMode="BLEND")[0].opacity == 0.3
    assert with_material(tmp_path, pbrMetallicRoughness=pbr, alphaMode="MASK")[0].opacity == 0
    glass = {"KHR_materials_transmission": {"transmissionFactor": 0.9}}
    assert with_material(tmp_path, extensions=glass)[0].opacity == pytest.approx(0.1)
    diamond = {"KHR_materials_ior": {"ior": 2.4}}
    assert with_material(tmp_path, extensions=diamond)[0].values["specular"] == 1.0


def metal_and_roughness(tmp_path: Path, pixels: Any, pbr: dict[str, Any], colour: Any = None) -> Any:
    """A material with a metallic-roughness picture, and one of the colour."""
    made = square(material=0)
    pictures = [pixels] if colour is None else [pixels, colour]
    made.json |= {
        "images": [{"bufferView": made.view(p if isinstance(p, bytes) else encode_png(p))} for p in pictures],
        "textures": [{"source": n} for n in range(len(pictures))],
        "materials": [{"pbrMetallicRoughness": {"metallicRoughnessTexture": {"index": 0}, **pbr}}],
    }
    model = load(tmp_path, made)
    return model.materials[0], model.notes


def test_a_metallic_roughness_picture_is_one_of_each(tmp_path: Path) -> None:
    pixels = np.zeros((2, 2, 3), np.uint8)
    pixels[:, 0, 1], pixels[:, 1, 1], pixels[0, :, 2] = 51, 102, 255
    made, notes = metal_and_roughness(tmp_path, pixels, {"roughnessFactor": 0.5, "metallicFactor": 0.8})
    assert (made.values["roughness"], made.values["metallic"]) == (0.5, 0.8)
    for name, channel in (("roughness", 1), ("metallic", 2)):
        image = made.textures[name].image
        assert image.encoding == "data"
        np.testing.assert_array_equal(image.pixels[..., 0], pixels[..., channel])
    assert not any("mean" in note for note in notes)


@pytest.mark.parametrize("scale", [None, 0.5, -2.0])
def test_normal_maps_come_with_their_strength_and_place(tmp_path: Path, scale: float | None) -> None:
    pixels = np.random.default_rng(1).integers(0, 256, (3, 5, 4), dtype=np.uint8)
    made = square(material=0)
    moved = {"KHR_texture_transform": {"scale": [2.0, 2.0], "rotation": 0.5}}
    told = {"index": 0, "extensions": moved} | ({} if scale is None else {"scale": scale})
    made.json |= {
        "images": [{"bufferView": made.view(encode_png(pixels))}],
        "textures": [{"source": 0}],
        "materials": [{"normalTexture": told}],
    }
    model = load(tmp_path, made)
    found = model.materials[0]
    assert found.values["normal"] == (1.0 if scale is None else scale)
    assert found.textures["normal"].image.encoding == "data"
    np.testing.assert_array_equal(found.textures["normal"].image.pixels, pixels[..., :3])
    assert found.textures["normal"].rotation == pytest.approx(-np.degrees(0.5))
    assert not any("normal" in note for note in model.notes)


def test_sixteen_bits_of_metal_and_roughness_are_plain_numbers(tmp_path: Path) -> None:
    import cv2

    pixels = np.zeros((2, 2, 3), np.uint16)
    pixels[:, 0, 1], pixels[:, 1, 1] = 16384, 49152
    pixels[:, :, 2] = 13107
    found, encoded = cv2.imencode(".png", pixels[:, :, ::-1])
    assert found
    made, _ = metal_and_roughness(tmp_path, encoded.tobytes(), {})
    rough = made.textures["roughness"].image
    np.testing.assert_allclose(rough.pixels[..., 0], pixels[..., 1] / 65535, atol=1e-6)
    assert rough.encoding == "data"
    assert made.values["metallic"] == pytest.approx(0.2)


def test_a_channel_that_is_one_colour_is_a_number(tmp_path: Path) -> None:
    pixels = np.zeros((2, 2, 3), np.uint8)
    pixels[:, :, 1], pixels[:, :, 2] = 51, 255
    made, _ = metal_and_roughness(tmp_path, pixels, {})
    assert made.values["roughness"] == pytest.approx(0.2)
    assert made.values["metallic"] == 1
    assert made.textures == {}


def test_metal_that_lies_otherwise_than_colour_is_its_mean(tmp_path: Path) -> None:
    pixels = np.zeros((2, 2, 3), np.uint8)
    pixels[0] = 255
    moved = {"index": 1, "extensions": {"KHR_texture_transform": {"scale": [2, 2]}}}
    colour = np.full((2, 2, 3), 128, np.uint8)
    made, notes = metal_and_roughness(tmp_path, pixels, {"baseColorTexture": moved}, colour)
    assert set(made.textures) == {"base_color", "roughness"}
    assert made.textures["base_color"].scale == (2, 2)
    assert made.textures["roughness"].scale == (1, 1)
    assert made.values["metallic"] == pytest.approx(0.5)
    assert any("lies otherwise" in note for note in notes)
    other = {"index": 1, "texCoord": 1}
    made, notes = metal_and_roughness(tmp_path, pixels, {"baseColorTexture": other}, colour)
    assert set(made.textures) == {"base_color"}
    assert made.values["roughness"] == pytest.approx(0.5)
    assert any("mean" in note for note in notes)


def test_a_damaged_picture_is_a_note(tmp_path: Path) -> None:
    made = square(material=0)
    made.json |= {
        "images": [{"bufferView": made.view(b"\x89PNG\r\n\x1a\n no")}],
        "textures": [{"source": 0}],
        "materials": [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}],
    }
    model = load(tmp_path, made)
    assert model.materials[0].textures == {}
    assert any("image 0" in note for note in model.notes)


def test_primitives_of_one_material_share_a_slot(tmp_path: Path) -> None:
    made = square(material=0)
    position = made.accessor(TRIANGLE + np.float32(5))
    primitives = made.json["meshes"][0]["primitives"]
    primitives.append({"attributes": {"POSITION": position}, "material": 1})
    primitives.append({"attributes": {"POSITION": made.accessor(TRIANGLE + np.float32(9))}, "material": 0})
    made.json["materials"] = [{"name": "a"}, {"name": "b"}, {"name": "unused"}]
    model = load(tmp_path, made)
    (node,) = model.objects
    assert [m.name for m in model.materials] == ["a", "b"]
    assert len(node.materials) == 2
    assert node.geometry.slots is not None
    assert node.geometry.slots.tolist() == [0, 0, 1, 0]


def damaged() -> dict[str, dict[str, Any]]:
    """What is put over the JSON of a good file."""
    ok = {"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3"}
    indices = {"bufferView": 1, "componentType": 5123, "count": 6, "type": "SCALAR"}
    cycle: list[dict[str, Any]] = [{"children": [1]}, {"children": [0], "mesh": 0}]
    return {
        "version": {"asset": {"version": "1.0"}},
        "no asset": {"asset": 7},
        "a cycle": {"nodes": cycle},
        "itself": {"nodes": [{"children": [0], "mesh": 0}]},
        "two parents": {
            "nodes": [{"children": [2]}, {"children": [2]}, {"mesh": 0}],
            "scenes": [{"nodes": [0, 1]}],
        },
        "deep": {"nodes": [{"children": [i + 1]} for i in range(3000)] + [{"mesh": 0}]},
        "no node": {"scenes": [{"nodes": [9]}]},
        "no scene": {"scene": 3},
        "no mesh": {"nodes": [{"mesh": 4}]},
        "a true mesh": {"nodes": [{"mesh": True}]},
        "rotation 0": {"nodes": [{"mesh": 0, "rotation": [0, 0, 0, 0]}]},
        "huge": {"nodes": [{"mesh": 0, "scale": [1e300, 1, 1]}]},
        "collapsed": {"nodes": [{"mesh": 0, "scale": [0, 0, 0]}]},
        "a text": {"nodes": [{"mesh": 0, "translation": "far"}]},
        "long accessor": {"accessors": [{**ok, "count": 10**12}, indices]},
        "a bit long": {"accessors": [{**ok, "count": 5}, indices]},
        "negative": {"accessors": [{**ok, "count": -1}, indices]},
        "offset": {"accessors": [{**ok, "byteOffset": 10**9}, indices]},
        "no data": {"accessors": [{**ok, "bufferView": None}, indices]},
        "bomb": {"accessors": [{"componentType": 5126, "count": 10**11, "type": "VEC3"}, indices]},
        "type": {"accessors": [{**ok, "type": "VEC2"}, indices]},
        "component": {"accessors": [{**ok, "componentType": 1}, indices]},
        "float indices": {"accessors": [ok, {**indices, "componentType": 5126, "count": 3}]},
        "outside": {"accessors": [{**ok, "count": 3}, indices]},
        "view": {"bufferViews": [{"buffer": 0, "byteLength": 10**9}]},
        "buffer": {"bufferViews": [{"buffer": 7, "byteLength": 9}]},
        "no primitives": {"meshes": [{}]},
        "mode": {"meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "mode": 99}]}]},
        "lines": {"meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "mode": 1}]}]},
        "material": {"meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "material": 1}]}]},
        "draco": {"extensionsRequired": ["KHR_draco_mesh_compression"]},
        "lists": {"meshes": {}, "nodes": 3},
    }


@pytest.mark.parametrize("which", damaged())
def test_damaged_files_are_refused_in_one_sentence(tmp_path: Path, which: str) -> None:
    made = square()
    made.json |= damaged()[which]
    with pytest.raises(InputError, match=r"model\.glb cannot be imported") as caught:
        load(tmp_path, made)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    "data",
    [
        b"glTF",
        b"glTF" + bytes(40),
        b"[" * 100_000,
        b"null",
        b'{"asset": {"version": "2.0"}, "x": NaN}',
        b'{"asset": {"version": "2.0"}, "x": ' + b"9" * 5000 + b"}",
        "not even UTF-8 é".encode("utf-16"),
    ],
)
def test_what_is_no_gltf_is_refused(tmp_path: Path, data: bytes) -> None:
    with pytest.raises(InputError, match=r"model\.glb"):
        load(tmp_path, data)


def test_a_bad_optional_attribute_is_left_out_with_a_note(tmp_path: Path) -> None:
    made = square()
    short = made.accessor(np.zeros((2, 3), np.float32))
    made.json["meshes"][0]["primitives"][0]["attributes"] |= {"NORMAL": short, "TEXCOORD_0": 99}
    model = load(tmp_path, made)
    assert model.objects[0].geometry.normals is None
    assert model.objects[0].geometry.uvs is None
    told = " ".join(model.notes)
    assert "NORMAL" in told
    assert "TEXCOORD_0" in told


def test_meshes_that_no_node_places_are_taken_with_a_note(tmp_path: Path) -> None:
    made = square()
    for key in ("nodes", "scenes", "scene"):
        del made.json[key]
    model = load(tmp_path, made)
    assert len(model.objects) == 1
    assert any("origin" in note for note in model.notes)


def test_a_file_of_trimesh_comes_back(tmp_path: Path) -> None:
    import trimesh

    box = trimesh.creation.box((1, 2, 3))
    trimesh.Scene([box]).export(tmp_path / "box.glb")
    geometry = IMPORTER.load(tmp_path / "box.glb").objects[0].geometry
    np.testing.assert_allclose(geometry.bounds, box.bounds, atol=1e-6)
    assert len(geometry.faces) == 12


EXTENSIONS = {
    "KHR_materials_clearcoat": {"clearcoatFactor": 0.8, "clearcoatRoughnessFactor": 0.1},
    "KHR_materials_ior": {"ior": 1.33},
    "KHR_materials_specular": {"specularFactor": 0.5},
    "KHR_materials_anisotropy": {"anisotropyStrength": 0.6, "anisotropyRotation": math.pi / 2},
}
DIELECTRIC = {"metallicFactor": 0.0, "baseColorFactor": [0.5, 0.2, 0.1, 1.0]}


@pytest.mark.parametrize(
    ("extensions", "model", "values"),
    [
        (("KHR_materials_clearcoat",), "plastic", {"gloss": 0.8, "roughness": 0.1, "depth": 0.0}),
        (("KHR_materials_ior",), "ggx", {"specular": (0.33 / 2.33) ** 2 / 0.08}),
        (("KHR_materials_specular", "KHR_materials_ior"), "plastic", {"gloss": 0.5, "ior": 1.33}),
    ],
)
def test_layers_of_extensions(
    tmp_path: Path, extensions: tuple[str, ...], model: str, values: dict[str, float]
) -> None:
    chosen = {name: EXTENSIONS[name] for name in extensions}
    made, _ = with_material(tmp_path, pbrMetallicRoughness=DIELECTRIC, extensions=chosen)
    assert made.model == model
    for name, value in values.items():
        assert made.values[name] == pytest.approx(value)


def test_brushed_metal_has_its_grain_across_the_wide_direction(tmp_path: Path) -> None:
    chosen = {"KHR_materials_anisotropy": EXTENSIONS["KHR_materials_anisotropy"]}
    made, _ = with_material(tmp_path, pbrMetallicRoughness={"roughnessFactor": 0.3}, extensions=chosen)
    assert made.model == "ward"
    assert made.values["direction"] == pytest.approx(0.0, abs=1e-9)


def test_what_has_no_place_here_is_said(tmp_path: Path) -> None:
    others = {"KHR_materials_iridescence": {}, "KHR_materials_unlit": {}}
    _, model = with_material(tmp_path, extensions=others)
    told = " ".join(model.notes)
    assert "KHR_materials_iridescence" in told
    assert "without light" in told


@pytest.mark.parametrize("channels", [3, 4])
def test_pictures_of_extensions_use_their_own_channel(tmp_path: Path, channels: int) -> None:
    """The specular weight is in alpha: without one it is 1."""
    pixels = np.full((2, 2, channels), 64, np.uint8)
    made = square(material=0)
    told = {"specularFactor": 0.5, "specularTexture": {"index": 0}}
    made.json |= {
        "images": [{"bufferView": made.view(encode_png(pixels))}],
        "textures": [{"source": 0}],
        "materials": [{"pbrMetallicRoughness": DIELECTRIC, "extensions": {"KHR_materials_specular": told}}],
    }
    found = load(tmp_path, made).materials[0]
    assert found.values["gloss"] == pytest.approx(0.5 * (64 / 255 if channels == 4 else 1))


def test_a_file_of_materials_alone(tmp_path: Path) -> None:
    whole = {"asset": {"version": "2.0"}, "materials": [{"name": "oak"}, {"name": "brass"}]}
    model = load(tmp_path, json.dumps(whole).encode(), name="model.gltf")
    assert model.nodes == ()
    assert [material.name for material in model.materials] == ["oak", "brass"]
