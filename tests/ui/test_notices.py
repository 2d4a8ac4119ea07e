"""What went wrong, told over the picture."""

from __future__ import annotations

import errno
import itertools
import threading
from pathlib import Path

import pytest
from PySide6.QtGui import QGuiApplication
from ui_support import Driver, Make, room

from studio_core.edits import SetFields
from studio_core.errors import Cancelled, ProjectError
from studio_core.shading.job import Job
from studio_ui.files.report import ReportDialog, report_text, versions


def bars(driver: Driver):
    return driver.window.front.notices


def test_equal_problems_are_counted_and_others_stand_below_each_other(driver: Driver) -> None:
    journal = driver.context.journal
    journal.write("Just so you know.", "warning")
    assert bars(driver).isHidden()
    for _ in range(3):
        journal.problem("Saving", ProjectError("a.lucarne could not be saved: the disk is full"))
    assert bars(driver).told == [("a.lucarne could not be saved: the disk is full", 3)]
    assert bars(driver).bars[0].text.text().endswith("(×3)")
    assert bars(driver).isVisible()
    for name in "bcd":
        journal.problem("Saving", ProjectError(f"{name} is bad"))
    assert [text[0] for text, _ in bars(driver).told] == ["b", "c", "d"]
    driver.bot.wait(1)
    boxes = [bar.geometry() for bar in bars(driver).bars]
    assert all(low.bottom() < high.top() for low, high in itertools.pairwise(boxes))
    assert bars(driver).rect().contains(boxes[-1])


def test_a_problem_is_dismissed_and_comes_again(driver: Driver) -> None:
    driver.context.journal.write("Bad.", "problem")
    bars(driver).bars[0].close_button.click()
    assert bars(driver).told == []
    assert bars(driver).isHidden()
    driver.context.journal.write("Bad.", "problem")
    assert bars(driver).told == [("Bad.", 1)]
    driver.do("file.new")
    assert bars(driver).told == [], "another document has no part in it"


def test_details_hold_versions_and_traceback_and_are_copied(driver: Driver) -> None:
    try:
        raise RuntimeError("the lamp is broken")
    except RuntimeError as error:
        driver.context.journal.problem("Computing", error)
    driver.window.front.notices._details(bars(driver).bars[0])
    dialog = driver.window.findChild(ReportDialog)
    text = dialog.report.toPlainText()
    assert "Traceback" in text
    assert "the lamp is broken" in text
    assert versions() in text
    dialog.copy.click()
    assert QGuiApplication.clipboard().text() == text
    dialog.close()


def test_a_report_has_the_moment_and_what_happened() -> None:
    text = report_text("It broke.", "detail", 0.0)
    assert text.startswith("It broke.\n(19")
    assert text.endswith("detail\n")


@pytest.mark.parametrize(
    ("code", "words"), [(errno.ENOSPC, "the disk is full"), (errno.EACCES, "access is denied")]
)
def test_a_failing_disk_is_told_in_a_sentence_and_loses_nothing(
    make: Make, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, code: int, words: str
) -> None:
    driver = make()
    driver.show(room())
    driver.document.apply(SetFields("stool", {"name": "Kept"}))

    def refuse(*args: object, **more: object) -> None:
        raise OSError(code, "as the system says it")

    monkeypatch.setattr("studio_core.project.store.replace_whole", refuse)
    driver.answers.target = tmp_path / "flat.lucarne"
    driver.do("file.save_as")
    driver.until(lambda: bool(bars(driver).told))
    assert bars(driver).told == [(f"flat.lucarne could not be saved: {words}", 1)]
    assert driver.document.modified
    assert driver.document.scene["stool"].name == "Kept"


def test_missing_folders_and_files_that_are_none(driver: Driver, tmp_path: Path) -> None:
    bad = tmp_path / "bad.lucarne"
    bad.write_text("no project")
    for path, words in (
        (tmp_path / "none.lucarne", "none.lucarne could not be opened: there is no such file"),
        (tmp_path / "no" / "x.lucarne", "x.lucarne could not be opened: there is no such file"),
        (tmp_path, "is not a file"),
        (bad, "bad.lucarne"),
    ):
        driver.window.files.open(path)
        driver.idle()
        assert words in driver.problems()[-1]
        assert "\n" not in driver.problems()[-1]


def test_a_crash_stays_told_whatever_is_opened(driver: Driver) -> None:
    driver.window.front.crashed("Fatal Python error: Segmentation fault")
    driver.context.journal.write("Bad.", "problem")
    driver.do("file.new")
    ((text, _),) = bars(driver).told
    assert "ended unexpectedly" in text
    bars(driver).bars[0].close_button.click()
    assert bars(driver).told == []


def test_long_tasks_are_told_with_progress_and_cancel(make: Make) -> None:
    driver = make(threads=True)
    driver.show(room())
    go = threading.Event()
    bar = driver.window.front.tasks
    bar._patience = 0.0

    def work(job: Job) -> None:
        job.checkpoint(1, 4)
        go.wait(60)
        job.checkpoint(2, 4)

    ended: list[Exception] = []
    driver.context.tasks.run("Importing chair", work, lambda _: ended.append(AssertionError()), ended.append)
    driver.until(lambda: bar.isVisible() and bar.progress.value() == 250)
    assert bar.text.text() == "Importing chair…"
    bar.cancel.click()
    assert bar.text.text() == "Stopping: Importing chair"
    assert not bar.cancel.isEnabled()
    go.set()
    driver.until(bar.isHidden)
    assert [type(error) for error in ended] == [Cancelled]
    assert driver.problems() == []
