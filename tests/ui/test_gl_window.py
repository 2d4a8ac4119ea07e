"""The window with the GPU's canvas, on a display of its own (Xvfb, Mesa's software renderer)."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from gl_support import ROOT, python

pytestmark = pytest.mark.gl
Play = Callable[..., dict[str, Any]]


@pytest.fixture(scope="module")
def display() -> Iterator[str]:
    """A screen that nobody sees."""
    program = shutil.which("Xvfb")
    if program is None:
        pytest.skip("there is no Xvfb here")
    read, write = os.pipe()
    arguments = [program, "-displayfd", str(write), "-screen", "0", "2000x1300x24", "-nolisten", "tcp"]
    server = subprocess.Popen(
        arguments, pass_fds=(write,), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    )
    os.close(write)
    try:
        with os.fdopen(read) as answer:
            number = answer.readline().strip()
        if not number:
            pytest.skip("Xvfb does not start here")
        yield f":{number}"
    finally:
        server.terminate()
        server.wait()


@pytest.fixture
def play(display: str, tmp_path: Path) -> Play:
    """Run a scenario of `gl_window.py`; what it saw."""
    surroundings = {"DISPLAY": display, "QT_QPA_PLATFORM": "xcb", "LUCARNE_CANVAS": ""}
    # a software renderer's pictures lie in memory: what is freed of them shall be seen to be free
    surroundings["MALLOC_MMAP_THRESHOLD_"] = "1000000"
    tried = python("-m", "studio_ui.canvas.gl_report", **surroundings)
    report = json.loads((tried.stdout.splitlines() or ["{}"])[-1])
    if not report.get("usable"):
        pytest.skip(f"no OpenGL under Xvfb here: {report.get('reason') or tried.stderr[-300:]}")

    def run(scenario: str, **more: str) -> dict[str, Any]:
        script = str(ROOT / "tests" / "ui" / "gl_window.py")
        done = python("-W", "error", script, scenario, str(tmp_path), **surroundings, **more)
        assert done.returncode == 0, f"{done.stdout}\n{done.stderr}"
        found, closed = done.stdout.splitlines()[-2:]
        assert closed == "closed"
        made: dict[str, Any] = json.loads(found)
        return made

    return run


def grown(values: list[int]) -> float:
    """How much larger the last third is than the first, in bytes a cycle."""
    third = len(values) // 3
    return (min(values[-third:]) - min(values[:third])) / (len(values) - third)


@pytest.mark.parametrize("scale", ["1", "1.5"])
def test_canvases_change_while_the_program_runs(scale: str, play: Play) -> None:
    found = play("switching", QT_SCALE_FACTOR=scale)
    assert found["ratio"] == float(scale)
    assert found["std"] > 10
    assert found["agree"] >= 0.99, "grid, outline, badge and lines over it included"
    assert found["on_screen"] >= 0.99, "what was grabbed is what the display shows"
    assert found["back"]
    assert found["remembered"], "the next start needs not ask"
    assert found["log"] == []


def test_the_hand_on_the_graphics_canvas(play: Play) -> None:
    found = play("hand")
    assert found["chosen"] == ["cube"]
    opened, moved = found["labels"]
    assert (opened, moved.rpartition(" ")[0][:10]) == ("Open", "Move Cube ")
    assert found["moved_shapes"] == 0, "a moved object is another matrix"
    assert found["same_picture"]
    assert found["turned"] < 0.9, "another view is drawn before there is a picture of it"
    assert found["ahead"] == "cube", "and what lies under the mouse is found in it"
    assert found["moved"] < 0.97, "what moves is drawn where it is before there is a picture of it"
    assert found["left"] != "cube"
    assert found["back"] == 1.0
    assert found["log"] == []


def test_docks_that_come_and_go_cost_nothing(play: Play) -> None:
    found = play("docks")
    assert len(found["objects"]) >= 20
    assert len(set(found["objects"])) == 1
    assert grown(found["memory"]) < 50_000
    assert (found["shown"], found["log"]) == ("gpu", [])


@pytest.mark.slow
def test_canvases_that_come_and_go_cost_nothing(play: Play) -> None:
    found = play("windows")
    assert len(found["memory"]) >= 20
    assert found["most"] > 3
    assert set(found["left"]) == {0}, "every OpenGL object is given back"
    assert grown(found["memory"]) < 2_000_000, "one canvas holds ten times as much"
    assert found["threads"][-1] <= found["threads"][0]
    assert found["log"] == []


def test_a_lost_context_and_a_driver_that_fails(play: Play) -> None:
    found = play("lost")
    assert found["again"] == 1.0
    assert found["fell_back"] >= 0.99
    assert found["log"] == ["The canvas is drawn without the graphics card: out of memory."]
    assert (found["trying"], found["remembered"]) == (False, "")
