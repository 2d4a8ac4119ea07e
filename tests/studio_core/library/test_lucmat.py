"""A material in a file of its own: nothing of it is lost, and other files are refused."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from studio_core.arrays import frozen_map
from studio_core.errors import ProjectError
from studio_core.library.lucmat import Kept, read, write
from studio_core.project.store import save
from studio_core.scene.geometry import Image, Texture
from studio_core.scene.nodes import Group, Material, Scene

RNG = np.random.default_rng(3)
OAK = Material(
    id="material-7",
    name="Oak, oiled",
    model="ggx",
    values=frozen_map({"roughness": 0.4, "base_color": (0.4, 0.25, 0.12)}),
    textures=frozen_map(
        {"base_color": Texture(Image(RNG.integers(0, 256, (96, 64, 3), dtype=np.uint8), "srgb"), (2.0, 3.0))}
    ),
    opacity=0.9,
)


def same(a: Material, b: Material) -> bool:
    pictures = {name: (t.image.key, t.scale, t.offset) for name, t in a.textures.items()}
    others = {name: (t.image.key, t.scale, t.offset) for name, t in b.textures.items()}
    bare, other = (dataclasses.replace(m, id="", textures=frozen_map()) for m in (a, b))
    return pictures == others and bare == other


def test_there_and_back(tmp_path: Path) -> None:
    path = tmp_path / "oak.lucmat"
    write(path, Kept(OAK, ("wood", "wood", " ", "floor"), "From the joiner."))
    found = read(path)
    assert same(found.material, OAK)
    assert found.tags == ("wood", "floor")
    assert found.about == "From the joiner."
    assert found.name == "Oak, oiled"


def test_writing_again_replaces_it_whole(tmp_path: Path) -> None:
    path = tmp_path / "a.lucmat"
    write(path, Kept(OAK))
    first = path.stat().st_size
    plain = Material(id="m", name="Plain")
    write(path, Kept(plain))
    assert same(read(path).material, plain)
    assert path.stat().st_size < first  # the old picture is gone


def test_a_project_is_no_material(tmp_path: Path) -> None:
    path = tmp_path / "room.lucmat"
    for scene in (
        Scene(),
        Scene().with_materials(OAK, dataclasses.replace(OAK, id="other")),
        Scene().with_materials(OAK).with_nodes(Group(id="g", name="G")),
    ):
        save(path, scene, fresh=True)
        with pytest.raises(ProjectError, match=r"room\.lucmat holds no single material"):
            read(path)


@settings(max_examples=30, deadline=None)
@given(at=st.floats(0, 1), with_=st.binary(min_size=1, max_size=40))
def test_damage_is_one_sentence(at: float, with_: bytes, tmp_path_factory: pytest.TempPathFactory) -> None:
    path = tmp_path_factory.mktemp("damaged") / "a.lucmat"
    write(path, Kept(OAK, ("wood",)))
    data = bytearray(path.read_bytes())
    start = int(at * (len(data) - 1))
    data[start : start + len(with_)] = with_
    path.write_bytes(bytes(data))
    try:
        found = read(path)
    except ProjectError as error:
        assert "a.lucmat" in str(error)
    else:
        assert isinstance(found.material, Material)


def test_what_is_not_there_is_said(tmp_path: Path) -> None:
    with pytest.raises(ProjectError, match=r"none\.lucmat"):
        read(tmp_path / "none.lucmat")
