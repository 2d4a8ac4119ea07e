"""Plugins that misbehave in every way: the program lives, the document is what it was, the plugin is named.

A plugin that ends the process itself (`os._exit`, a crash in C) is beyond what one process can contain.
"""

from __future__ import annotations

import importlib
import sys
import threading
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
from PySide6.QtWidgets import QPushButton
from pytestqt.qtbot import QtBot
from ui_support import Answers, Driver, Fake, Make, room

from studio.app import _hook, assemble, staying
from studio_core.contract import API, Plugin
from studio_core.registry import PluginHost
from studio_core.shading.job import Job
from studio_core.shading.pipeline import Pipeline
from studio_core.shading.scheduler import ComputeThread
from studio_core.shading.soundness import UnsoundError
from studio_plugins.brdfs import plugin as brdfs
from studio_plugins.meshes import plugin as meshes
from studio_ui.feed import Freshness
from studio_ui.plugins.watch import DEFAULT, PATIENCE
from studio_ui.settings import Settings

Install = Callable[[str], None]

PANEL = """
from PySide6.QtCore import QTimer
from PySide6.QtWidgets import QPushButton, QVBoxLayout, QWidget
import sys

class Maker:
    title = "Bad"
    def make(self, context):
        return Bad()

class Bad(QWidget):
    def __init__(self):
        super().__init__()
        self.button = QPushButton("x")
        column = QVBoxLayout(self)
        column.addWidget(self.button)
        self.button.clicked.connect(self.clicked)
    def clicked(self):
        pass
{code}
MAKER = Maker()
"""


@pytest.fixture
def install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Install]:
    """Write the module `stranger_bad`."""

    def write(source: str) -> None:
        (tmp_path / "stranger_bad.py").write_text(source)
        importlib.invalidate_caches()

    monkeypatch.syspath_prepend(str(tmp_path))
    yield write
    sys.modules.pop("stranger_bad", None)


@pytest.fixture
def hooked(monkeypatch: pytest.MonkeyPatch) -> Callable[[Driver], None]:
    """Exceptions in slots and events go where they go in the program."""

    def hook(driver: Driver) -> None:
        monkeypatch.setattr(sys, "__excepthook__", lambda *given: None)
        monkeypatch.setattr(sys, "excepthook", _hook(driver.context.journal))

    return hook


def bad(kind: str) -> Plugin:
    thing = {"panel": "MAKER", "importer": "IMPORTER", "backend": "BACKEND"}[kind]
    return Plugin("bad", API, {kind: {"bad": f"stranger_bad:{thing}"}}, "Bad plugin")


def unharmed(driver: Driver) -> None:
    """The window still does what it is told."""
    before = driver.document.position
    driver.session.select(["stool"])
    driver.do("object.right")
    assert driver.document.position == before + 1
    driver.do("edit.undo")
    driver.settle()


def named(driver: Driver, what: str) -> None:
    """In the log, in the dialog's list and in the menu."""
    assert any("ad plugin" in text or "plugin bad" in text or "bad" in text for text in driver.problems())
    (entry,) = (entry for entry in driver.context.host.listed() if entry.state == "failed")
    assert entry.plugin is None or entry.plugin.id == "bad"
    assert any(what in failure.what for failure in entry.failures), entry.failures
    driver.until(lambda: driver.window.actions_["help.plugins"].text() == "Plugins (1 failed)")


# ---------------------------------------------------------------- panels


@pytest.mark.parametrize(
    ("source", "what"),
    [
        ("import a_library_that_nobody_has", "No module named"),
        ("import sys; sys.exit(3)", "SystemExit"),
        ("MAKER = 3", "lacks title, make"),
        (PANEL.format(code="") + "\nMaker.make = lambda self, context: 1 / 0", "division by zero"),
        (
            PANEL.format(code="") + "\nMaker.make = lambda self, context: 'no widget'",
            "is a str, not a widget",
        ),
        (PANEL.format(code="") + "\nMaker.make = lambda self, context: sys.exit(2)", "SystemExit"),
    ],
)
def test_a_panel_that_cannot_be_made(make: Make, install: Install, source: str, what: str) -> None:
    install(source)
    driver = make(plugins=(brdfs, meshes, bad("panel")))
    driver.show(room())
    scene = driver.document.scene
    driver.window.docks["plugin-bad"].show()
    assert driver.window.panels["plugin-bad"].widget is None
    assert driver.document.scene is scene
    named(driver, what)
    unharmed(driver)


