"""Windows to test; on machines without a display Qt draws offscreen."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

os.environ.setdefault("QT_QPA_PLATFORM", "offscreen")

import pytest
from PySide6.QtCore import Qt
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication, QWidget
from pytestqt.qtbot import QtBot
from ui_support import Answers, Driver, Fake, Make, room

from studio.app import assemble
from studio_core.contract import Plugin
from studio_core.registry import PluginHost
from studio_core.shading.scheduler import InlineExecutor
from studio_plugins.brdfs import plugin as brdfs
from studio_plugins.meshes import plugin as meshes
from studio_ui.settings import Settings


@pytest.fixture(autouse=True)
def hands_off() -> Iterator[None]:
    """No button and no key stays held for the next test: Qt remembers those of the last event."""
    yield
    if QApplication.instance() is not None:
        for button in (Qt.MouseButton.LeftButton, Qt.MouseButton.MiddleButton, Qt.MouseButton.RightButton):
            QTest.mouseRelease(QWidget(), button)


@pytest.fixture
def make(qtbot: QtBot, tmp_path: Path) -> Iterator[Make]:
    """Open windows: `make(threads=True)` computes on real threads, otherwise inline."""
    made: list[Driver] = []

    def build(
        *,
        threads: bool = False,
        state: Path | None = None,
        answers: Answers | None = None,
        plugins: Sequence[Plugin] = (brdfs, meshes),
    ) -> Driver:
        fake, answers = Fake(), answers or Answers()
        settings = Settings(state or tmp_path / "state")
        settings.set("animate_view", False)
        given: dict[str, Any] = {} if threads else {"compute": InlineExecutor(), "files": InlineExecutor()}
        studio = assemble(
            settings=settings,
            host=PluginHost(plugins),
            shading=fake,
            ask=answers,
            threads=1,
            thumbnails=tmp_path / "thumbnails",
            **given,
        )
        made.append(Driver(studio, fake, answers, qtbot))
        return made[-1]

    yield build
    for driver in made:
        driver.close()


@pytest.fixture
def driver(make: Make) -> Driver:
    """A window on the small room, computed inline."""
    made = make()
    made.show(room())
    return made
