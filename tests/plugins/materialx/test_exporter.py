"""MaterialX out: valid by the library's own definitions, and what was written is read again."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from studio_core.errors import InputError
from studio_core.library.presets import PRESETS
from studio_core.registry import PluginHost
from studio_core.scene.geometry import Image, Texture
from studio_core.scene.nodes import Material, Scene
from studio_core.shading.materials import linear
from studio_plugins.brdfs import plugin as brdfs
from studio_plugins.materialx.exporter import EXPORTER
from studio_plugins.materialx.importer import IMPORTER

mx: Any = pytest.importorskip("MaterialX", reason="the extra materialx is not installed")
HOST = PluginHost([brdfs])


def round_trip(folder: Path, *materials: Material) -> tuple[tuple[Material, ...], tuple[str, ...]]:
    notes = EXPORTER.save(Scene().with_materials(*materials), folder / "out.mtlx", HOST)
    return IMPORTER.load(folder / "out.mtlx").materials, notes


def picture(seed: int, channels: int = 3, bits: bool = False) -> Texture:
    pixels = np.random.default_rng(seed).random((3, 5, channels), np.float32)
    if bits:
        return Texture(Image(np.rint(pixels * 255).astype(np.uint8), "srgb" if channels == 3 else "data"))
    return Texture(Image(pixels, "linear" if channels == 3 else "data"))


def test_presets_are_valid_and_come_back(tmp_path: Path) -> None:
    textured = Material(
        id="t", name="Tür & Tor", model="ggx", values={"base_color": (0.5, 0.6, 0.7), "normal": 0.5},
        textures={"base_color": picture(0), "roughness": picture(1, 1, True), "normal": picture(2)},
    )  # fmt: skip
    given_ = [*(kept.material for kept in PRESETS), textured]
    found, notes = round_trip(tmp_path, *given_)
    assert [material.name for material in found] == [material.name for material in given_]
    document, known = mx.createDocument(), mx.createDocument()
    mx.readFromXmlFile(document, str(tmp_path / "out.mtlx"))
    mx.loadLibraries(mx.getDefaultDataLibraryFolders(), mx.getDefaultDataSearchPath(), known)
    document.setDataLibrary(known)
    assert document.validate() == (True, "")
    assert not any("Plaster" in note for note in notes)  # OpenPBR has its very formula
    assert any("Brass" in note for note in notes)
    assert found[-1].values["normal"] == pytest.approx(0.5)


@settings(max_examples=6, suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
@given(
    base=st.tuples(*[st.floats(0, 1)] * 3),
    share=st.floats(0.01, 1),
    rough=st.floats(0.07, 1),
    turn=st.floats(-89, 89),
    aspect=st.sampled_from([1.0, 0.5, 3.0]),
)
def test_values_and_places_come_back(
    tmp_path: Path, base: Any, share: float, rough: float, turn: float, aspect: float
) -> None:
    lying: Any = {"scale": (2.0, 3.0), "offset": (0.25, 0.5), "rotation": turn, "aspect": aspect}
    made = [
        Material(id="a", name="a", model="oren-nayar", values={"base_color": base, "roughness": rough}),
        Material(
            id="b", name="b", model="ggx", values={"metallic": share, "roughness": rough},
            textures={"base_color": replace(picture(3, 3, True), **lying)},
        ),
        Material(
            id="c", name="c", model="cloth",
            values={"base_color": base, "sheen": (share, share / 2, 0.0), "roughness": rough},
        ),
        Material(
            id="d", name="d", model="ggx-conductor",
            values={"edge_tint": (share, 0.4, 0.5), "roughness": rough},
            textures={"base_color": replace(picture(4), **lying)},
        ),
    ]  # fmt: skip
    found, _ = round_trip(tmp_path, *made)
    for before, after in zip(made, found, strict=True):
        if before.model == "cloth" and share < 0.05:
            continue
        assert after.model == before.model
        for name, value in before.values.items():
            np.testing.assert_allclose(after.values[name], value, atol=1e-6)
        for name, texture in before.textures.items():
            np.testing.assert_allclose(after.textures[name].affine, texture.affine, atol=1e-5)
            np.testing.assert_allclose(linear(after.textures[name].image), linear(texture.image), atol=1e-6)


def test_a_grain_comes_back(tmp_path: Path) -> None:
    values = {"diffuse": (0.0,) * 3, "specular": (0.9, 0.8, 0.7), "roughness": 0.4, "direction": 35.0}
    (made,), notes = round_trip(tmp_path, Material(id="a", name="tap", model="ward", values=values))
    assert made.model == "ward"
    assert made.values["direction"] == pytest.approx(35.0)
    np.testing.assert_allclose(made.values["specular"], values["specular"], atol=1e-6)
    assert any("% off" in note for note in notes)


def test_a_place_that_cannot_be_written_is_named(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="nowhere"):
        EXPORTER.save(Scene().with_materials(Material(id="a")), tmp_path / "nowhere" / "x.mtlx", HOST)
    with pytest.raises(InputError, match="nowhere"):
        textured = Material(id="a", textures={"base_color": picture(0)})
        EXPORTER.save(Scene().with_materials(textured), tmp_path / "nowhere" / "x.mtlx", HOST)
