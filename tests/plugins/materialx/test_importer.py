"""MaterialX in: shaders, graphs of nodes, pictures, and files that are no such thing."""

from __future__ import annotations

import builtins
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from studio_core.contract import ImportedModel
from studio_core.errors import InputError
from studio_core.exchange.placing import laid, moving, of, scaling, turning
from studio_core.imaging.encode import write_exr, write_png
from studio_core.scene.geometry import Image
from studio_plugins.materialx.importer import IMPORTER

pytest.importorskip("MaterialX", reason="the extra materialx is not installed")

HEAD = '<?xml version="1.0"?>\n<materialx version="1.39">\n'
USE = (
    '<surfacematerial name="m" type="material">'
    '<input name="surfaceshader" type="surfaceshader" nodename="s"/></surfacematerial>'
)


def load(folder: Path, body: str) -> ImportedModel:
    path = folder / "a.mtlx"
    path.write_text(f"{HEAD}{body}</materialx>")
    return IMPORTER.load(path)


def shader(kind: str, **inputs: str) -> str:
    """A shader with values, or with whole attributes where they have a `=`."""
    made = []
    for name, value in inputs.items():
        wide = {0: "float", 2: "color3"}.get(value.count(","), "float")
        attributes = value if "=" in value else f'type="{wide}" value="{value}"'
        made.append(f'<input name="{name}" {attributes}/>')
    return f'<{kind} name="s" type="surfaceshader">{"".join(made)}</{kind}>{USE}'


@pytest.mark.parametrize(
    ("kind", "inputs", "model", "values"),
    [
        (
            "standard_surface",
            {"base": "0.5", "base_color": "0.8, 0.4, 0.2", "specular_roughness": "0.3", "metalness": "0.25"},
            "ggx",
            {"base_color": (0.4, 0.2, 0.1), "roughness": 0.3, "metallic": 0.25, "specular": 0.5},
        ),
        ("standard_surface", {"specular": "0", "diffuse_roughness": "0.6"}, "oren-nayar", {"roughness": 0.6}),
        (
            "standard_surface",
            {"coat": "1", "coat_roughness": "0.2"},
            "plastic",
            {"roughness": 0.2, "gloss": 1},
        ),
        (
            "open_pbr_surface",
            {"base_metalness": "1", "base_color": "0.9, 0.6, 0.3", "specular_color": "0.5, 0.6, 0.7"},
            "ggx-conductor",
            {"base_color": (0.9, 0.6, 0.3), "edge_tint": (0.5, 0.6, 0.7), "roughness": 0.3},
        ),
        (
            "open_pbr_surface",
            {
                "fuzz_weight": "0.5",
                "fuzz_color": "0.8, 0.6, 0.4",
                "fuzz_roughness": "0.7",
                "specular_weight": "0",
            },
            "cloth",
            {"sheen": (0.4, 0.3, 0.2), "roughness": 0.7, "base_color": (0.8, 0.8, 0.8)},
        ),
        (
            "gltf_pbr",
            {"metallic": "0", "ior": "2.0", "specular": "0.7"},
            "plastic",
            {"ior": 2.0, "gloss": 0.7},
        ),
        (
            "UsdPreviewSurface",
            {"diffuseColor": "0.1, 0.2, 0.3", "roughness": "0.4"},
            "ggx",
            {"base_color": (0.1, 0.2, 0.3), "roughness": 0.4, "metallic": 0.0},
        ),
    ],
)
def test_shaders(tmp_path: Path, kind: str, inputs: Any, model: str, values: dict[str, Any]) -> None:
    (made,) = load(tmp_path, shader(kind, **inputs)).materials
    assert (made.name, made.model) == ("m", model)
    for name, value in values.items():
        np.testing.assert_allclose(made.values[name], value, atol=1e-6)


def picture(folder: Path) -> Any:
    pixels = np.random.default_rng(1).integers(0, 256, (4, 6, 3), np.uint8)
    write_png(folder / "wood.png", pixels)
    return pixels


