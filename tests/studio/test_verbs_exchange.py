"""`lucarne materials`: lists, converts, keeps and refuses."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from studio.cli import BAD_INPUT, main
from studio_core.library.lucmat import Kept, read, write
from studio_core.scene.nodes import Material


@pytest.fixture
def oak(tmp_path: Path) -> Path:
    material = Material(id="x", name="Oak", model="ggx", values={"base_color": (0.5, 0.3, 0.2)})
    write(tmp_path / "oak.lucmat", Kept(material, ("wood",)))
    return tmp_path / "oak.lucmat"


def test_it_lists(oak: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["materials", str(oak)]) == 0
    assert capsys.readouterr().out == "Oak  ggx:base_color=0.5/0.3/0.2\n"
    assert main(["materials", str(oak), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["materials"][0]["values"] == {"base_color": [0.5, 0.3, 0.2]}
    assert found["written"] == []


def test_it_writes_other_kinds_and_reads_them(oak: Path, capsys: pytest.CaptureFixture[str]) -> None:
    glb, again = oak.with_suffix(".glb"), oak.with_name("again.lucmat")
    assert main(["materials", str(oak), "-o", str(glb)]) == 0
    assert main(["materials", str(glb), "--only", "Oak", "-o", str(again)]) == 0
    assert read(again).material.values["base_color"] == pytest.approx((0.5, 0.3, 0.2))
    folder = oak.with_name("all")
    folder.mkdir()
    assert main(["materials", str(glb), "-o", str(folder)]) == 0
    assert [path.name for path in folder.iterdir()] == ["Oak.lucmat"]
    assert capsys.readouterr().out.splitlines() == [str(glb), str(again), str(folder / "Oak.lucmat")]


def test_it_keeps_for_all_projects(oak: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("LUCARNE_MATERIALS", str(tmp_path / "mine"))
    assert main(["materials", str(oak), "--keep"]) == 0
    assert read(tmp_path / "mine" / "Oak.lucmat").tags == ("wood",)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["none.lucmat"], "none.lucmat"),
        (["oak.lucmat", "--only", "Elm"], "Oak"),
        (["oak.lucmat", "-o", "x.fbx"], ".glb"),
        (["x.fbx"], "x.fbx"),
    ],
)
def test_it_refuses_in_one_line(
    oak: Path,
    arguments: list[str],
    words: str,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(oak.parent)
    assert main(["materials", *arguments]) == BAD_INPUT
    said = capsys.readouterr()
    assert said.out == ""
    assert len(said.err.splitlines()) == 1
    assert words in said.err
