"""Icons: drawn once for a name, a colour and a pixel ratio."""

from __future__ import annotations

import pytest
from PySide6.QtCore import QSize
from PySide6.QtGui import QColor, QIcon, QPixmap, QPixmapCache
from pytestqt.qtbot import QtBot

from studio_ui.look import icons


@pytest.fixture
def drawn(qtbot: QtBot, monkeypatch: pytest.MonkeyPatch) -> list[tuple[str, str, int]]:
    """What is drawn from now on."""
    told: list[tuple[str, str, int]] = []
    draw = icons._drawn

    def noted(name: str, colour: QColor, ratio: int) -> QPixmap:
        told.append((name, colour.name(QColor.NameFormat.HexArgb), ratio))
        return draw(name, colour, ratio)

    monkeypatch.setattr(icons, "_drawn", noted)
    QPixmapCache.clear()
    return told


def test_an_icon_is_drawn_once_for_each_colour_and_ratio(drawn: list[tuple[str, str, int]]) -> None:
    icons.icon("add", "#202020", selected="#ffffff")
    assert sorted({colour for _, colour, _ in drawn}) == ["#59202020", "#ff202020", "#ffffffff"]
    assert len(drawn) == len(set(drawn)) == 9
    icons.icon("add", "#202020", on="#ffffff")
    assert len(drawn) == 9
    icons.icon("delete", "#202020")
    assert len(drawn) == 15


@pytest.mark.usefixtures("drawn")
def test_modes_have_their_own_colours() -> None:
    made = icons.icon("add", "#ff0000", on="#00ff00", selected="#0000ff")

    def colour(mode: QIcon.Mode, state: QIcon.State) -> tuple[int, int, int, int]:
        image = made.pixmap(QSize(24, 24), 1.0, mode, state).toImage()
        return image.pixelColor(12, 7).getRgb()

    assert colour(QIcon.Mode.Normal, QIcon.State.Off)[:3] == (255, 0, 0)
    assert colour(QIcon.Mode.Normal, QIcon.State.On)[:3] == (0, 255, 0)
    assert colour(QIcon.Mode.Selected, QIcon.State.On)[:3] == (0, 0, 255)
    faded, plain = (colour(mode, QIcon.State.Off)[3] for mode in (QIcon.Mode.Disabled, QIcon.Mode.Normal))
    assert faded == pytest.approx(0.35 * plain, abs=3)


@pytest.mark.usefixtures("drawn")
def test_unknown_names_are_refused() -> None:
    with pytest.raises(KeyError):
        icons.icon("no such icon", "#000000")
