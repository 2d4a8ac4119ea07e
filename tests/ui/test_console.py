"""The console: a prompt over the real window, typed into as a person would."""

from __future__ import annotations

import threading
from pathlib import Path
from typing import Any

import pytest
from PySide6.QtCore import Qt, QTimer
from PySide6.QtWidgets import QApplication
from ui_support import Answers, Driver, Make, room

from studio_core.edits import Move, SetFields
from studio_core.project.store import load
from studio_core.scene.transform import Transform
from studio_core.shading.job import Job
from studio_ui.bridge import Bridge
from studio_ui.console.editor import MOST_HISTORY, History
from studio_ui.console.running import StopDialog
from studio_ui.panels.console import ConsolePanel


class Typist:
    """Types into the console of a window."""

    def __init__(self, driver: Driver) -> None:
        self.driver = driver
        self.panel: ConsolePanel = driver.window.panels["console"]
        self.panel.interpreter._first = 0.01
        self.dock = driver.window.docks["console"]

    def type(self, text: str) -> None:
        self.driver.bot.keyClicks(self.panel.editor, text)

    def key(self, key: Qt.Key, held: Qt.KeyboardModifier = Qt.KeyboardModifier.NoModifier) -> None:
        self.driver.bot.keyClick(self.panel.editor, key, held)

    def enter(self, text: str) -> None:
        self.type(text)
        self.key(Qt.Key.Key_Return)

    @property
    def text(self) -> str:
        return self.panel.transcript.toPlainText()

    @property
    def typed(self) -> str:
        return self.panel.editor.toPlainText()


@pytest.fixture
def typist(driver: Driver) -> Typist:
    """A console over the small room."""
    return Typist(driver)


def stop_soon(panel: ConsolePanel) -> list[StopDialog]:
    """Press Stop when the dialog has come; the dialogs that were seen."""
    seen: list[StopDialog] = []
    tick = panel.running.tick

    def watched() -> bool:
        asked = tick()
        dialog = panel.running.dialog
        if dialog is not None and not seen:
            seen.append(dialog)
            QTimer.singleShot(0, dialog.button.click)
        return asked

    panel.interpreter._tick = watched
    panel.running.tick = watched  # type: ignore[method-assign]
    return seen


def test_it_is_hidden_at_first_and_a_key_leads_there(typist: Typist) -> None:
    window = typist.driver.window
    assert typist.dock.isHidden()
    typist.driver.do("window.console")
    assert typist.dock.isVisible()
    window.activateWindow()
    typist.driver.until(lambda: typist.panel.editor.hasFocus())
    typist.driver.do("window.console")
    assert typist.dock.isHidden()


def test_what_is_typed_is_done_and_is_one_step(typist: Typist) -> None:
    before = typist.driver.document.scene
    typist.enter("for node in find_all('*oo*'):")
    assert typist.typed == "for node in find_all('*oo*'):\n    "
    typist.enter("move(node, by=(0, 0, 1))")
    typist.enter("copy(node)")
    typist.key(Qt.Key.Key_Backspace)
    assert typist.driver.labels() == ["Open"]
    typist.panel.editor.setPlainText(typist.typed.rstrip() + "\n")
    typist.panel.editor.moveCursor(typist.panel.editor.textCursor().MoveOperation.End)
    typist.key(Qt.Key.Key_Return)
    assert typist.driver.labels() == ["Open", "Console: for node in find_all('*oo*'):"]
    assert typist.driver.document.scene["stool"].transform.translation == (1.0, 0.0, 1.0)
    assert "... " in typist.text
    typist.driver.do("edit.undo")
    assert typist.driver.document.scene is before


def test_errors_are_told_in_their_colour_and_change_nothing(typist: Typist) -> None:
    before = typist.driver.document.scene
    typist.enter("move('Stool', by=(0, 1, 0)); move('Stol', by=(0, 1, 0))")
    assert typist.driver.document.scene is before
    assert "did you mean 'Stool'" in typist.text
    assert "What it had changed was taken back." in typist.text
    assert "interpreter.py" not in typist.text
    typist.panel.traceback.click()
    assert "interpreter.py" in typist.text
    typist.enter("1 + 1")
    assert not typist.panel.traceback.isEnabled()
    assert typist.text.endswith("\n2")