def test_pictures_with_factors_and_colour_spaces(tmp_path: Path) -> None:
    pixels = picture(tmp_path)
    image = (
        '<image name="i" type="color3"><input name="file" type="filename" value="wood.png"'
        ' colorspace="{}"/></image><multiply name="t" type="color3"><input name="in1" type="color3"'
        ' nodename="i"/><input name="in2" type="float" value="0.5"/></multiply>'
    )
    used = shader("standard_surface", base="1", base_color='type="color3" nodename="t"')
    (made,) = load(tmp_path, image.format("srgb_texture") + used).materials
    found = made.textures["base_color"].image
    np.testing.assert_array_equal(found.pixels, pixels)
    assert (found.encoding, made.values["base_color"]) == ("srgb", (0.5, 0.5, 0.5))
    (made,) = load(tmp_path, image.format("lin_rec709") + used).materials
    found = made.textures["base_color"].image
    np.testing.assert_allclose(found.pixels, pixels / 255, atol=1e-6)
    assert found.encoding == "linear"
    model = load(tmp_path, image.format("acescg") + used)
    assert any("acescg" in note for note in model.notes)


def test_graphs_channels_and_interfaces_are_followed(tmp_path: Path) -> None:
    pixels = picture(tmp_path)
    graph = (
        '<nodegraph name="g"><input name="which" type="filename" value="wood.png"/>'
        '<tiledimage name="i" type="color3"><input name="file" type="filename" interfacename="which"/>'
        '<input name="uvtiling" type="vector2" value="2, 3"/>'
        '<input name="uvoffset" type="vector2" value="0.5, 0"/></tiledimage>'
        '<separate3 name="e" type="multioutput"><input name="in" type="color3" nodename="i"/></separate3>'
        '<normalmap name="n" type="vector3"><input name="in" type="vector3" nodename="i"/>'
        '<input name="scale" type="float" value="0.4"/></normalmap>'
        '<output name="rough" type="float" nodename="e" output="outg"/>'
        '<output name="bumps" type="vector3" nodename="n"/></nodegraph>'
    )
    used = shader(
        "standard_surface",
        specular_roughness='type="float" nodegraph="g" output="rough"',
        normal='type="vector3" nodegraph="g" output="bumps"',
    )
    (made,) = load(tmp_path, graph + used).materials
    rough = made.textures["roughness"]
    np.testing.assert_array_equal(rough.image.pixels[..., 0], pixels[..., 1])
    assert rough.image.encoding == "data"
    np.testing.assert_allclose(rough.affine, (2, 0, -0.5, 0, 3, 0))
    assert made.values["normal"] == pytest.approx(0.4)
    np.testing.assert_array_equal(made.textures["normal"].image.pixels, pixels)


def test_channels_as_older_files_name_them(tmp_path: Path) -> None:
    pixels = picture(tmp_path)
    graph = (
        '<nodegraph name="g"><image name="i" type="vector3">'
        '<input name="file" type="filename" value="wood.png"/></image>'
        '<output name="orm" type="vector3" nodename="i"/></nodegraph>'
    )
    reached = 'type="float" nodegraph="g" output="orm" channels="{}"'
    used = shader("gltf_pbr", metallic=reached.format("z"), roughness=reached.format("y"))
    path = tmp_path / "old.mtlx"
    path.write_text(f"{HEAD}{graph}{used}</materialx>".replace("1.39", "1.38"))
    (made,) = IMPORTER.load(path).materials
    for name, channel in (("metallic", 2), ("roughness", 1)):
        np.testing.assert_array_equal(made.textures[name].image.pixels[..., 0], pixels[..., channel])


def test_placing_by_other_programs(tmp_path: Path) -> None:
    """glTF's pivot is the picture's upper left corner; place2d divides, and turns it counter-clockwise."""
    picture(tmp_path)
    place = '<{} name="p" type="vector2"><input name="texcoord" type="vector2" nodename="u"/>{}</{}>'
    uv = '<texcoord name="u" type="vector2"/>'
    scale = '<input name="scale" type="vector2" value="0.5, 0.25"/>'
    image = '<image name="i" type="color3"><input name="file" type="filename" value="wood.png"/>{}</image>'
    at = '<input name="texcoord" type="vector2" nodename="p"/>'
    used = shader("gltf_pbr", base_color='type="color3" nodename="i"')
    (made,) = load(
        tmp_path, uv + place.format("place2d", scale, "place2d") + image.format(at) + used
    ).materials
    np.testing.assert_allclose(made.textures["base_color"].affine, (2, 0, 0, 0, 4, 0), atol=1e-12)
    gltf = image.format('<input name="scale" type="vector2" value="2, 4"/>').replace(
        "image ", "gltf_image ", 1
    )
    gltf = gltf.replace("</image>", "</gltf_image>")
    (made,) = load(tmp_path, gltf + used).materials
    np.testing.assert_allclose(made.textures["base_color"].affine, (2, 0, 0, 0, 4, -3), atol=1e-12)


