"""Colours that can be read, marks that can be seen, in every theme."""

from __future__ import annotations

import re
from collections.abc import Iterator

import pytest
from PySide6.QtCore import Qt
from PySide6.QtGui import QColor, QImage, QPalette
from PySide6.QtWidgets import QApplication, QCheckBox, QLineEdit, QPushButton, QRadioButton, QWidget
from pytestqt.qtbot import QtBot

from studio_core.params import parse_colour
from studio_ui.look.theme import _ASSETS, DARK, THEMES, Theme, wear

GROUNDS = ("window", "base", "raised")


def light(colour: str) -> float:
    """Relative luminance, as WCAG 2.2 defines it."""
    red, green, blue = parse_colour("colour", colour)
    return 0.2126 * red + 0.7152 * green + 0.0722 * blue


def contrast(one: str, other: str) -> float:
    bright, dark = sorted((light(one), light(other)), reverse=True)
    return (bright + 0.05) / (dark + 0.05)


@pytest.fixture(params=sorted(THEMES))
def worn(request: pytest.FixtureRequest, qapp: QApplication) -> Iterator[Theme]:
    wear(qapp, THEMES[request.param])
    yield THEMES[request.param]
    wear(qapp, DARK)


def grabbed(qtbot: QtBot, widget: QWidget) -> QImage:
    qtbot.addWidget(widget, before_close_func=lambda _, kept=widget: None)
    with qtbot.waitExposed(widget):
        widget.show()
    return widget.grab().toImage()


def colours(image: QImage) -> set[str]:
    return {image.pixelColor(x, y).name() for x in range(image.width()) for y in range(image.height())}


def test_black_on_white_is_21() -> None:
    assert contrast("#000000", "#ffffff") == pytest.approx(21, abs=0.01)
    assert contrast("#767676", "#ffffff") == pytest.approx(4.54, abs=0.01)


@pytest.mark.parametrize("name", sorted(THEMES))
@pytest.mark.parametrize("ground", GROUNDS)
@pytest.mark.parametrize("text", ["text", "dim", "warning", "problem"])
def test_text_can_be_read_on_every_ground(name: str, ground: str, text: str) -> None:
    """WCAG 2.2, 1.4.3 (AA): 4.5 for text; disabled text has the colour of remarks and is as readable."""
    theme = THEMES[name]
    assert contrast(getattr(theme, text), getattr(theme, ground)) >= 4.5


@pytest.mark.parametrize("name", sorted(THEMES))
def test_controls_and_their_focus_can_be_seen(name: str) -> None:
    """WCAG 2.2, 1.4.11: 3 for where a control is, whether it is on, and whether it has the focus."""
    theme = THEMES[name]
    for ground in GROUNDS:
        assert contrast(theme.accent, getattr(theme, ground)) >= 3
    for ground in ("window", "base"):
        assert contrast(theme.edge, getattr(theme, ground)) >= 3
    assert contrast(theme.on_accent, theme.accent) >= 4.5
    assert contrast(theme.text, theme.canvas) >= 4.5
    assert contrast(theme.dim, theme.canvas) >= 3


def test_the_palette_agrees_with_the_theme(worn: Theme, qapp: QApplication) -> None:
    found = qapp.palette()
    for role, colour in [
        (QPalette.ColorRole.Window, worn.window),
        (QPalette.ColorRole.Text, worn.text),
        (QPalette.ColorRole.Highlight, worn.accent),
    ]:
        assert found.color(role) == QColor(colour)
    disabled = found.color(QPalette.ColorGroup.Disabled, QPalette.ColorRole.Text)
    assert contrast(disabled.name(), worn.base) >= 4.5


def test_every_picture_of_the_sheet_is_there(worn: Theme, qapp: QApplication) -> None:
    named = re.findall(r'url\("([^"]+)"\)', qapp.styleSheet())
    assert len(named) >= 4
    assert all(name.startswith(_ASSETS.as_posix()) for name in named)
    for name in named:
        assert not QImage(name).isNull(), name


def test_a_check_mark_is_drawn(worn: Theme, qtbot: QtBot) -> None:
    on, off = QCheckBox(), QCheckBox()
    on.setChecked(True)
    assert {worn.accent, worn.on_accent} <= colours(grabbed(qtbot, on))
    assert worn.edge in colours(grabbed(qtbot, off))
    radio = QRadioButton()
    radio.setChecked(True)
    assert worn.accent in colours(grabbed(qtbot, radio))


@pytest.mark.parametrize("kind", [QLineEdit, QPushButton])
def test_the_focus_can_be_seen(kind: type[QWidget], worn: Theme, qtbot: QtBot) -> None:
    row, first = QWidget(), QPushButton("First")
    first.setParent(row)
    widget = kind()
    widget.setParent(row)
    widget.setGeometry(10, 40, 120, 30)
    first.setGeometry(10, 5, 120, 30)
    qtbot.addWidget(row, before_close_func=lambda _, kept=row: None)
    with qtbot.waitActive(row):
        row.show()
        row.activateWindow()
    first.setFocus()
    assert worn.accent not in colours(widget.grab().toImage())
    widget.setFocus(Qt.FocusReason.TabFocusReason)
    assert worn.accent in colours(widget.grab().toImage())
