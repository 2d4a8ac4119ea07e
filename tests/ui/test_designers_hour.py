"""A designer's hour: everything of a working day in the real window, a crash at its end, and nothing lost."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from designers_hour import window
from project_support.disk import environment
from pytestqt.qtbot import QtBot

from studio_core.project.codec import scene_digest
from studio_core.project.recovery import recovery_path
from studio_core.project.store import load

PATIENCE = 300  # seconds until the child is given up


@pytest.mark.skipif(os.name == "nt", reason="kills with a POSIX signal")
def test_a_designers_hour_survives_its_end(tmp_path: Path, qtbot: QtBot) -> None:
    state, folder = tmp_path / "state", tmp_path / "work"
    folder.mkdir()
    child = subprocess.Popen(
        [sys.executable, "-m", "designers_hour", str(state), str(folder)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env=environment(QT_QPA_PLATFORM="offscreen"),
    )
    try:
        assert child.stdout is not None
        line = child.stdout.readline()
        if not line:
            assert child.stderr is not None
            pytest.fail(child.stderr.read())
        told = json.loads(line)
        child.send_signal(signal.SIGKILL)
        assert child.wait(PATIENCE) == -signal.SIGKILL
    finally:
        child.kill()
        child.communicate(timeout=PATIENCE)
    project = folder / "room.lucarne"
    assert recovery_path(project).exists()
    saved = load(project)
    assert scene_digest(saved.scene) != told["digest"], "the last change was never saved"
    driver = window(state, qtbot)
    try:
        driver.answers.recover_ = "recovered"
        driver.window.files.open(project)
        driver.until(lambda: bool(driver.document.scene.nodes))
        assert driver.answers.asked == ["recover"]
        assert scene_digest(driver.document.scene) == told["digest"]
        assert driver.labels() == told["labels"]
        assert driver.document.modified
        driver.do("file.save")
        driver.until(lambda: not driver.window.files.modified)
        assert driver.problems() == []
    finally:
        driver.close()
    again = load(project)
    assert scene_digest(again.scene) == told["digest"]
    assert again.history is not None
    steps, position = again.history.opened()
    assert [step.label for step in steps] == told["labels"]
    assert position == len(steps) - 1
    assert not recovery_path(project).exists()