@pytest.mark.parametrize(
    ("code", "what"),
    [
        ("    def clicked(self): raise ValueError('in a slot')", "in a slot"),
        ("    def clicked(self): sys.exit(1)", "tried to leave the program"),
        ("    def clicked(self): 1 / 0", "division by zero"),
        ("    def paintEvent(self, event): raise ValueError('while painting')", "while painting"),
        ("    def paintEvent(self, event): sys.exit(1)", "tried to leave the program"),
        ("    def resizeEvent(self, event): raise ValueError('while sizing')", "while sizing"),
    ],
)
@pytest.mark.qt_no_exception_capture
def test_a_panel_that_fails_while_it_is_used(
    make: Make, install: Install, hooked: Callable[[Driver], None], code: str, what: str
) -> None:
    install(PANEL.format(code=code))
    driver = make(plugins=(brdfs, meshes, bad("panel")))
    hooked(driver)
    driver.show(room())
    scene = driver.document.scene
    with staying():
        driver.window.docks["plugin-bad"].show()
        widget = driver.window.panels["plugin-bad"].widget
        assert widget is not None
        button = widget.findChild(QPushButton)
        for _ in range(3):
            button.click()
            widget.update()
            driver.bot.wait(20)
        driver.until(lambda: bool(driver.context.host.failures))
    assert driver.document.scene is scene
    named(driver, what)
    assert len(driver.context.host.failures) == 1  # however often it happens
    driver.window.docks["plugin-bad"].hide()
    unharmed(driver)


@pytest.mark.qt_no_exception_capture
def test_a_receiver_of_a_plugin_that_fails_keeps_nobody_from_hearing(
    make: Make, install: Install, hooked: Callable[[Driver], None]
) -> None:
    code = "    def changed(self, *given): raise ValueError('while told')"
    source = PANEL.format(code=code).replace(
        "        return Bad()",
        "        made = Bad(); context.document.changed.connect(made.changed); return made",
    )
    install(source)
    driver = make(plugins=(brdfs, meshes, bad("panel")))
    hooked(driver)
    driver.show(room())
    driver.window.docks["plugin-bad"].show()
    driver.session.select(["stool"])
    driver.do("edit.delete")
    assert "stool" not in driver.document.scene.nodes
    driver.do("edit.undo")
    assert "stool" in driver.document.scene.nodes
    driver.settle()
    assert driver.feed.last is not None
    assert "stool" in driver.feed.last.picture.nodes


# ---------------------------------------------------------------- importers


@pytest.mark.parametrize(
    ("body", "what"),
    [
        ("raise ZeroDivisionError('oh')", "ZeroDivisionError: oh"),
        ("import sys; sys.exit(1)", "SystemExit"),
        ("return None", "which is no model"),
        ("return [1, 2, 3]", "which is no model"),
    ],
)
def test_an_importer_that_gives_nonsense(
    make: Make, install: Install, body: str, what: str, tmp_path: Path
) -> None:
    source = "class Odd:\n    label = 'Odd'\n    extensions = ('.odd',)\n"
    install(f"{source}    def load(self, path, unit=1.0):\n        {body}\nIMPORTER = Odd()\n")
    driver = make(plugins=(brdfs, meshes, bad("importer")))
    driver.show(room())
    scene = driver.document.scene
    file = tmp_path / "chair.odd"
    file.write_text("a chair")
    driver.window.importing.take([file])
    driver.idle()
    assert driver.document.scene is scene
    assert any("chair.odd" in text and "plugin bad" in text for text in driver.problems())
    named(driver, what)
    unharmed(driver)


# ---------------------------------------------------------------- backends


@dataclass(frozen=True)
class Params:
    """A backend without parameters."""


class Backend(Fake):
    """A backend whose one stage does what a test says; the default one is sound."""

    id = "bad"
    label = "Bad light"
    Params = Params

    def __init__(self) -> None:
        super().__init__()
        self.sound = Fake()
        self.stuck: threading.Event | None = None
        self.entered = threading.Event()

    def stages(self, services: Any) -> list[Any]:
        return [self]

    def pipeline(self, backend: str) -> Pipeline:
        return Pipeline([self if backend == "bad" else self.sound])

    def run(self, frame: Any, inputs: Any, job: Any) -> Any:
        if self.stuck is not None:
            self.entered.set()
            self.stuck.wait()
        return super().run(frame, inputs, job)


class Seat:
    """A window whose backends are a sound one and a bad one."""

    def __init__(self, bot: QtBot, tmp_path: Path) -> None:
        self.backend = Backend()
        for name in ("stranger_bad", "stranger_sound"):
            module = sys.modules[name] = type(sys)(name)
            module.BACKEND = self.backend  # type: ignore[attr-defined]
        sound = Plugin("sound", API, {"backend": {DEFAULT: "stranger_sound:BACKEND"}})
        self.compute = ComputeThread()
        host = PluginHost([brdfs, meshes, bad("backend"), sound])
        answers = Answers()
        settings = Settings(tmp_path / "state")
        studio = assemble(
            settings=settings, host=host, shading=self.backend, ask=answers, threads=1, compute=self.compute
        )
        self.driver = Driver(studio, self.backend, answers, bot)
        self.driver.show(room())


