"""The library's own files come into a scene as materials."""

from __future__ import annotations

from pathlib import Path

import pytest

from studio_core.errors import ProjectError
from studio_core.library.lucmat import Kept, alike, write
from studio_core.registry import PluginHost
from studio_core.scene.nodes import Material
from studio_plugins.brdfs import plugin
from studio_plugins.brdfs.material_file import MATERIAL


def test_a_file_becomes_a_new_material_each_time(tmp_path: Path) -> None:
    path = tmp_path / "oak.lucmat"
    oak = Material(id="m", name="Oak", model="plastic", values={"roughness": 0.5})
    write(path, Kept(oak, ("wood",)))
    (one,), (two,) = (MATERIAL.load(path).materials for _ in range(2))
    assert one.id != two.id
    assert alike(one, oak)
    assert not alike(one, Material(id=one.id, name="Oak", model="plastic"))
    assert PluginHost([plugin]).get("importer", "material") is MATERIAL


def test_what_is_no_material_is_said(tmp_path: Path) -> None:
    path = tmp_path / "oak.lucmat"
    path.write_bytes(b"oak")
    with pytest.raises(ProjectError, match=r"oak\.lucmat"):
        MATERIAL.load(path)
