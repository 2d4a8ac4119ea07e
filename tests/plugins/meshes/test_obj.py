"""Wavefront OBJ and MTL: what the format allows and what files do to it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from studio_core.contract import ImportedModel
from studio_core.errors import InputError
from studio_core.imaging.encode import encode_png
from studio_core.scene.nodes import Group, Material
from studio_plugins.meshes.obj import IMPORTER

SQUARE = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n"


def load(folder: Path, text: str | bytes, mtl: str | None = None, unit: float = 1.0) -> ImportedModel:
    path = folder / "model.obj"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    if mtl is not None:
        (folder / "model.mtl").write_text(mtl)
    return IMPORTER.load(path, unit)


def material(folder: Path, mtl: str) -> tuple[Material, ImportedModel]:
    text = f"mtllib model.mtl\n{SQUARE}usemtl m\nf 1 2 3 4\n"
    model = load(folder, text, f"newmtl m\n{mtl}")
    return model.materials[0], model


def test_a_square_is_one_object_in_metres(tmp_path: Path) -> None:
    model = load(tmp_path, SQUARE + "f 1 2 3 4\n", unit=0.01)
    (node,) = model.nodes
    assert node.name == "model"
    geometry = model.objects[0].geometry
    assert geometry.faces.tolist() == [[0, 1, 2], [0, 2, 3]]
    np.testing.assert_allclose(geometry.bounds, [[0, 0, 0], [0.01, 0.01, 0]])
    assert geometry.normals is None
    assert geometry.uvs is None
    assert model.notes == ()


def test_corners_with_two_uvs_are_two_positions_and_v_is_up(tmp_path: Path) -> None:
    text = SQUARE + "vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nvt 0.5 0.5\nf 1/1 2/2 3/3\nf 1/5 3/3 4/4\n"
    geometry = load(tmp_path, text).objects[0].geometry
    assert geometry.uvs is not None
    got = {
        (tuple(p), tuple(t)) for p, t in zip(geometry.positions.tolist(), geometry.uvs.tolist(), strict=True)
    }
    assert ((0.0, 0.0, 0.0), (0.0, 0.0)) in got
    assert ((0.0, 0.0, 0.0), (0.5, 0.5)) in got
    assert ((0.0, 1.0, 0.0), (0.0, 1.0)) in got
    assert len(got) == 5


def test_normals_are_kept_and_made_unit(tmp_path: Path) -> None:
    geometry = load(tmp_path, SQUARE + "vn 0 0 5\nvn 0 3 4\nf 1//1 2//1 3//2\n").objects[0].geometry
    assert geometry.normals is not None
    np.testing.assert_allclose(geometry.normals, [[0, 0, 1], [0, 0, 1], [0, 0.6, 0.8]], atol=1e-6)


@pytest.mark.parametrize(
    "text",
    [
        SQUARE + "f -4 -3 -2 -1\n",
        SQUARE.replace("\n", "\r\n") + "f 1 2 3 4",
        SQUARE.replace("\n", "\r") + "f 1 2 3 4\r",
        "\ufeff# comment\n" + SQUARE + "f 1 \\\n2 3 \\\n 4\n",
        "f 1 2 3 4\n" + SQUARE,
        SQUARE + "\tf  1/7 2//9   3/1/1 4 # not one of them exists\n",
        SQUARE.replace("v 1 1 0", "v 1.0e0 .1e+01 -0 1.0") + "f 1 2 3 4\n",
        SQUARE + "s off\nl 1 2\np 1\nunknown words here\nf 1 2 3 4\nf 1 2\nf 1 2 99\nf a b c\nf 0 1 2\n",
    ],
)
def test_one_square_in_many_writings(tmp_path: Path, text: str) -> None:
    geometry = load(tmp_path, text).objects[0].geometry
    assert geometry.faces.tolist() == [[0, 1, 2], [0, 2, 3]]
    np.testing.assert_array_equal(geometry.positions[2], [1, 1, 0])


def test_relative_corners_count_from_where_they_stand(tmp_path: Path) -> None:
    text = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf -3 -2 -1\nv 0 0 5\nv 1 0 5\nv 0 1 5\nf -3 -2 -1\n"
    geometry = load(tmp_path, text).objects[0].geometry
    assert len(geometry.positions) == 6
    assert geometry.positions[geometry.faces[1]][:, 2].tolist() == [5, 5, 5]


def test_a_concave_polygon_keeps_its_area(tmp_path: Path) -> None:
    arrow = "v 0 0 0\nv 2 2 0\nv 0 1 0\nv -2 2 0\n"  # a quad with a notch
    for order in ("1 2 3 4", "2 3 4 1", "3 4 1 2", "4 1 2 3"):
        geometry = load(tmp_path, arrow + f"f {order}\n").objects[0].geometry
        a, b, c = (geometry.positions[geometry.faces[:, i]] for i in range(3))
        across = np.cross(b - a, c - a)[:, 2] / 2
        np.testing.assert_allclose(across, [1, 1])


def test_objects_are_parts_of_a_group_and_share_materials(tmp_path: Path) -> None:
    text = (
        f"mtllib model.mtl\n{SQUARE}usemtl red\no Left leg\nf 1 2 3\nusemtl blue\nf 1 3 4\n"
        "o Right leg\nf 2 3 4\nusemtl red\nf 1 2 4\no Empty\n"
    )
    model = load(tmp_path, text, "newmtl red\nKd 1 0 0\nnewmtl blue\nKd 0 0 1\nnewmtl unused\nKd 0 1 0\n")
    group, *parts = model.nodes
    assert isinstance(group, Group)
    assert [node.name for node in parts] == ["Left leg", "Right leg"]
    assert all(node.parent == group.id for node in parts)
    names = {m.id: m.name for m in model.materials}
    assert sorted(names.values()) == ["blue", "red"]
    for part, order in zip(model.objects, (["red", "blue"], ["blue", "red"]), strict=True):
        slots = part.geometry.slots
        assert slots is not None
        assert [names[part.materials[slot]] for slot in slots] == order


def test_groups_count_only_without_objects(tmp_path: Path) -> None:
    groups = SQUARE + "g seat\nf 1 2 3\ng back\nf 1 3 4\n"
    assert [node.name for node in load(tmp_path, groups).objects] == ["seat", "back"]
    assert len(load(tmp_path, "o chair\n" + groups).objects) == 1


def test_materials_become_the_model_that_fits(tmp_path: Path) -> None:
    matte, _ = material(tmp_path, "Kd 0.2 0.4 0.6\nKs 0 0 0\nillum 2\n")
    assert (matte.model, dict(matte.values)) == ("lambert", {"base_color": (0.2, 0.4, 0.6)})
    dull, _ = material(tmp_path, "Kd 0.2 0.4 0.6\nKs 1 1 1\nillum 1\n")
    assert dull.model == "lambert"
    shiny, _ = material(tmp_path, "kd 0.2 0.4 0.6\nKs 0.5 0.5 0.5\nNs 96\nillum 2\n")
    assert shiny.model == "blinn-phong"
    assert shiny.values["exponent"] == 96
    assert shiny.values["diffuse"] == (0.2, 0.4, 0.6)
    assert shiny.values["specular"] == pytest.approx((0.5, 0.5, 0.4))
    metal, _ = material(tmp_path, "Kd 0.9 0.8 0.1\nPm 1.0\nPr 0.25\nKs 1 1 1\n")
    assert metal.model == "ggx"
    assert dict(metal.values) == {
        "base_color": (0.9, 0.8, 0.1),
        "metallic": 1.0,
        "roughness": 0.25,
        "specular": 0.5,
    }


def test_pictures_of_roughness_and_metal(tmp_path: Path) -> None:
    rough = np.array([[[10], [200]]], np.uint8)
    (tmp_path / "rough.png").write_bytes(encode_png(rough))
    (tmp_path / "metal.png").write_bytes(encode_png(np.full((1, 2, 1), 255, np.uint8)))
    made, _ = material(tmp_path, "Kd 1 1 1\nPr 0.1\nmap_Pr -s 2 2 rough.png\nmap_Pm metal.png\n")
    assert made.model == "ggx"
    assert (made.values["roughness"], made.values["metallic"]) == (1.0, 1.0)
    assert set(made.textures) == {"roughness"}
    np.testing.assert_array_equal(made.textures["roughness"].image.pixels[..., :1], rough)
    assert made.textures["roughness"].image.encoding == "data"
    assert made.textures["roughness"].scale == (2.0, 2.0)


@pytest.mark.parametrize(
    ("statements", "opacity"),
    [("d 0.3", 0.3), ("Tr 0.3", 0.7), ("Tr 0.9\nd 0.4", 0.4), ("d 7", 1.0), ("", 1.0), ("d oops", 1.0)],
)
def test_opacity(tmp_path: Path, statements: str, opacity: float) -> None:
    made, _ = material(tmp_path, f"Kd 1 1 1\n{statements}\n")
    assert made.opacity == pytest.approx(opacity)


def test_textures_with_options_blanks_and_any_case(tmp_path: Path) -> None:
    red = np.zeros((4, 4, 4), np.uint8)
    red[:, :, 0] = red[:, :, 3] = 200
    (tmp_path / "Dark Oak.png").write_bytes(encode_png(red))
    made, model = material(tmp_path, "Ks 0 0 0\nmap_Kd -s 2 3 1 -o 0.5 -clamp on -mm 0 1 dark oak.PNG\n")
    texture = made.textures["base_color"]
    assert texture.scale == (2, 3)
    assert texture.offset == (0.5, 0)
    assert texture.image.pixels.shape == (4, 4, 3)
    assert texture.image.encoding == "srgb"
    assert made.values["base_color"] == (1, 1, 1)
    assert any("clamp" in note for note in model.notes)


def test_the_same_picture_is_read_once(tmp_path: Path) -> None:
    (tmp_path / "a.png").write_bytes(encode_png(np.full((2, 2, 3), 9, np.uint8)))
    mtl = "newmtl m\nmap_Kd a.png\nnewmtl n\nKs .1 .1 .1\nmap_Kd ./A.png\n"
    text = f"mtllib model.mtl\n{SQUARE}usemtl m\nf 1 2 3\nusemtl n\nf 1 3 4\n"
    model = load(tmp_path, text, mtl)
    first, second = model.materials
    assert first.textures["base_color"].image is second.textures["diffuse"].image


def test_what_is_missing_or_unused_is_told(tmp_path: Path) -> None:
    made, model = material(tmp_path, "Kd 1 1 1\nKe 3 3 3\nmap_Kd no such.png\ndisp deep.png\n")
    assert made.textures == {}
    told = " ".join(model.notes)
    assert "'no such.png' is missing" in told
    assert "displacement map" in told
    assert "shines by itself" in told
    (tmp_path / "model.mtl").unlink()
    text = f"mtllib model.mtl\n{SQUARE}usemtl m\nf 1 2 3 4\nv 1 1 1 1 0 0\n"
    model = load(tmp_path, text)
    assert any("'model.mtl' is missing" in note for note in model.notes)
    assert any("Colours of vertices" in note for note in model.notes)


def test_material_files_with_blanks_and_several_in_a_line(tmp_path: Path) -> None:
    (tmp_path / "my colours.mtl").write_text("newmtl a b \n  Kd 1 0 0\n")
    (tmp_path / "second.mtl").write_text("newmtl c\nKd 0 1 0\n")
    body = f"{SQUARE}usemtl a b\nf 1 2 3\nusemtl c\nf 1 3 4\n"
    for line in ("mtllib my colours.mtl\nmtllib second.mtl", "mtllib my\\ colours.mtl second.mtl"):
        model = load(tmp_path, f"{line}\n{body}")
        assert [m.values["base_color"] for m in model.materials] == [(1, 0, 0), (0, 1, 0)]
        assert model.notes == ()


def test_names_of_other_alphabets(tmp_path: Path) -> None:
    model = load(tmp_path, f"{SQUARE}o Stuhl größe\nf 1 2 3\no b\nf 1 3 4\n".encode("latin-1"))
    assert model.objects[0].name == "Stuhl größe"
    model = load(tmp_path, f"{SQUARE}o 椅子\nf 1 2 3\no b\nf 1 3 4\n")
    assert model.objects[0].name == "椅子"


@pytest.mark.parametrize(
    "text",
    [
        "",
        "# nothing\n",
        SQUARE,
        SQUARE + "l 1 2\np 3\n",
        SQUARE + "f 1 2 77\n",
        SQUARE + "f 1 1 1\n",
        "v nan 0 0\nv inf 1 1\nv 0 0 1e999\nf 1 2 3\n",
        "v\nv 1\nv 1 2\nf 1 2 3\n",
        "f 1 2 3\n",
        "v one two three\n" * 3 + "f 1 2 3\n",
        "f " + "9" * 5000 + " 1 2\n",
    ],
)
def test_what_has_no_triangle_is_refused_in_one_sentence(tmp_path: Path, text: str) -> None:
    with pytest.raises(InputError, match=r"model\.obj cannot be imported") as caught:
        load(tmp_path, text)
    assert "\n" not in str(caught.value)


def test_a_missing_file_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no such file"):
        IMPORTER.load(tmp_path / "none.obj")
    with pytest.raises(InputError):
        IMPORTER.load(Path("a\0b.obj"))


@pytest.mark.parametrize(("statement", "strength"), [("norm n.png", 1.0), ("map_Bump -bm 0.4 n.png", 0.4)])
def test_coloured_bumps_are_normal_maps(tmp_path: Path, statement: str, strength: float) -> None:
    pixels = np.random.default_rng(1).integers(0, 256, (4, 5, 3), dtype=np.uint8)
    (tmp_path / "n.png").write_bytes(encode_png(pixels))
    made, model = material(tmp_path, f"Kd 1 1 1\n{statement}\n")
    assert made.values["normal"] == strength
    assert made.textures["normal"].image.encoding == "data"
    np.testing.assert_array_equal(made.textures["normal"].image.pixels, pixels)
    assert not any("bump" in note or "normal" in note for note in model.notes)


def test_grey_bumps_are_heights(tmp_path: Path) -> None:
    """A ramp that rises along u, and one that rises along v, which is up: normals lean back from both."""
    ramp = np.repeat(np.arange(0, 250, 25, dtype=np.uint8)[None, :, None], 10, axis=0)
    for name, pixels in (("along.png", ramp), ("up.png", ramp.transpose(1, 0, 2)[::-1])):
        (tmp_path / name).write_bytes(encode_png(np.ascontiguousarray(pixels.repeat(3, axis=2))))
        made, _ = material(tmp_path, f"Kd 1 1 1\nbump -bm 2 -s 3 3 1 {name}\n")
        found = made.textures["normal"].image.pixels[5, 5].astype(float) / 127.5 - 1
        slope = 25 / 255 * 0.01 * 10
        wanted = [-slope, 0] if name == "along.png" else [0, -slope]
        np.testing.assert_allclose(found[:2] / found[2], wanted, atol=0.008)
        assert made.values["normal"] == 2
        assert made.textures["normal"].scale == (3.0, 3.0)