@pytest.fixture
def seat(qtbot: QtBot, tmp_path: Path) -> Iterator[Seat]:
    made = Seat(qtbot, tmp_path)
    yield made
    if made.backend.stuck is not None:
        made.backend.stuck.set()
    made.driver.close()
    for name in ("stranger_bad", "stranger_sound"):
        del sys.modules[name]


@pytest.mark.parametrize("error", [ZeroDivisionError("no light"), SystemExit(3), UnsoundError("no number")])
def test_a_backend_that_raises_leaves_the_picture_and_a_way_out(seat: Seat, error: BaseException) -> None:
    driver, window = seat.driver, seat.driver.window
    scene, picture = driver.document.scene, driver.viewport._picture
    seat.backend.fail = error
    driver.session.shade_with("bad")
    driver.until(lambda: driver.feed.state is Freshness.FAILED)
    bar = window.backend_watch.bar
    driver.until(bar.isVisible)
    assert driver.viewport._picture is picture
    assert driver.document.scene is scene
    assert "could not compute the picture" in bar.text.text()
    assert any("plugin bad" in text for text in driver.problems())
    assert [failure.plugin for failure in driver.context.host.failures] == ["bad"]
    bar.use.click()
    assert driver.session.backend == DEFAULT
    driver.settle()
    assert not bar.isVisible()
    unharmed(driver)


def test_a_bar_goes_when_the_backend_works_again(seat: Seat) -> None:
    driver, bar = seat.driver, seat.driver.window.backend_watch.bar
    seat.backend.fail = ZeroDivisionError("no light")
    driver.session.shade_with("bad")
    driver.until(bar.isVisible)
    seat.backend.fail = None
    driver.session.select(["stool"])
    driver.do("object.right")
    driver.settle()
    assert not bar.isVisible()


def test_a_backend_that_never_asks_whether_to_go_on_is_left_behind(seat: Seat) -> None:
    driver, watch = seat.driver, seat.driver.window.backend_watch
    watch._timer.stop()
    seat.backend.stuck = threading.Event()
    driver.session.shade_with("bad")
    driver.until(seat.backend.entered.is_set)
    watch.look()
    driver.session.select(["stool"])
    driver.do("object.right")  # the window answers
    assert driver.labels()[-1].startswith("Nudge")
    driver.until(lambda: driver.feed.job is not None and driver.feed.job.cancelled)
    for _ in range(PATIENCE - 1):
        watch.look()
    assert not watch.bar.isVisible()
    for _ in range(2):
        watch.look()
    assert "does not answer" in watch.bar.text.text()
    assert any("does not answer" in text for text in driver.problems())
    assert [failure.plugin for failure in driver.context.host.failures] == ["bad"]
    watch.bar.use.click()
    driver.settle()
    assert driver.session.backend == DEFAULT
    assert driver.feed.last is not None
    unharmed(driver)
    named(driver, "did not stop")


def test_a_stuck_backend_that_was_left_by_oneself_lets_the_next_one_work(seat: Seat) -> None:
    driver, watch = seat.driver, seat.driver.window.backend_watch
    watch._timer.stop()
    seat.backend.stuck = threading.Event()
    driver.session.shade_with("bad")
    driver.until(seat.backend.entered.is_set)
    watch.look()
    driver.session.shade_with(DEFAULT)
    for _ in range(PATIENCE + 1):
        watch.look()
    driver.settle()
    assert not watch.bar.isVisible()
    unharmed(driver)


def test_nobody_is_left_behind_for_being_slow(seat: Seat) -> None:
    """A job that is not asked to stop may take its time, and one that goes on asking stops by itself."""
    driver, watch = seat.driver, seat.driver.window.backend_watch
    watch._timer.stop()
    seat.backend.stuck = threading.Event()
    driver.session.shade_with("bad")
    driver.until(seat.backend.entered.is_set)
    for _ in range(3 * PATIENCE):
        watch.look()
    assert not watch.bar.isVisible()
    seat.backend.stuck.set()
    driver.settle()
    assert driver.problems() == []


def test_every_job_ends_and_nobody_waits_for_one_that_did(
    seat: Seat, monkeypatch: pytest.MonkeyPatch
) -> None:
    driver, watch = seat.driver, seat.driver.window.backend_watch
    watch._timer.stop()
    jobs: list[Job] = []

    class Kept(Job):
        def __init__(self, *given: Any, **more: Any) -> None:
            super().__init__(*given, **more)
            jobs.append(self)

    monkeypatch.setattr("studio_core.shading.scheduler.Job", Kept)
    for _ in range(3):
        driver.session.select(["stool"])
        driver.do("object.right")
        watch.look()
    driver.settle()
    driver.until(lambda: driver.feed.job is None)
    assert {job.label for job in jobs} >= {"Shading", "Looking at hidden places"}
    assert all(job.ended for job in jobs)
    for job in jobs:
        job.cancel()
    for _ in range(PATIENCE + 2):
        watch.look()
    assert driver.problems() == []