def test_history_is_kept_between_starts(make: Make, tmp_path: Path) -> None:
    state = tmp_path / "mine"
    first = make(state=state)
    typist = Typist(first)
    typist.enter("a = 1")
    typist.enter("b = 2")
    typist.type("c")
    typist.key(Qt.Key.Key_Up)
    assert typist.typed == "b = 2"
    typist.key(Qt.Key.Key_Up)
    typist.key(Qt.Key.Key_Up)
    assert typist.typed == "a = 1"
    typist.key(Qt.Key.Key_Down)
    typist.key(Qt.Key.Key_Down)
    assert typist.typed == "c"
    first.close()
    again = Typist(make(state=state))
    again.key(Qt.Key.Key_Up)
    assert again.typed == "b = 2"


def test_history_is_bounded_and_forgives_what_is_stored() -> None:
    history = History(["a", 3, None, "b"])
    assert history.commands == ["a", "b"]
    for number in range(2 * MOST_HISTORY):
        history.add(str(number))
        history.add(str(number))
    assert len(history.commands) == MOST_HISTORY
    assert history.commands[-2:] == [str(2 * MOST_HISTORY - 2), str(2 * MOST_HISTORY - 1)]


def test_tab_completes_names_of_things(typist: Typist) -> None:
    typist.type("find('Sto")
    typist.key(Qt.Key.Key_Tab)
    assert typist.typed == "find('Stool"
    typist.panel.editor.clear()
    typist.type("mo")
    typist.key(Qt.Key.Key_Tab)
    popup = typist.panel.editor.completer.popup()
    assert popup.isVisible()
    assert typist.panel.hint.text().startswith("move(thing, to=None, by=None)")
    typist.key(Qt.Key.Key_Return)
    assert typist.typed == "move"
    typist.type("(")
    assert typist.panel.hint.text().startswith("move(thing, to=None, by=None)")
    typist.key(Qt.Key.Key_Tab)
    assert not popup.isVisible()


def test_shift_enter_starts_a_line_and_control_enter_runs(typist: Typist) -> None:
    typist.type("x = 5")
    typist.key(Qt.Key.Key_Return, Qt.KeyboardModifier.ShiftModifier)
    typist.type("y = 6")
    assert typist.typed == "x = 5\ny = 6"
    typist.key(Qt.Key.Key_Return, Qt.KeyboardModifier.ControlModifier)
    typist.enter("x * y")
    assert typist.text.endswith("30")


@pytest.mark.parametrize("source", ["while True: pass", "while True: move('Stool', by=(0, 0, 0.01))"])
def test_a_command_that_never_ends_is_stopped_by_the_button(typist: Typist, source: str) -> None:
    before = typist.driver.document.scene
    seen = stop_soon(typist.panel)
    typist.enter(source)
    assert len(seen) == 1
    assert seen[0].windowModality() is Qt.WindowModality.ApplicationModal
    assert "Stopped." in typist.text
    assert typist.driver.document.scene is before
    assert typist.panel.running.dialog is None
    typist.driver.settle()
    typist.enter("6 * 7")
    assert typist.text.endswith("42")


def test_results_of_other_threads_wait_while_a_command_runs(typist: Typist, qapp: QApplication) -> None:
    came: list[str] = []
    bridge: Bridge = typist.driver.studio.bridge
    typist.panel.names.namespace["pump"] = qapp.processEvents
    typist.panel.names.namespace["post"] = lambda: bridge.post(lambda: came.append("late"))
    typist.panel.names.namespace["came"] = came
    typist.enter("post(); pump(); len(came)")
    assert typist.text.endswith("\n0")
    typist.driver.until(lambda: came == ["late"])


def test_heavy_work_is_done_where_kernels_run_and_can_be_stopped(make: Make) -> None:
    driver = make(threads=True)
    driver.show(room())
    typist = Typist(driver)
    running = typist.panel.running
    assert running.heavily("Naming", lambda job: threading.current_thread().name) == "compute"
    with pytest.raises(ZeroDivisionError):
        running.heavily("Failing", lambda job: 1 / 0)

    def endless(job: Job) -> None:
        while True:
            job.checkpoint(1, 2)

    typist.panel.names.namespace["endless"] = lambda: running.heavily("Endless", endless)
    seen = stop_soon(typist.panel)
    typist.enter("endless()")
    assert len(seen) == 1
    assert "Stopped." in typist.text
    driver.session.select(["stool"])
    driver.do("object.right")
    driver.settle()  # the compute thread is free again


