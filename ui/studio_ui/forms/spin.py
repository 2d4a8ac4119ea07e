"""The number field: reads units, sums, comma and point alike; shows lengths in the window's unit.

Up and Down go by one step, with Shift (or Page Up and Down) by ten, with Ctrl by a tenth. Keys that are held
down, and the mouse on a `ScrubLabel`, are one gesture: `held`, `valueChanged` …, then `let_go` or `dropped`.
"""

from __future__ import annotations

import math

from PySide6.QtCore import QPoint, QSignalBlocker, QSize, Qt, Signal
from PySide6.QtGui import QFocusEvent, QKeyEvent, QMouseEvent, QShowEvent, QValidator, QWheelEvent
from PySide6.QtWidgets import QApplication, QDoubleSpinBox, QLabel, QToolTip, QWidget

from studio_core.errors import InputError
from studio_core.params import ParamInfo
from studio_ui.forms.number_style import NumberStyle, number_style

MIXED = "—"
"""Shown where several things are edited at once and differ."""
_WIDEST = 1e9
_PRECISION = 9  # decimals of the value itself; what is shown has fewer
_LINE, _FRAME = 18, 8  # pixels: the text, and the theme's padding and border
_NOTCH = 120  # of a mouse wheel
_SLIP = 3  # pixels before a press on a label becomes a drag
_KEYS = {
    Qt.Key.Key_Up: 1.0,
    Qt.Key.Key_Down: -1.0,
    Qt.Key.Key_PageUp: 10.0,
    Qt.Key.Key_PageDown: -10.0,
}


class Spin(QDoubleSpinBox):
    """A number in `info.unit`; `value()` is always in that unit, whatever is shown.

    The wheel is left to the panel until the field is clicked. `show_unit=False` where a label has the unit.
    """

    held = Signal()
    let_go = Signal()
    dropped = Signal()

    def __init__(self, info: ParamInfo | None = None, *, decimals: int = 3, show_unit: bool = True) -> None:
        self.mixed = self._edited = False
        super().__init__()
        self.info = info or ParamInfo("number", "")
        self._whole = self.info.kind == "integer"
        self._shown = 0 if self._whole else decimals
        self._show_unit = show_unit
        self._style = NumberStyle()
        self._step = 0.0  # 0: what suits the unit
        self._holding = False
        self._wheel = 0
        self.setDecimals(0 if self._whole else _PRECISION)
        self.setRange(max(self.info.low, -_WIDEST), min(self.info.high, _WIDEST))
        self.setKeyboardTracking(False)
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        self.setAlignment(Qt.AlignmentFlag.AlignRight)
        self.setMinimumWidth(58)
        if self.info.label:
            self.setAccessibleName(self.info.label)
        self.lineEdit().textEdited.connect(self._typing)
        self.editingFinished.connect(self._finished)

    def show_value(self, value: float) -> None:
        """Without telling."""
        self.mixed = False
        with QSignalBlocker(self):
            self.setValue(value)

    def show_mixed(self, value: float) -> None:
        """Several values, without telling; steps start from `value`."""
        self.mixed = True
        with QSignalBlocker(self):
            self.setValue(value)

    def _typing(self, text: str) -> None:
        self._edited = any(sign.isdigit() for sign in text)

    def _finished(self) -> None:
        """A number that was typed over several values counts, also when it is what one of them was."""
        edited, self._edited = self._edited, False
        if self.mixed and edited:
            self.mixed = False
            self.valueChanged.emit(self.value())

    def sizeHint(self) -> QSize:
        """As high as a line of text is; Qt adds the margins of the line inside."""
        hint = super().sizeHint()
        return QSize(hint.width(), max(self.fontMetrics().height() + 3, _LINE) + _FRAME)

    def minimumSizeHint(self) -> QSize:
        """As high as `sizeHint`."""
        return QSize(super().minimumSizeHint().width(), self.sizeHint().height())

    # text

    def textFromValue(self, value: float) -> str:
        """In the window's unit and with its decimal mark."""
        if self.mixed:
            return MIXED
        return self._style.text(value, self.info.unit, self._shown, with_unit=self._show_unit)

    def valueFromText(self, text: str) -> float:
        """What is written; text that was not touched is the value itself, not what was rounded for show."""
        if text == self.textFromValue(self.value()):
            return self.value()
        try:
            found = self._style.read(text, self.info.unit)
        except InputError:
            return self.value()
        return float(round(found)) if self._whole else found

    def validate(self, text: str, at: int) -> object:
        """Anything may be typed; what cannot be read is not taken."""
        if self.mixed and text == MIXED:
            return QValidator.State.Acceptable, text, at
        try:
            self._style.read(text, self.info.unit)
        except InputError:
            return QValidator.State.Intermediate, text, at
        return QValidator.State.Acceptable, text, at

    def fixup(self, text: str) -> str:
        """Say why what was typed is not taken; the value before comes back."""
        try:
            self._style.read(text, self.info.unit)
        except InputError as error:
            QToolTip.showText(self.mapToGlobal(QPoint(0, self.height())), f"{error}.", self)
        return text

    def follow_style(self) -> None:
        """Show numbers as the window does now."""
        style = number_style(self)
        if style != self._style:
            self._style = style
            self.setValue(self.value())

    def showEvent(self, event: QShowEvent) -> None:
        """In the style of the window that it has come to."""
        super().showEvent(event)
        self.follow_style()

    # steps

    def setSingleStep(self, step: float) -> None:
        """One step, in the field's unit."""
        self._step = step

    def step_size(self) -> float:
        """What Up and Down add."""
        if self._step:
            return self._step
        if self.info.scale == "log" and self.value():
            return float(10.0 ** (math.floor(math.log10(abs(self.value()))) - 1))
        if self.info.unit == "m":
            return self._style.length_unit.step
        return {"°": 1.0, "K": 50.0, "EV": 0.1}.get(self.info.unit, 1.0 if self._whole else 0.01)

    def stepBy(self, steps: int) -> None:
        """The arrows beside the number; Qt has multiplied by ten where Ctrl is held."""
        keys = QApplication.keyboardModifiers()
        self.step(math.copysign(1, steps), keys)

    def step(self, steps: float, keys: Qt.KeyboardModifier = Qt.KeyboardModifier.NoModifier) -> None:
        """Go by steps: Shift ten times as far, Ctrl a tenth; whole numbers at least by one."""
        if keys & Qt.KeyboardModifier.ShiftModifier:
            steps *= 10
        if keys & Qt.KeyboardModifier.ControlModifier:
            steps /= 10
        self.interpretText()
        by = steps * self.step_size()
        if self._whole:
            by = math.copysign(max(abs(round(by)), 1), by)
        self.setValue(round(self.value() + by, _PRECISION))
        self.selectAll()

    def keyPressEvent(self, event: QKeyEvent) -> None:
        """Up and Down; Enter takes what is written, Esc puts back what was there."""
        steps = _KEYS.get(Qt.Key(event.key()))
        if steps is not None and not self.isReadOnly():
            if not self._holding:
                self.interpretText()
                self.hold()
            self.step(steps, event.modifiers())
            event.accept()
        elif event.key() == Qt.Key.Key_Escape and self.lineEdit().text() != self.textFromValue(self.value()):
            self.lineEdit().setText(self.textFromValue(self.value()))
            self.selectAll()
            event.accept()
        elif event.key() == Qt.Key.Key_Escape:
            event.ignore()  # the window takes it
        else:
            super().keyPressEvent(event)

    def keyReleaseEvent(self, event: QKeyEvent) -> None:
        """A key that was held down is one step of the history."""
        if Qt.Key(event.key()) in _KEYS and not event.isAutoRepeat():
            self.let_go_now()
        super().keyReleaseEvent(event)

    def focusOutEvent(self, event: QFocusEvent) -> None:
        """Nothing is held without the focus."""
        self.let_go_now()
        super().focusOutEvent(event)

    def wheelEvent(self, event: QWheelEvent) -> None:
        """Only while it has the focus."""
        if not self.hasFocus():
            event.ignore()
            return
        delta = event.angleDelta()
        self._wheel += delta.y() or delta.x()  # Alt turns the wheel sideways
        notches = int(self._wheel / _NOTCH)
        if notches:
            self._wheel -= notches * _NOTCH
            self.step(notches, event.modifiers())
        event.accept()

    # gestures

    def hold(self) -> None:
        """What follows is one gesture."""
        if not self._holding:
            self._holding = True
            self.held.emit()

    def let_go_now(self) -> None:
        """The gesture ends and stays."""
        if self._holding:
            self._holding = False
            self.let_go.emit()

    def drop_now(self) -> None:
        """The gesture is taken back."""
        if self._holding:
            self._holding = False
            self.dropped.emit()


