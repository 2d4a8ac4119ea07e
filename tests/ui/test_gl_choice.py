"""Which canvas is shown, and what is said when it is not the GPU's; no OpenGL is needed here."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from PySide6.QtGui import QGuiApplication
from pytestqt.qtbot import QtBot
from ui_support import Driver, Make, room

from studio_ui.canvas import gl_report
from studio_ui.canvas.choice import CanvasChoice
from studio_ui.canvas.gl_report import GlReport, ask, parse
from studio_ui.canvas.raster_viewport import RasterViewport
from studio_ui.canvas.switch_viewport import SwitchViewport
from studio_ui.settings import Settings

CARD = GlReport(True, "NVIDIA RTX A2000", "4.6.0")
LLVMPIPE = GlReport(True, "llvmpipe (LLVM 15.0.6, 256 bits)", "4.5")
NONE = GlReport(False, reason="Qt cannot make an OpenGL context")
SENTENCE = "The canvas is drawn without the graphics card: "


class Chooser:
    """A choice whose GPU canvas is a second software canvas; children answer what they are told."""

    def __init__(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, bot: QtBot) -> None:
        self.said: list[str] = []
        self.tried = 0
        self.bot, self._patch = bot, monkeypatch
        self.settings = Settings(tmp_path)
        self.viewport = SwitchViewport(RasterViewport())
        bot.addWidget(self.viewport)
        monkeypatch.delenv("LUCARNE_CANVAS", raising=False)
        monkeypatch.setattr(QGuiApplication, "platformName", staticmethod(lambda: "xcb"))
        self.choice = CanvasChoice(self.viewport, self.settings, lambda text, level: self.said.append(text))
        monkeypatch.setattr(self.choice, "_try", self._count)

    def _count(self) -> None:
        self.tried += 1

    def answer(self, source: str) -> None:
        """What the child does instead of looking."""
        self._patch.setattr(gl_report, "command", lambda: ([sys.executable, "-c", source], {}))

    def reports(self, report: GlReport) -> None:
        self.answer(f"print({json.dumps(vars(report))!r})")

    def settle(self) -> None:
        self.bot.waitUntil(lambda: self.choice._process is None, timeout=60_000)


@pytest.fixture
def chooser(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, qtbot: QtBot) -> Chooser:
    return Chooser(tmp_path, monkeypatch, qtbot)


@pytest.mark.parametrize(
    ("preference", "report", "tried", "said"),
    [
        ("auto", CARD, 1, False),
        ("auto", LLVMPIPE, 0, False),
        ("auto", NONE, 0, True),
        ("gpu", LLVMPIPE, 1, False),
        ("gpu", NONE, 0, True),
        ("software", CARD, 0, False),
    ],
)
def test_the_canvas_follows_preference_and_driver(
    preference: str, report: GlReport, tried: int, said: bool, chooser: Chooser
) -> None:
    chooser.reports(report)
    chooser.settings.set("canvas", preference)
    chooser.choice.start()
    chooser.settle()
    assert chooser.tried == tried
    assert chooser.said == ([f"{SENTENCE}{report.reason}."] if said else [])


def test_the_environment_comes_before_the_preference(
    chooser: Chooser, monkeypatch: pytest.MonkeyPatch
) -> None:
    chooser.settings.set("canvas", "gpu")
    monkeypatch.setenv("LUCARNE_CANVAS", "software")
    assert chooser.choice.preference == "software"
    monkeypatch.setenv("LUCARNE_CANVAS", "nonsense")
    assert chooser.choice.preference == "auto"


def test_a_driver_that_ends_the_program_ends_a_child(chooser: Chooser) -> None:
    chooser.answer("import os; os.abort()")
    chooser.choice.start()
    chooser.settle()
    assert chooser.said == [f"{SENTENCE}OpenGL ends the program here."]
    assert chooser.tried == 0


def test_a_canvas_that_ended_the_program_is_not_tried_again(chooser: Chooser) -> None:
    chooser.settings.set("canvas_trying", True)
    chooser.reports(CARD)
    chooser.choice.start()
    chooser.settle()
    assert chooser.tried == 0
    assert len(chooser.said) == 1
    chooser.choice.prefer("gpu")  # asked for, it is
    chooser.settle()
    assert chooser.tried == 1


@pytest.mark.parametrize(
    ("report", "preference", "asked"),
    [(CARD, "auto", False), (LLVMPIPE, "auto", True), (LLVMPIPE, "gpu", False)],
)
def test_what_has_drawn_is_used_at_once(
    report: GlReport, preference: str, asked: bool, chooser: Chooser
) -> None:
    chooser.settings.set("canvas", preference)
    chooser.choice._drawn(report.renderer)
    chooser.reports(report)
    chooser.choice.start()
    assert (chooser.choice._process is not None) == asked
    assert chooser.tried == (not asked)
    chooser.settle()


def test_closing_does_not_wait_for_an_answer(chooser: Chooser) -> None:
    chooser.answer("import time; time.sleep(60)")
    chooser.choice.start()
    assert chooser.choice._process is not None
    chooser.choice.close()
    assert chooser.choice._process is None
    assert chooser.said == []


def test_without_a_screen_nothing_is_asked(
    tmp_path: Path, qtbot: QtBot, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("LUCARNE_CANVAS", raising=False)
    viewport = SwitchViewport(RasterViewport())
    qtbot.addWidget(viewport)
    said: list[str] = []
    made = CanvasChoice(viewport, Settings(tmp_path), lambda text, level: said.append(text))
    made.start()
    assert made._process is None
    assert said == []
    made.prefer("gpu")
    assert said == [f"{SENTENCE}Qt's offscreen platform has no OpenGL."]


def test_a_canvas_without_a_context_gives_way(make: Make, monkeypatch: pytest.MonkeyPatch) -> None:
    """Qt's offscreen platform makes no context, and says so only on the console."""
    pytest.importorskip("vispy")
    driver = make()
    driver.show(room())
    before = driver.viewport.grab_image()
    driver.window.canvas._try()
    assert driver.window.canvas.shown == "gpu"
    driver.until(lambda: driver.window.canvas.shown == "software")
    assert driver.viewport.grab_image() == before
    said = [entry.text for entry in driver.context.journal.entries if entry.level == "warning"]
    assert said == [f"{SENTENCE}Qt cannot make an OpenGL context."]


