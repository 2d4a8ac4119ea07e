"""Single materials through every kind of file."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from studio_core.errors import InputError
from studio_core.exchange.files import RADIUS, ball, kinds, materials_of, write_materials
from studio_core.library.lucmat import Kept
from studio_core.registry import PluginHost
from studio_core.scene.geometry import Image, Texture
from studio_core.scene.nodes import Material
from studio_plugins.brdfs import plugin as brdfs
from studio_plugins.export import plugin as export
from studio_plugins.materialx import plugin as materialx
from studio_plugins.meshes import plugin as meshes

HOST = PluginHost([brdfs, export, materialx, meshes])


def oak() -> Kept:
    pixels = np.random.default_rng(0).integers(0, 256, (4, 4, 3), np.uint8)
    material = Material(
        id="x", name="Oak: oiled", model="ggx", values={"roughness": 0.4},
        textures={"base_color": Texture(Image(pixels, "srgb"), (3.0, 3.0))},
    )  # fmt: skip
    return Kept(material, ("wood",), "From a friend")


@pytest.mark.parametrize("suffix", [".lucmat", ".glb", ".mtlx"])
def test_one_material_goes_out_and_comes_back(tmp_path: Path, suffix: str) -> None:
    if suffix == ".mtlx":
        pytest.importorskip("MaterialX", reason="the extra materialx is not installed")
    path, kept = tmp_path / f"oak{suffix}", oak()
    assert write_materials(path, [kept], HOST) == ()
    (found,), notes = materials_of(path, HOST)
    assert notes == ()
    assert found.name == "Oak: oiled"
    assert found.material.model == "ggx"
    assert found.material.values["roughness"] == pytest.approx(0.4)
    before, after = kept.material.textures["base_color"], found.material.textures["base_color"]
    np.testing.assert_array_equal(after.image.pixels, before.image.pixels)
    np.testing.assert_allclose(after.affine, before.affine, atol=1e-6)
    if suffix == ".lucmat":
        assert found.tags == ("wood",)


def test_several_go_on_balls(tmp_path: Path) -> None:
    second = Kept(Material(id="x", name="Chalk"))
    write_materials(tmp_path / "two.glb", [oak(), second], HOST)
    found, _ = materials_of(tmp_path / "two.glb", HOST)
    assert [one.name for one in found] == ["Oak: oiled", "Chalk"]
    model = HOST.get("importer", "gltf").load(tmp_path / "two.glb")
    assert [node.name for node in model.objects] == ["Oak: oiled", "Chalk"]
    with pytest.raises(InputError, match="one material, not 2"):
        write_materials(tmp_path / "two.lucmat", [oak(), second], HOST)


def test_a_ball_is_round_closed_and_outward() -> None:
    made = ball()
    assert made.normals is not None
    assert made.uvs is not None
    corners = made.positions[made.faces].astype(float)
    volume = np.einsum("ij,ij->", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])) / 6
    assert volume == pytest.approx(4 / 3 * np.pi * RADIUS**3, rel=0.01)
    flat = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert (np.linalg.norm(flat, axis=1) > 0).all()
    np.testing.assert_allclose(np.linalg.norm(made.normals, axis=1), 1, atol=1e-6)
    uv = made.uvs[made.faces].astype(float)
    a, b = uv[:, 1] - uv[:, 0], uv[:, 2] - uv[:, 0]
    assert ((a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]) > 0).all()  # pictures are not mirrored


def test_kinds_and_refusals(tmp_path: Path) -> None:
    known: Any = [ending for _, endings in kinds(HOST) for ending in endings]
    assert known == [".lucmat", ".glb", ".mtlx"]
    with pytest.raises(InputError, match=r"x\.fbx cannot be written: known kinds are \.lucmat, \.glb"):
        write_materials(tmp_path / "x.fbx", [oak()], HOST)
    with pytest.raises(InputError, match=r"x\.fbx cannot be imported"):
        materials_of(tmp_path / "x.fbx", HOST)
