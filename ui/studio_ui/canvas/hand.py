"""What the hand does on a canvas: mouse, wheel and keys of a widget as signals without Qt in them."""

from __future__ import annotations

from collections.abc import Callable

from PySide6.QtCore import QEvent, QPointF, QSize, Qt
from PySide6.QtGui import (
    QFocusEvent,
    QInputDevice,
    QKeyEvent,
    QMouseEvent,
    QNativeGestureEvent,
    QResizeEvent,
    QWheelEvent,
)
from PySide6.QtWidgets import QSizePolicy, QWidget

from studio_core.signal import Signal
from studio_ui.canvas.viewport import Button, Pointer

_BUTTONS: dict[Qt.MouseButton, Button] = {
    Qt.MouseButton.LeftButton: "left",
    Qt.MouseButton.MiddleButton: "middle",
    Qt.MouseButton.RightButton: "right",
}
_ANGLE_PIXELS = 0.5
"""Pixels that fingers slide for an eighth of a degree, where a touchpad tells no pixels."""
_KEYS = {
    Qt.Key.Key_Escape: "escape",
    Qt.Key.Key_Return: "enter",
    Qt.Key.Key_Enter: "enter",
    Qt.Key.Key_Backspace: "backspace",
}
_ALWAYS = frozenset({"escape", *(f"{shift}{axis}" for shift in ("", "shift+") for axis in "xyz")})
"""Keys that come here while no shortcut of the window has them."""
_AWHILE = (
    Qt.FocusReason.PopupFocusReason,
    Qt.FocusReason.MenuBarFocusReason,
    Qt.FocusReason.ActiveWindowFocusReason,
)
_COMMANDS = (
    Qt.KeyboardModifier.ControlModifier | Qt.KeyboardModifier.AltModifier | Qt.KeyboardModifier.MetaModifier
)


