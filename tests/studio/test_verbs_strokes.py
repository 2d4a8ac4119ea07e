"""`lucarne strokes`: paints, explains, saves, reports, and refuses."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from scenes import little_scene

from studio.cli import BAD_INPUT, main
from studio.verbs_strokes import _lines, report
from studio_core.document import Document
from studio_core.edits import Compound
from studio_core.project.lock import acquire
from studio_core.project.store import load, save
from studio_core.strokes.session import Painted
from studio_core.strokes.solution import Finding, Reason
from studio_core.strokes.stroke import Stroke

QUICK = ["--quiet", "--indirect", "none", "--param", "directions=1024", "--param", "vertices=600"]
ON_CUBE = {"path": [[0.48, 0.45], [0.52, 0.45]], "brush": {"size": 0.15}, "size": [96, 64]}


@pytest.fixture
def room(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    save(tmp_path / "room.lucarne", little_scene(cube_values={"base_color": (0.4, 0.4, 0.4)}))
    plan = {"strokes": [{**ON_CUBE, "name": "Redder", "colour": [0.5, 0.1, 0.1]}]}
    (tmp_path / "strokes.json").write_text(json.dumps(plan))
    return tmp_path


def test_it_paints_and_says_why(room: Path, capsys: pytest.CaptureFixture[str]) -> None:
    command = ["strokes", "room.lucarne", "strokes.json", "-o", "out.lucarne", "--report", "r.json", *QUICK]
    assert main(command) == 0
    said = capsys.readouterr()
    first, why = said.out.splitlines()
    assert first == "out.lucarne: 1 stroke"
    assert why.startswith("Cube, slot 0: colour, explains ")
    loaded = load(room / "out.lucarne")
    (stroke,) = loaded.scene.of(Stroke)
    assert (stroke.name, stroke.objects, stroke.flat) == ("Redder", ("cube",), True)
    assert loaded.scene["cube"].paint is not None
    assert loaded.scene["floor"].paint is None
    told = json.loads((room / "r.json").read_text())
    assert told["strokes"][0]["objects"] == ["Cube"]
    assert told["strokes"][0]["places"] == len(stroke.marks)
    reason = told["findings"][0]["reasons"][0]
    assert reason["meaning"] == "colour"
    red, green, blue = next(value for value in reason["values"].values() if isinstance(value, list))
    assert red > 2 * max(green, blue)
    assert np.isfinite(reason["score"])
    assert load(room / "room.lucarne").scene["cube"].paint is None


def test_what_could_change_instead_is_told_as_that() -> None:
    def found(node: str, stroke: str, rivals: bool = True) -> Finding:
        reason = Reason("colour", 0.8, 0.0, {}, Compound("", ()))
        return Finding(node, 0, (stroke,), (reason,), rivals=rivals)

    findings = (found("cube", "s"), found("floor", "s"), found("cube", "t"), found("floor", "u", False))
    told = report(Painted(little_scene(), (), (), findings, ()), little_scene())
    assert [one["instead"] for one in told["findings"]] == [False, True, False, False]
    lines = [line.split(",")[0] for line in _lines(told)]
    assert lines == ["Cube", "or Floor", "Cube", "Floor"]


def test_it_is_a_step_that_can_be_undone(room: Path) -> None:
    assert main(["strokes", "room.lucarne", "strokes.json", "-o", "out.lucarne", *QUICK]) == 0
    loaded = load(room / "out.lucarne")
    document = Document(loaded.scene)
    document.restore(*loaded.history.opened())
    assert document.history[document.position].label == "Redder"
    document.undo()
    assert not [*document.scene.of(Stroke)]
    assert document.scene["cube"].paint is None


def test_together_and_one_by_one(room: Path, capsys: pytest.CaptureFixture[str]) -> None:
    plan = [
        {**ON_CUBE, "tool": "brighten"},
        {**ON_CUBE, "tool": "darken"},
        {**ON_CUBE, "path": [[0.5, 0.01]]},
    ]
    (room / "three.json").write_text(json.dumps(plan))
    shown = []
    for more in ([], ["--one-by-one"]):
        command = ["strokes", "room.lucarne", "three.json", "-o", "out.lucarne", "--json", *QUICK, *more]
        assert main(command) == 0
        said = capsys.readouterr()
        told = json.loads(said.out)
        assert told["solver"] == "joint"
        assert len(told["strokes"]) == 2
        assert any("background" in note for note in told["notes"])
        assert "background" in said.err
        scene = load(room / "out.lucarne").scene
        first, second = scene.of(Stroke)
        assert second.together == (not more)
        shown.append(second.marks.shown.mean() / first.marks.shown.mean())
    assert shown[0] == pytest.approx(1)
    assert shown[1] > 1.1
    assert (room / "out.lucarne~").is_file(), "what was there is kept"


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({0: "none.lucarne"}, "none.lucarne"),
        ({1: "none.json"}, "none.json"),
        ({1: "room.lucarne"}, "no text"),
        ({1: "wrong.json"}, "stroke 1"),
        ({1: "attic.json"}, "Attic"),
        ({3: "out.txt"}, ".lucarne"),
        ({"--solver": "magic"}, "joint"),
        ({"--solver-param": "x"}, "KEY=VALUE"),
        ({"--solver-param": "x=1"}, "--solver-param"),
        ({"--report": "r.txt"}, ".json"),
        ({"--backend": "magic"}, "magic"),
    ],
)
def test_it_refuses_in_one_line(
    room: Path, change: dict[int | str, str], words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    (room / "wrong.json").write_text('[{"path": [[0, 0]], "tool": "spray"}]')
    (room / "attic.json").write_text('[{"path": [[0, 0]], "camera": "Attic"}]')
    arguments = ["room.lucarne", "strokes.json", "-o", "out.lucarne"]
    more = []
    for place, value in change.items():
        if isinstance(place, int):
            arguments[place] = value
        else:
            more += [place, value]
    assert main(["strokes", *arguments, *QUICK, *more]) == BAD_INPUT
    said = capsys.readouterr()
    assert said.out == ""
    assert len(said.err.splitlines()) == 1
    assert words in said.err
    assert not (room / "out.lucarne").exists()


def test_a_project_that_is_open_is_not_replaced(room: Path, capsys: pytest.CaptureFixture[str]) -> None:
    save(room / "out.lucarne", little_scene())
    before = (room / "out.lucarne").read_bytes()
    with acquire(room / "out.lucarne"):
        assert main(["strokes", "room.lucarne", "strokes.json", "-o", "out.lucarne", *QUICK]) == BAD_INPUT
    assert "open" in capsys.readouterr().err
    assert (room / "out.lucarne").read_bytes() == before


def test_a_scene_is_stylised_in_a_step_that_can_be_undone(
    room: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    command = ["stylise", "room.lucarne", "-o", "out.lucarne", "--amount", "-0.5", "--json", *QUICK]
    assert main(command) == 0
    told = json.loads(capsys.readouterr().out)
    assert (told["amount"], told["painted"]) == (-0.5, 2)
    assert told["counts"]["solved"] > 0
    loaded = load(room / "out.lucarne")
    document = Document(loaded.scene)
    document.restore(*loaded.history.opened())
    assert document.history[document.position].label == "Stylise"
    assert document.scene["cube"].paint is not None
    document.undo()
    assert document.scene["cube"].paint is None


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (["--amount", "9"], "amount"),
        (["--camera", "Attic"], "Attic"),
        (["--solver", "magic"], "joint"),
        (["-o", "out.txt"], ".lucarne"),
    ],
)
def test_stylise_refuses_in_one_line(
    room: Path, change: list[str], words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["stylise", "room.lucarne", "-o", "out.lucarne", *QUICK, *change]) == BAD_INPUT
    said = capsys.readouterr().err
    assert len(said.splitlines()) == 1
    assert words in said
    assert not (room / "out.lucarne").exists()
