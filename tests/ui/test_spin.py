"""Number fields: every locale, units, steps, gestures."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from PySide6.QtCore import QLocale, QPoint, Qt
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication, QFormLayout, QLineEdit, QToolTip, QWidget
from pytestqt.qtbot import QtBot
from ui_support import move_mouse

from studio_core.params import ParamInfo
from studio_core.units import LENGTH_UNITS
from studio_ui.forms.fields import NumberField
from studio_ui.forms.number_style import NumberStyle, number_style, set_number_style
from studio_ui.forms.param_form import form_label
from studio_ui.forms.spin import ScrubLabel, Spin
from studio_ui.look.theme import DARK, wear

LENGTH = ParamInfo("number", "Width", unit="m")
ANGLE = ParamInfo("number", "Angle", unit="°", low=-180, high=180)
WHOLE = ParamInfo("integer", "Samples", low=1, high=4096)
LOCALES = [
    QLocale(QLocale.Language.German),
    QLocale(QLocale.Language.English),
    QLocale(QLocale.Language.French),
    QLocale(QLocale.Language.Arabic, QLocale.Country.Egypt),
    QLocale(QLocale.Language.German, QLocale.Country.Switzerland),
]
CTRL, SHIFT = Qt.KeyboardModifier.ControlModifier, Qt.KeyboardModifier.ShiftModifier


@pytest.fixture(params=LOCALES, ids=lambda locale: locale.name())
def locale(request: pytest.FixtureRequest) -> Iterator[QLocale]:
    before = QLocale()
    QLocale.setDefault(request.param)
    yield request.param
    QLocale.setDefault(before)


class Heard:
    """A sink that remembers."""

    def __init__(self) -> None:
        self.told: list[object] = []

    def begin(self, name: str) -> bool:
        self.told.append("begin")
        return True

    def preview(self, name: str, value: object) -> None:
        self.told.append(("preview", value))

    def commit(self) -> None:
        self.told.append("commit")

    def cancel(self) -> None:
        self.told.append("cancel")

    def apply(self, name: str, value: object) -> None:
        self.told.append(("apply", value))


def shown(qtbot: QtBot, spin: QWidget, style: NumberStyle | None = None) -> QWidget:
    window = QWidget()
    qtbot.addWidget(window, before_close_func=lambda _, kept=window: None)  # the bot itself lets go of it
    QFormLayout(window).addRow(spin)
    if style is not None:
        set_number_style(window, style)
    with qtbot.waitExposed(window):
        window.show()
    return window


def write(spin: Spin, text: str) -> None:
    spin.setFocus()
    spin.selectAll()
    QTest.keyClicks(spin, text)
    QTest.keyClick(spin, Qt.Key.Key_Return)


@pytest.mark.parametrize(
    ("text", "value"), [("0,8", 0.8), ("0.8", 0.8), ("80 cm", 0.8), ("1.234,5", 1234.5), ("1/2+3cm", 0.53)]
)
def test_every_locale_reads_the_same(text: str, value: float, locale: QLocale, qtbot: QtBot) -> None:
    spin = Spin(LENGTH)
    shown(qtbot, spin)
    write(spin, text)
    assert spin.value() == pytest.approx(value, abs=1e-9)
    again = Spin(LENGTH)
    shown(qtbot, again)
    write(again, spin.text())
    assert again.value() == pytest.approx(value, abs=5e-4), "what is shown can be typed"


def test_the_decimal_mark_is_the_system_s(locale: QLocale, qtbot: QtBot) -> None:
    spin = Spin(LENGTH)
    shown(qtbot, spin)
    spin.setValue(0.5)
    assert spin.text() == ("0,5 m" if locale.decimalPoint() == "," else "0.5 m")


@pytest.mark.parametrize(
    ("unit", "text"),
    [("m", "0.762 m"), ("cm", "76.2 cm"), ("mm", "762 mm"), ("in", "30 in"), ("ft-in", "2'6\"")],
)
def test_lengths_are_shown_in_the_window_s_unit(unit: str, text: str, qtbot: QtBot) -> None:
    spin, angle = Spin(LENGTH), Spin(ANGLE)
    window = shown(qtbot, spin)
    layout = window.layout()
    assert isinstance(layout, QFormLayout)
    layout.addRow(angle)
    spin.setValue(0.762)
    angle.setValue(45)
    set_number_style(window, NumberStyle(unit, "."))
    assert spin.text() == text
    assert spin.value() == pytest.approx(0.762, abs=1e-12)
    assert angle.text() == "45°"
    late = Spin(LENGTH)
    layout.addRow(late)
    late.setValue(0.762)
    late.show()
    assert late.text() == text
    assert number_style(late).length == unit


def test_numbers_without_a_unit_are_in_the_unit_that_is_shown(qtbot: QtBot) -> None:
    spin = Spin(LENGTH)
    shown(qtbot, spin, NumberStyle("cm", ","))
    write(spin, "80")
    assert spin.value() == pytest.approx(0.8)
    write(spin, "2'6\"")
    assert spin.text() == "76,2 cm"


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=40)
@given(st.floats(-1000, 1000), st.sampled_from(sorted(LENGTH_UNITS)))
def test_a_visit_changes_nothing(qtbot: QtBot, value: float, unit: str) -> None:
    """Tabbing through a form is no edit, although what is shown is rounded."""
    spin = Spin(LENGTH)
    window = QWidget()
    spin.setParent(window)
    set_number_style(window, NumberStyle(unit, "."))
    spin.setValue(value)
    exact, heard = spin.value(), []
    spin.valueChanged.connect(heard.append)
    spin.interpretText()
    assert heard == []
    assert spin.value() == exact
    window.deleteLater()


def test_what_cannot_be_read_is_told_and_put_back(qtbot: QtBot) -> None:
    spin = Spin(LENGTH)
    shown(qtbot, spin)
    spin.setValue(2)
    write(spin, "3 chairs")
    assert spin.value() == 2
    assert spin.text() == "2 m"
    qtbot.waitUntil(lambda: "chairs" in QToolTip.text(), timeout=30_000)
    QToolTip.hideText()
    write(spin, "45°")
    assert spin.value() == 2
    QToolTip.hideText()


def test_values_stay_within_their_range(qtbot: QtBot) -> None:
    spin, whole = Spin(ANGLE), Spin(WHOLE)
    shown(qtbot, spin)
    shown(qtbot, whole)
    write(spin, "1 turn")
    assert spin.value() == 180
    write(whole, "2,6")
    assert whole.value() == 3
    assert whole.text() == "3"


def test_esc_puts_back_what_was_there(qtbot: QtBot) -> None:
    spin = Spin(LENGTH)
    shown(qtbot, spin)
    spin.setValue(1)
    spin.setFocus()
    spin.selectAll()
    QTest.keyClicks(spin, "7")
    QTest.keyClick(spin, Qt.Key.Key_Escape)
    assert spin.text() == "1 m"
    assert spin.value() == 1


def test_steps_are_bigger_with_shift_and_smaller_with_ctrl(qtbot: QtBot) -> None:
    spin = Spin(LENGTH)
    shown(qtbot, spin, NumberStyle("cm", "."))
    spin.setFocus()
    for key, keys, text in [
        (Qt.Key.Key_Up, Qt.KeyboardModifier.NoModifier, "1 cm"),
        (Qt.Key.Key_Up, SHIFT, "11 cm"),
        (Qt.Key.Key_Down, CTRL, "10.9 cm"),
        (Qt.Key.Key_PageUp, Qt.KeyboardModifier.NoModifier, "20.9 cm"),
    ]:
        QTest.keyClick(spin, key, keys)
        assert spin.text() == text
    spin.stepUp()
    assert spin.text() == "21.9 cm"
    whole = Spin(WHOLE)
    shown(qtbot, whole)
    whole.setFocus()
    whole.setValue(5)
    QTest.keyClick(whole, Qt.Key.Key_Down, CTRL)
    assert whole.value() == 4


def test_a_number_is_as_high_as_a_line_of_text(qtbot: QtBot, qapp: QApplication) -> None:
    wear(qapp, DARK)
    spin, line = Spin(LENGTH), QLineEdit()
    shown(qtbot, spin)
    shown(qtbot, line)
    assert spin.height() == line.height()
    assert spin.lineEdit().height() >= spin.fontMetrics().height()


def test_a_held_key_is_one_gesture(qtbot: QtBot) -> None:
    heard = Heard()
    field = NumberField("width", LENGTH, heard)
    shown(qtbot, field, NumberStyle("m", "."))
    field.show_value(1.0)
    field.spin.setFocus()
    for _ in range(3):
        QTest.keyPress(field.spin, Qt.Key.Key_Up)
    QTest.keyRelease(field.spin, Qt.Key.Key_Up)
    assert heard.told[0] == "begin"
    assert [told[1] for told in heard.told[1:-1]] == pytest.approx([1.01, 1.02, 1.03])  # type: ignore[index]
    assert heard.told[-1] == "commit"


def test_a_held_key_is_a_step_each_where_no_gesture_may_begin(qtbot: QtBot) -> None:
    class Busy(Heard):
        def begin(self, name: str) -> bool:
            return False

    heard = Busy()
    field = NumberField("width", LENGTH, heard)
    shown(qtbot, field, NumberStyle("m", "."))
    field.show_value(1.0)
    for _ in range(2):
        QTest.keyPress(field.spin, Qt.Key.Key_Up)
    QTest.keyRelease(field.spin, Qt.Key.Key_Up)
    assert heard.told == [("apply", pytest.approx(1.01)), ("apply", pytest.approx(1.02))]


def test_a_drag_on_the_label_is_one_gesture(qtbot: QtBot) -> None:
    heard = Heard()
    field = NumberField("width", LENGTH, heard)
    window = QWidget()
    qtbot.addWidget(window)
    layout = QFormLayout(window)
    label = form_label("Width", "", field)
    assert isinstance(label, ScrubLabel)
    layout.addRow(label, field)
    window.show()
    field.show_value(1.0)
    left = Qt.MouseButton.LeftButton
    QTest.mousePress(label, left, pos=QPoint(10, 10))
    move_mouse(label, QPoint(11, 10))
    QTest.mouseRelease(label, left, pos=QPoint(11, 10))
    assert heard.told == [], "a click is no drag"
    QTest.mousePress(label, left, pos=QPoint(10, 10))
    move_mouse(label, QPoint(20, 10))
    move_mouse(label, QPoint(30, 10))
    QTest.mouseRelease(label, left, pos=QPoint(30, 10))
    assert heard.told[0] == "begin"
    assert heard.told[-2:] == [("preview", pytest.approx(1.2)), "commit"]
    heard.told.clear()
    QTest.mousePress(label, left, pos=QPoint(10, 10))
    move_mouse(label, QPoint(20, 10))
    QTest.keyClick(field.spin, Qt.Key.Key_Escape)
    move_mouse(label, QPoint(40, 10))
    QTest.mouseRelease(label, left, pos=QPoint(40, 10))
    assert heard.told[0] == "begin"
    assert heard.told[-1] == "cancel"
