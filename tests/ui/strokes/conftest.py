"""Windows to paint in, over a solver that explains strokes by rule of thumb."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
from painting_support import PLUGIN, Rule, brush_in_hand, studio_of
from pytestqt.qtbot import QtBot
from ui_support import Driver


@pytest.fixture
def rule() -> Rule:
    """The solver; a module may have another."""
    return Rule()


@pytest.fixture
def painter(rule: Rule, monkeypatch: pytest.MonkeyPatch, qtbot: QtBot, tmp_path: Path) -> Iterator[Driver]:
    """A window with the brush in the hand."""
    monkeypatch.setattr("painting_support.SOLVER", rule)
    yield from brush_in_hand(studio_of(tmp_path / "state", qtbot, PLUGIN))