@settings(max_examples=60)
@given(
    angle=st.floats(-89, 89),
    size=st.tuples(st.floats(0.1, 9), st.floats(0.1, 9)),
    aspect=st.floats(0.2, 5),
    shift=st.tuples(st.floats(-3, 3), st.floats(-3, 3)),
)
def test_any_turned_picture_is_found_again(angle: float, size: Any, aspect: float, shift: Any) -> None:
    affine = moving(*shift) @ scaling(*size) @ turning(angle) @ scaling(1, aspect)
    made, exact = laid(Image(np.zeros((1, 1, 3), np.float32)), affine)
    assert exact
    np.testing.assert_allclose(of(made), affine, atol=1e-5)


def test_what_is_sheared_or_computed_is_said(tmp_path: Path) -> None:
    sheared = np.array([[1, 0.5, 0], [0.5, 1, 0], [0, 0, 1.0]])
    assert not laid(Image(np.zeros((1, 1, 3), np.float32)), sheared)[1]
    noise = '<noise3d name="i" type="color3"/>'
    used = shader(
        "standard_surface", base_color='type="color3" nodename="i"', emission="2", thin_film_thickness="300"
    )
    model = load(tmp_path, noise + used)
    told = " ".join(model.notes)
    for word in ("noise3d", "light that it gives", "thin film"):
        assert word in told
    lost = shader("standard_surface", base_color='type="color3" nodegraph="none" output="a"')
    assert any("missing" in note for note in load(tmp_path, lost).notes)
    model = load(
        tmp_path,
        shader("gltf_pbr", base_color='type="color3" nodename="i"') + noise.replace("noise3d", "image"),
    )
    assert model.materials[0].textures == {}


def test_numbers_have_no_colour_space_and_a_coat_colours_what_is_below(tmp_path: Path) -> None:
    pixels = picture(tmp_path)
    graph = (
        '<nodegraph name="g" colorspace="srgb_texture"><image name="c" type="color3">'
        '<input name="file" type="filename" value="wood.png"/></image><image name="r" type="float">'
        '<input name="file" type="filename" value="wood.png"/></image>'
        '<output name="hue" type="color3" nodename="c"/>'
        '<output name="dull" type="float" nodename="r"/></nodegraph>'
    )
    used = shader(
        "standard_surface",
        base="1",
        metalness="1",
        specular_roughness='type="float" nodegraph="g" output="dull"',
        coat="1",
        coat_color='type="color3" nodegraph="g" output="hue"',
    )
    (made,) = load(tmp_path, graph + used).materials
    assert made.model == "ggx"
    assert made.values["base_color"] == pytest.approx((0.8, 0.8, 0.8))
    np.testing.assert_array_equal(made.textures["base_color"].image.pixels, pixels)
    np.testing.assert_array_equal(made.textures["roughness"].image.pixels[..., 0], pixels[..., 0])
    assert made.textures["roughness"].image.encoding == "data"
    dull = shader("open_pbr_surface", coat_weight="0.5", coat_color="0.2, 0.6, 1")
    (made,) = load(tmp_path, dull).materials
    np.testing.assert_allclose(made.values["base_color"], (0.48, 0.64, 0.8), atol=1e-6)


def test_circles_end(tmp_path: Path) -> None:
    turn = "".join(
        f'<multiply name="{a}" type="color3"><input name="in1" type="color3" nodename="{b}"/></multiply>'
        for a, b in (("i", "j"), ("j", "i"))
    )
    model = load(tmp_path, turn + shader("gltf_pbr", base_color='type="color3" nodename="i"'))
    assert model.materials[0].values["base_color"] == (1.0, 1.0, 1.0)


def test_long_chains_end_and_doubling_ones_are_followed_once(tmp_path: Path) -> None:
    def chain(links: int, second: str) -> str:
        made = ['<constant name="n0" type="float"><input name="value" type="float" value="1"/></constant>']
        for n in range(links):
            inputs = f'<input name="in1" type="float" nodename="n{n}"/>' + second.format(n)
            made.append(f'<multiply name="n{n + 1}" type="float">{inputs}</multiply>')
        return "".join(made)

    doubling = chain(25, '<input name="in2" type="float" nodename="n{}"/>')
    model = load(tmp_path, doubling + shader("standard_surface", metalness='type="float" nodename="n25"'))
    assert model.materials[0].values["metallic"] == 1.0
    long = chain(500, "")
    model = load(tmp_path, long + shader("standard_surface", metalness='type="float" nodename="n500"'))
    assert any("too deep" in note for note in model.notes)


