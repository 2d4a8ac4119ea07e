"""Panels that tell: history, jobs, log, and the badge of what nobody has looked at."""

from __future__ import annotations

import threading
import time
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from PySide6.QtCore import Qt
from PySide6.QtGui import QGuiApplication
from PySide6.QtWidgets import QLabel
from ui_support import Driver, Make, room

from studio_core.errors import InputError
from studio_core.shading.job import Job
from studio_ui.panels import jobs
from studio_ui.panels.history import HistoryPanel
from studio_ui.panels.jobs import JobsPanel, remaining, words
from studio_ui.panels.log import LogPanel


def nudge(driver: Driver, *ways: str) -> None:
    driver.session.select(["stool"])
    for way in ways:
        driver.do(f"object.{way}")


def test_the_history_is_walked_with_the_keyboard(driver: Driver) -> None:
    nudge(driver, "right", "right", "up")
    panel: HistoryPanel = driver.window.panels["history"]
    driver.until(lambda: panel.list.count() == 4)
    assert panel.list.item(0).text() == "As it was opened"
    assert panel.told.text() == "3 steps done"
    driver.bot.keyClick(panel.list, Qt.Key.Key_Up)
    driver.bot.keyClick(panel.list, Qt.Key.Key_Up)
    assert driver.document.position == 1
    assert panel.told.text() == "1 step done, 2 undone"
    assert [panel.list.item(i).font().italic() for i in range(4)] == [False, False, True, True]
    driver.bot.keyClick(panel.list, Qt.Key.Key_End)
    assert driver.document.position == 3
    panel.list.setCurrentRow(0)
    nudge(driver, "up")
    driver.until(lambda: panel.list.count() == 2)


def test_what_is_in_the_file_is_marked(driver: Driver, tmp_path: Path) -> None:
    panel: HistoryPanel = driver.window.panels["history"]

    def marked() -> list[bool]:
        items = [panel.list.item(i) for i in range(panel.list.count())]
        return ["saved in the file" in item.toolTip() for item in items]

    nudge(driver, "right")
    driver.until(lambda: marked() == [True, False])
    driver.answers.target = tmp_path / "a.lucarne"
    driver.do("file.save")
    driver.until(lambda: marked() == [False, True])
    nudge(driver, "up")
    driver.until(lambda: marked() == [False, True, False])


# jobs


@given(st.floats(1.0, 1e5), st.integers(4, 100))
def test_what_is_left_is_what_the_rest_takes_at_this_pace(elapsed: float, done: int) -> None:
    left = remaining(elapsed, done, 100)
    assert left is not None
    assert elapsed / (elapsed + left) == pytest.approx(done / 100)


def test_nothing_is_guessed_from_nothing() -> None:
    assert remaining(100.0, 0, 0) is None
    assert remaining(0.2, 50, 100) is None
    assert remaining(100.0, 1, 100) is None
    assert [words(s) for s in (0.42, 9.96, 59.4, 60, 185, 3600 * 2 + 61)] == [
        *("0.4 s", "10 s", "59 s", "1 min 0 s", "3 min 5 s", "2 h 1 min")
    ]


def test_a_job_is_seen_cancelled_and_listed_for_a_while(make: Make, monkeypatch: pytest.MonkeyPatch) -> None:
    driver = make(threads=True)
    panel: JobsPanel = driver.window.panels["jobs"]
    go_on = threading.Event()

    def work(job: Job) -> None:
        while not go_on.wait(0.002):
            job.checkpoint(1, 4)

    driver.context.tasks.run("Importing chair", work, lambda _: None)
    driver.until(lambda: bool(panel.rows) and panel.rows[0].bar.value() == 250)
    assert panel.rows[0].label.text() == "Importing chair"
    panel.rows[0].button.click()
    driver.until(lambda: bool(panel.done))
    assert [task.state for task in panel.done] == ["cancelled"]

    def broken(job: Job) -> None:
        raise InputError("lamp.glb is damaged")

    driver.context.tasks.run("Importing lamp", broken, lambda _: None)
    driver.until(lambda: [task.state for task in panel.done] == ["cancelled", "failed"])
    texts = [label.text().rsplit(",", 1)[0] for label in panel.findChildren(QLabel)]
    assert "Importing lamp: did not work: see Log" in texts
    assert "Importing chair: cancelled" in texts
    later = time.monotonic() + jobs.SHOWN_FOR + 1
    monkeypatch.setattr(jobs.time, "monotonic", lambda: later)
    panel.refresh()
    assert panel.done == []
    go_on.set()


# log


def shown(panel: LogPanel) -> list[str]:
    items = [panel.list.item(i) for i in range(panel.list.count())]
    return [item.text().split("  ", 1)[1] for item in items if not item.isHidden()]


def test_the_log_is_narrowed_by_level_and_text(driver: Driver) -> None:
    journal = driver.context.journal
    journal.write("Saved chair")
    journal.write("No alpha in chair.png", "warning")
    journal.write("lamp.glb is damaged", "problem", "Traceback: …")
    panel: LogPanel = driver.window.panels["log"]
    assert [button.text() for button in panel.levels.values()] == ["Notes 1", "Warnings 1", "Problems 1"]
    panel.levels["note"].click()
    assert shown(panel) == ["No alpha in chair.png", "lamp.glb is damaged"]
    journal.write("Another note")
    assert len(shown(panel)) == 2
    panel.levels["note"].click()
    panel.find.setText("CHAIR")
    assert shown(panel) == ["Saved chair", "No alpha in chair.png"]


def test_details_are_folded_away_and_reports_are_copied(driver: Driver) -> None:
    journal = driver.context.journal
    panel: LogPanel = driver.window.panels["log"]
    assert not panel.report.isEnabled()
    journal.write("A note")
    journal.write("lamp.glb is damaged", "problem", "Traceback: line 7")
    panel.list.setCurrentRow(0)
    assert panel.fold.isHidden()
    panel.list.setCurrentRow(1)
    assert not panel.fold.isHidden()
    assert panel.detail.isHidden()
    panel.fold.click()
    assert not panel.detail.isHidden()
    assert panel.detail.toPlainText() == "Traceback: line 7"
    panel.report.click()
    text = QGuiApplication.clipboard().text()
    assert "lamp.glb is damaged" in text
    assert "Traceback: line 7" in text
    assert "Lucarne" in text
    panel.copy()
    lines = QGuiApplication.clipboard().text().splitlines()
    assert [line.split(" ", 1)[1] for line in lines[:2]] == ["note: A note", "problem: lamp.glb is damaged"]


def test_the_badge_counts_what_nobody_has_looked_at(make: Make) -> None:
    driver = make()
    driver.show(room())
    badge: Any = driver.window.badge
    assert badge.isHidden()
    driver.context.journal.write("Something", "problem")
    driver.context.journal.write("Another", "problem")
    driver.context.journal.write("Careful", "warning")
    assert badge.text() == "2 problems, 1 warning"
    assert not badge.isHidden()
    badge.click()
    driver.until(badge.isHidden)
    driver.context.journal.write("Once more", "problem")
    driver.until(badge.isHidden)  # somebody is looking
    driver.window.docks["history"].raise_()
    driver.until(lambda: driver.window.panels["log"].visibleRegion().isEmpty())
    driver.context.journal.write("Once more", "problem")
    assert badge.text() == "1 problem"
    driver.context.journal.clear()
    assert badge.isHidden()