class ScrubLabel(QLabel):
    """A label whose number follows the mouse: drag to the right for more, Shift faster, Ctrl finer.

    Esc takes it back. A click puts the cursor into the field.
    """

    def __init__(self, text: str, spin: Spin, parent: QWidget | None = None) -> None:
        super().__init__(text, parent)
        self._spin = spin
        self._from: float | None = None
        self._dragging = False
        self.setBuddy(spin)
        self.setCursor(Qt.CursorShape.SizeHorCursor)

    def mousePressEvent(self, event: QMouseEvent) -> None:
        """A drag may begin."""
        if event.button() is Qt.MouseButton.LeftButton and self._spin.isEnabled():
            self._from, self._dragging = event.position().x(), False
            self._spin.setFocus(Qt.FocusReason.MouseFocusReason)

    def mouseMoveEvent(self, event: QMouseEvent) -> None:
        """One step a pixel or two."""
        if self._from is None:
            return
        x = event.position().x()
        if not self._dragging and abs(x - self._from) >= _SLIP:
            self._dragging = True
            self._spin.installEventFilter(self)
            self._spin.hold()
        if self._dragging:
            pixels = int(x - self._from)
            if pixels:
                self._from += pixels
                self._spin.step(pixels, event.modifiers())

    def mouseReleaseEvent(self, event: QMouseEvent) -> None:
        """One step of the history, or only a click."""
        if self._from is None or event.button() is not Qt.MouseButton.LeftButton:
            return
        if self._dragging:
            self._end()
            self._spin.let_go_now()
        else:
            self._spin.selectAll()
        self._from = None

    def eventFilter(self, watched: object, event: object) -> bool:
        """Esc while the mouse is down."""
        if isinstance(event, QKeyEvent) and event.key() == Qt.Key.Key_Escape and self._dragging:
            if event.type() == event.Type.KeyPress:
                self._end()
                self._from = None
                self._spin.drop_now()
            else:
                event.accept()
            return True
        return False

    def _end(self) -> None:
        self._dragging = False
        self._spin.removeEventFilter(self)