def test_old_files_are_brought_up_to_date(tmp_path: Path) -> None:
    path = tmp_path / "old.mtlx"
    path.write_text(
        '<materialx version="1.36"><material name="gold"><shaderref name="r" node="standard_surface">'
        '<bindinput name="base_color" type="color3" value="0.9, 0.7, 0.2"/>'
        '<bindinput name="metalness" type="float" value="1"/></shaderref></material></materialx>'
    )
    (made,) = IMPORTER.load(path).materials
    assert (made.name, made.model, made.values["metallic"]) == ("gold", "ggx", 1.0)


@pytest.mark.parametrize(
    ("text", "cause"),
    [
        ("", "no MaterialX"),
        ("<html/>", "no MaterialX"),
        ("<materialx", "no MaterialX"),
        ("<materialx version='1.38'>" + "<a>" * 9000, "no MaterialX"),
        ("<materialx version='1.38'/>", "no material"),
        (f"{HEAD}<lama_surface name='s' type='surfaceshader'/>{USE}</materialx>", "not known here"),
    ],
)
def test_refusals_name_file_and_cause(tmp_path: Path, text: str, cause: str) -> None:
    (tmp_path / "bad.mtlx").write_text(text)
    with pytest.raises(InputError, match=rf"bad\.mtlx.*{cause}") as caught:
        IMPORTER.load(tmp_path / "bad.mtlx")
    assert "\n" not in str(caught.value)


def test_includes_are_not_followed(tmp_path: Path) -> None:
    (tmp_path / "other.mtlx").write_text(f"{HEAD}{shader('gltf_pbr')}</materialx>")
    include = '<xi:include xmlns:xi="http://www.w3.org/2001/XInclude" href="other.mtlx"/>'
    model = load(tmp_path, include + shader("gltf_pbr").replace('"m"', '"own"'))
    assert [material.name for material in model.materials] == ["own"]
    assert any("includes" in note for note in model.notes)


def test_pictures_are_taken_from_beside_the_file_alone(tmp_path: Path) -> None:
    far = tmp_path / "far"
    (tmp_path / "a" / "b").mkdir(parents=True)
    far.mkdir()
    write_exr(far / "x.exr", np.ones((2, 2, 3), np.float32))
    image = (
        '<image name="i" type="color3"><input name="file" type="filename" value="../../far/x.exr"/></image>'
    )
    model = load(tmp_path / "a" / "b", image + shader("gltf_pbr", base_color='type="color3" nodename="i"'))
    assert model.materials[0].textures == {}
    assert any("missing" in note for note in model.notes)


SEED = HEAD + (
    '<nodegraph name="g"><image name="i" type="color3">'
    '<input name="file" type="filename" value="no.png"/></image>'
    '<output name="o" type="color3" nodename="i"/></nodegraph>'
    + shader("standard_surface", base_color='type="color3" nodegraph="g" output="o"', metalness="0.5")
    + "</materialx>"
)


@settings(max_examples=150, suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
@given(data=st.data())
def test_damaged_files_give_materials_or_an_input_error(tmp_path: Path, data: st.DataObject) -> None:
    made = bytearray(SEED.encode())
    for place, value in data.draw(
        st.lists(st.tuples(st.integers(0, len(made) - 1), st.integers(0, 255)), max_size=6)
    ):
        made[place] = value
    start, stop = sorted(data.draw(st.tuples(st.integers(0, len(made)), st.integers(0, len(made)))))
    how = data.draw(st.sampled_from(["keep", "keep", "cut", "twice"]))
    whole = bytes(
        made[:start] + made[stop:] if how == "cut" else made[:stop] + made[start:] if how == "twice" else made
    )
    (tmp_path / "a.mtlx").write_bytes(whole)
    try:
        model = IMPORTER.load(tmp_path / "a.mtlx")
    except InputError as error:
        assert "a.mtlx" in str(error)
        return
    assert model.materials


def test_without_the_library_it_says_how_to_get_it(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    real = builtins.__import__

    def refuse(name: str, *rest: Any, **named: Any) -> Any:
        if name == "MaterialX":
            raise ImportError(name)
        return real(name, *rest, **named)

    monkeypatch.setattr(builtins, "__import__", refuse)
    with pytest.raises(InputError, match=r"pip install lucarne\[materialx\]"):
        IMPORTER.load(tmp_path / "a.mtlx")