def test_another_canvas_is_told_everything(driver: Driver, qtbot: QtBot) -> None:
    driver.session.select(["chair"])
    driver.window.appearance.set_grid(True)
    driver.session.display(exposure=1.0, tonemap="raw")
    before = driver.viewport.grab_image()
    heard: list[object] = []
    driver.window.viewport.pointer.connect(heard.append)
    old = driver.viewport
    driver.window.viewport.use(RasterViewport())
    qtbot.waitUntil(lambda: driver.viewport.size() == old.size(), timeout=30_000)
    assert driver.viewport is not old
    assert driver.viewport.grab_image() == before
    driver.click((0.0, 3.0, 0.0))
    assert driver.session.selection == ()
    assert heard
    count = len(heard)
    old.pointer.emit(heard[0])
    assert len(heard) == count, "the canvas that has gone is not heard"


@pytest.mark.parametrize("id", ["auto", "gpu", "software"])
def test_the_menu_remembers_what_is_preferred(id: str, make: Make, tmp_path: Path) -> None:
    driver = make(state=tmp_path / "one")
    driver.do(f"view.canvas_{id}")
    assert driver.window.actions_[f"view.canvas_{id}"].isChecked()
    driver.close()
    again = make(state=tmp_path / "one")
    assert again.window.canvas.preference == id
    assert again.window.actions_[f"view.canvas_{id}"].isChecked()


def test_a_report_offscreen_says_why(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("QT_QPA_PLATFORM", "offscreen")
    found = ask()
    assert not found.usable
    assert not found.hardware
    assert "offscreen" in found.reason


@given(status=st.integers(-15, 255), output=st.text(), complaints=st.text())
def test_whatever_a_child_writes_is_a_report(status: int, output: str, complaints: str) -> None:
    found = parse(status, output, complaints)
    assert not found.usable
    assert found.reason.strip()