def test_a_flood_of_output_keeps_the_transcript_small(typist: Typist) -> None:
    typist.enter("for i in range(10**5): print(i)")
    assert "more characters are not shown" in typist.text
    assert typist.panel.transcript.blockCount() <= 5_000
    typist.panel.clear()
    assert typist.text == ""


def test_a_script_is_run_and_what_was_done_is_saved_as_one(make: Make, tmp_path: Path) -> None:
    answers = Answers()
    driver = make(answers=answers)
    driver.show(room())
    typist = Typist(driver)
    file = tmp_path / "lift.py"
    file.write_text(
        "for node in find_all('Stool'):\n    move(node, by=(0, 1, 0))\n    move(node, by=(0, 1, 0))\n"
    )
    answers.files = [file]
    typist.panel.run_script()
    assert driver.labels() == ["Open", "Script lift"]
    file.write_text("move('Nobody', by=(0, 1, 0))\n")
    typist.panel.run_script()
    assert "no node named 'Nobody'" in typist.text
    answers.target = tmp_path / "mine"
    typist.panel.save_script()
    assert not (tmp_path / "mine.py").exists()
    typist.enter("move('Stool', to=(0, 0, 0))")
    typist.enter("nonsense")
    typist.panel.save_script()
    saved = (tmp_path / "mine.py").read_text("utf-8")
    assert saved.endswith("\nmove('Stool', to=(0, 0, 0))\n")
    assert "nonsense" not in saved
    compile(saved, "mine.py", "exec")


def test_what_the_window_does_is_shown_as_a_script(typist: Typist) -> None:
    driver = typist.driver
    typist.panel.telling.setChecked(True)
    driver.context.editing.apply(SetFields("stool", {"hidden": True}))
    owner = object()
    driver.context.editing.begin(owner, "Move Stool")
    for x in (1.0, 2.0, 3.0):
        driver.context.editing.preview(owner, Move({"stool": Transform((x, 0.0, 0.0))}, "Move Stool"))
    driver.context.editing.commit(owner)
    driver.do("edit.undo")
    typist.enter("redo()")
    lines = typist.text.splitlines()
    at = lines.index("apply(SetFields('stool', {'hidden': True}))")
    assert lines[at + 1 : at + 4] == [
        "apply(Move({'stool': Transform((3, 0, 0))}, label='Move Stool'))",
        "undo()",
        ">>> redo()",
    ]
    after = driver.document.scene
    driver.document.go_to(0)
    namespace: dict[str, Any] = typist.panel.names.namespace
    exec("\n".join(typist.panel.script), namespace)
    assert driver.document.scene["stool"] == after["stool"]


def test_gestures_that_are_cancelled_are_not_told(typist: Typist) -> None:
    editing, owner = typist.driver.context.editing, object()
    typist.panel.telling.setChecked(True)
    editing.begin(owner, "Move Stool")
    editing.preview(owner, Move({"stool": Transform((1.0, 0.0, 0.0))}, "Move Stool"))
    editing.cancel(owner)
    editing.begin(owner, "Move Stool")
    editing.commit(owner)
    assert "Move" not in typist.text


def test_a_copy_is_saved(typist: Typist, tmp_path: Path) -> None:
    path = tmp_path / "copy.lucarne"
    typist.panel.names.namespace["target"] = path
    typist.enter("save(target)")
    assert load(path).scene["stool"].name == "Stool"


def test_an_open_drag_is_ended_before_a_command(typist: Typist) -> None:
    editing, owner = typist.driver.context.editing, object()
    editing.begin(owner, "Move Stool")
    editing.preview(owner, Move({"stool": Transform((1.5, 0.0, 0.0))}, "Move Stool"))
    typist.enter("move('Stool', by=(0, 0, 1))")
    assert typist.driver.document.scene["stool"].transform.translation == (1.5, 0.0, 1.0)
    assert typist.driver.labels() == ["Open", "Move Stool", "Move Stool"]