class Hand(QWidget):
    """A widget with the signals of `canvas.viewport.Viewport`."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.widget: QWidget = self
        self.pointer: Signal[[Pointer]] = Signal()
        self.wheel: Signal[[Pointer, float]] = Signal()
        self.scroll: Signal[[Pointer, float, float]] = Signal()
        self.pinch: Signal[[Pointer, float]] = Signal()
        self.key: Signal[[str, bool]] = Signal()
        self.left: Signal[[]] = Signal()
        self.resized: Signal[[int, int]] = Signal()
        self._held: Button = "none"
        self._wanted: Callable[[str], bool] = lambda name: False
        self.setMouseTracking(True)
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Expanding)
        self.setMinimumSize(240, 160)
        self.setAccessibleName("Picture")

    def device_size(self) -> tuple[int, int]:
        """Width and height in device pixels, as Qt rounds them for what it draws into: halves up."""
        ratio = self.devicePixelRatioF()
        return int(self.width() * ratio + 0.5), int(self.height() * ratio + 0.5)

    def sizeHint(self) -> QSize:
        """Some room to start with."""
        return QSize(960, 600)

    def resizeEvent(self, event: QResizeEvent) -> None:
        """Device pixels are what a picture is made for."""
        self.resized.emit(*self.device_size())

    def mousePressEvent(self, event: QMouseEvent) -> None:
        """Remember the button until it is released."""
        if self._held == "none" or event.buttons() == event.button():  # a release may have been missed
            self._held = _BUTTONS.get(event.button(), "none")
            self._send("press", event)

    def mouseMoveEvent(self, event: QMouseEvent) -> None:
        """With what is held."""
        self._send("move", event)

    def mouseReleaseEvent(self, event: QMouseEvent) -> None:
        """Only of the button that was pressed first."""
        if _BUTTONS.get(event.button()) == self._held:
            self._send("release", event)
            self._held = "none"

    def mouseDoubleClickEvent(self, event: QMouseEvent) -> None:
        """A second press at the same place."""
        self._held = _BUTTONS.get(event.button(), "none")
        self._send("double", event)

    def wheelEvent(self, event: QWheelEvent) -> None:
        """Steps of a wheel, or what two fingers slide on a touchpad."""
        pointer = self._pointer("move", event.position(), event.modifiers())
        pixels, angle = event.pixelDelta(), event.angleDelta()
        if _fingers(event):
            slid = pixels if not pixels.isNull() else angle * _ANGLE_PIXELS
            if not slid.isNull():
                height = max(self.height(), 1)
                self.scroll.emit(pointer, slid.x() / height, slid.y() / height)
        elif angle.y() or pointer.alt:
            self.wheel.emit(pointer, (angle.y() or angle.x()) / 120)  # with Alt Qt turns the wheel sideways
        event.accept()

    def event(self, event: QEvent) -> bool:
        """Two fingers that spread or close; the keys that are wanted are taken from the shortcuts."""
        if isinstance(event, QKeyEvent) and event.type() is QEvent.Type.ShortcutOverride:
            name = _name(event)
            if name and self._wanted(name):
                event.accept()
                return True
        if isinstance(event, QNativeGestureEvent):
            if event.gestureType() is Qt.NativeGestureType.ZoomNativeGesture:
                self.pinch.emit(self._pointer("move", event.position(), event.modifiers()), event.value())
                return True
            return False
        return super().event(event)

    def leaveEvent(self, event: QEvent) -> None:
        """Nothing is under the mouse any more."""
        self.left.emit()

    def keyPressEvent(self, event: QKeyEvent) -> None:
        """Keys that are held; the others are actions of the window."""
        self._key(event, True)

    def keyReleaseEvent(self, event: QKeyEvent) -> None:
        """The end of it."""
        self._key(event, False)

    def focusOutEvent(self, event: QFocusEvent) -> None:
        """The keyboard is somewhere else now, unless a menu or another window has it for a while."""
        if event.reason() not in _AWHILE:
            self.key.emit("focus", False)
        super().focusOutEvent(event)

    def want_keys(self, wanted: Callable[[str], bool]) -> None:
        """Keys of these names come before all shortcuts of the window."""
        self._wanted = wanted

    def _key(self, event: QKeyEvent, pressed: bool) -> None:
        name = _name(event)
        if name and (name in _ALWAYS or self._wanted(name)):
            if name in ("backspace", "enter") or not event.isAutoRepeat():
                self.key.emit(name, pressed)
        else:
            event.ignore()

    def _send(self, kind: str, event: QMouseEvent) -> None:
        self.pointer.emit(self._pointer(kind, event.position(), event.modifiers()))

    def _pointer(self, kind: str, at: QPointF, keys: Qt.KeyboardModifier) -> Pointer:
        return Pointer(
            kind,  # type: ignore[arg-type]
            at.x() / max(self.width(), 1),
            at.y() / max(self.height(), 1),
            self._held,
            bool(keys & Qt.KeyboardModifier.ShiftModifier),
            bool(keys & Qt.KeyboardModifier.ControlModifier),
            bool(keys & Qt.KeyboardModifier.AltModifier),
            (self.width(), self.height()),
        )


def _fingers(event: QWheelEvent) -> bool:
    """Whether this comes from a touchpad: only there are there pixels, phases, or the device says so."""
    if not event.pixelDelta().isNull() or event.phase() is not Qt.ScrollPhase.NoScrollPhase:
        return True
    device = event.device()
    return device is not None and device.type() is QInputDevice.DeviceType.TouchPad


def _name(event: QKeyEvent) -> str:
    """As `Viewport.want_keys` tells; empty for keys without one."""
    if event.modifiers() & _COMMANDS:
        return ""
    known = _KEYS.get(Qt.Key(event.key()))
    text = event.text()
    if known is not None or len(text) != 1 or not text.isprintable():
        return known or ""
    if not text.isalpha():
        return text
    shifted = bool(event.modifiers() & Qt.KeyboardModifier.ShiftModifier)  # and not caps lock
    return f"shift+{text.lower()}" if shifted else text.lower()
