"""The picture itself: only the part that is seen is made for the screen, at the screen's own resolution."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt
from PySide6.QtCore import QEvent, QPointF, QRect, QRectF, QSize, Qt, Signal
from PySide6.QtGui import (
    QColor,
    QImage,
    QKeyEvent,
    QMouseEvent,
    QPainter,
    QPaintEvent,
    QPen,
    QResizeEvent,
    QWheelEvent,
)
from PySide6.QtWidgets import QWidget

from studio_ui.capture.preview.picture import Shown
from studio_ui.capture.preview.pyramid import Pyramid
from studio_ui.capture.preview.sight import Part, Sight, fitted, part_seen
from studio_ui.capture.preview.tone import displayed, tinted
from studio_ui.capture.preview.turned import turned
from studio_ui.capture.tools.tool import Tool
from studio_ui.look.theme import DARK, Theme

_NOTCH, _STEP = 120.0, 1.2  # a wheel's notch, and how much nearer it brings the picture
_GRIP = 7  # widget pixels beside the wipe's line where it can be taken
_NUDGE = 40.0  # widget pixels that an arrow key moves the picture by
_TURNED = 400  # samples across while a hand turns the picture
_KEYS = {
    *(Qt.Key.Key_Left, Qt.Key.Key_Right, Qt.Key.Key_Up, Qt.Key.Key_Down),
    *(Qt.Key.Key_Plus, Qt.Key.Key_Equal, Qt.Key.Key_Minus, Qt.Key.Key_0, Qt.Key.Key_1),
    *(Qt.Key.Key_BracketLeft, Qt.Key.Key_BracketRight),
    *(Qt.Key.Key_Delete, Qt.Key.Key_Backspace),
}

Build = Callable[[Callable[[], None], Callable[[], None]], None]


class PictureView(QWidget):
    """Zooms to the cursor, moves, compares by a wipe. `build(work, done)` does work somewhere else.

    `hovered` has the picture's point under the mouse, or None; `sight_changed` and `wiped` follow the hand.
    """

    hovered = Signal(object)
    sight_changed = Signal()

    def __init__(self, build: Build) -> None:
        super().__init__()
        self.theme = DARK
        self.shown: Shown | None = None
        self.exposure = 0.0
        self.sight: Sight | None = None  # None: as large as it fits
        self.tool = Tool()
        self.hidden: set[str] = set()  # names of marks
        self.wipe = 0.5
        self.wiping = True
        self.sides = ("before", "after")  # of the wipe
        self.remark = ""  # over the picture, say that it is an old one
        self.turning: npt.NDArray[np.float64] | None = None
        self._build = build
        self._pyramids: dict[int, Pyramid] = {}
        self._made: dict[tuple[Any, ...], QImage] = {}
        self._from: QPointF | None = None
        self._held = self._wipe_held = False
        self.setMouseTracking(True)
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        self.setAccessibleName("Preview")
        self.setMinimumSize(160, 120)
        self.setAttribute(Qt.WidgetAttribute.WA_OpaquePaintEvent)

    def sizeHint(self) -> QSize:
        """As much as there is."""
        return QSize(640, 480)

    def set_theme(self, theme: Theme) -> None:
        """Colours around the picture."""
        self.theme = theme
        self.update()

    # what is shown

    def show_picture(self, shown: Shown | None) -> None:
        """Another picture, or the same again; the zoom stays where key and size are those of before."""
        old, self.shown = self.shown, shown
        if shown is None or old is None or (old.key, old.size) != (shown.key, shown.size):
            self.sight = None
        self.turning = None
        wanted = [] if shown is None else [shown.pixels, *(m.mask for m in shown.marks)]
        if shown is not None and shown.before is not None:
            wanted.append(shown.before)
        known = {id(pixels): self._pyramids.get(id(pixels)) for pixels in wanted}
        self._pyramids = {
            key: pyramid if pyramid is not None and pyramid.pixels is pixels else Pyramid(pixels)
            for pixels in wanted
            for key, pyramid in [(id(pixels), known[id(pixels)])]
        }
        self._made.clear()
        self._complete()
        self.update()

    def set_exposure(self, exposure: float) -> None:
        """EV, for the display alone."""
        if exposure != self.exposure:
            self.exposure = exposure
            self.update()

    def show_marks(self, hidden: set[str]) -> None:
        """All marks but these."""
        self.hidden = hidden
        self.update()

    def set_remark(self, text: str) -> None:
        """What is said over the picture; nothing for nothing."""
        if text != self.remark:
            self.remark = text
            self.update()

    def set_tool(self, tool: Tool) -> None:
        """What a hand does."""
        self.tool.drop(self)
        self._held = False
        self.tool = tool
        self.update()

    def turn(self, rotation: npt.NDArray[np.float64] | None) -> None:
        """Show it turned, for the moment and coarsely."""
        self.turning = rotation
        self.update()

    def _complete(self) -> None:
        """Have the halves made."""
        todo = [pyramid for pyramid in self._pyramids.values() if not pyramid.complete]
        if not todo:
            return

        def work() -> None:
            for pyramid in todo:
                pyramid.build()

        def done() -> None:
            if any(pyramid in self._pyramids.values() for pyramid in todo):
                self._made.clear()
                self.update()

        self._build(work, done)

    # zoom

    @property
    def extent(self) -> tuple[float, float]:
        """The widget's size."""
        return float(self.width()), float(self.height())

    @property
    def seen(self) -> Sight:
        """The sight, fitted where none was chosen."""
        if self.sight is not None or self.shown is None:
            return self.sight or Sight(0, 0, 1)
        return fitted(self.extent, self.shown.size)

    def to_widget(self, x: float, y: float) -> QPointF:
        """Where a point of the picture is seen."""
        return QPointF(*self.seen.to_widget(x, y, self.extent))

    def to_picture(self, at: QPointF) -> tuple[float, float]:
        """Which point of the picture is seen there."""
        return self.seen.to_picture(at.x(), at.y(), self.extent)

    def fit(self) -> None:
        """All of it."""
        self._look(None)

    def actual(self) -> None:
        """A pixel of the display for one of the picture."""
        self.zoom(1 / (self.devicePixelRatioF() * self.seen.scale))

    def zoom(self, factor: float, at: QPointF | None = None) -> None:
        """Nearer (above 1) or further."""
        if self.shown is not None:
            point = (at.x(), at.y()) if at is not None else (self.width() / 2, self.height() / 2)
            self._look(self.seen.zoomed(factor, point, self.extent, self.shown.size))

    def _pan(self, dx: float, dy: float) -> None:
        if self.shown is not None:
            self._look(self.seen.moved(dx, dy, self.extent, self.shown.size))

    def _look(self, sight: Sight | None) -> None:
        self.sight = sight
        self.update()
        self.sight_changed.emit()

    # events

    def event(self, event: QEvent) -> bool:
        """Its own keys are not the window's while it has the focus: Delete deletes no chair."""
        if event.type() == QEvent.Type.ShortcutOverride and isinstance(event, QKeyEvent):
            control = event.modifiers() & Qt.KeyboardModifier.ControlModifier
            if event.key() in _KEYS and not control:
                event.accept()
                return True
        return super().event(event)

    def wheelEvent(self, event: QWheelEvent) -> None:
        """To the cursor."""
        self.zoom(_STEP ** (event.angleDelta().y() / _NOTCH), event.position())
        event.accept()

    def mousePressEvent(self, event: QMouseEvent) -> None:
        """The wipe's line, the tool, else the picture moves."""
        at, left = event.position(), event.button() == Qt.MouseButton.LeftButton
        if left and self._at_wipe(at):
            self._wipe_held = True
        elif left and self.shown is not None and self.tool.press(self, at, event.modifiers()):
            self._held = True
        else:
            self._from = at
            self.setCursor(Qt.CursorShape.ClosedHandCursor)

    def mouseMoveEvent(self, event: QMouseEvent) -> None:
        """Drags, and where the mouse is."""
        at = event.position()
        if self._wipe_held:
            self.wipe = min(max(at.x() / max(self.width(), 1), 0.0), 1.0)
            self.update()
        elif self._held:
            self.tool.move(self, at, event.modifiers())
        elif self._from is not None:
            self._pan(at.x() - self._from.x(), at.y() - self._from.y())
            self._from = at
        else:
            found = Qt.CursorShape.SplitHCursor if self._at_wipe(at) else self.tool.cursor(self, at)
            self.setCursor(found or Qt.CursorShape.ArrowCursor)
        self.hovered.emit(self._point(at))

    def mouseReleaseEvent(self, event: QMouseEvent) -> None:
        """The drag is over."""
        if self._held:
            self._held = False
            self.tool.release(self)
        self._wipe_held, self._from = False, None
        self.setCursor(self.tool.cursor(self, event.position()) or Qt.CursorShape.ArrowCursor)

    def mouseDoubleClickEvent(self, event: QMouseEvent) -> None:
        """All of the picture, or its pixels where the mouse is."""
        if self._at_wipe(event.position()):
            self.wipe = 0.5
            self.update()
        elif self.tool.cursor(self, event.position()) is None:
            if self.sight is None:
                self.zoom(1 / (self.devicePixelRatioF() * self.seen.scale), event.position())
            else:
                self.fit()

    def leaveEvent(self, event: QEvent) -> None:
        """The mouse is over nothing."""
        self.hovered.emit(None)

    def keyPressEvent(self, event: QKeyEvent) -> None:
        """Esc gives a drag up, the tool's keys, then zoom and arrows."""
        if event.key() == Qt.Key.Key_Escape and self._held and self.tool.drop(self):
            self._held = False
            return
        if self.shown is None or self.tool.key(self, event):
            return
        moves = {
            Qt.Key.Key_Left: (_NUDGE, 0.0),
            Qt.Key.Key_Right: (-_NUDGE, 0.0),
            Qt.Key.Key_Up: (0.0, _NUDGE),
            Qt.Key.Key_Down: (0.0, -_NUDGE),
        }
        match event.key():
            case Qt.Key.Key_Plus | Qt.Key.Key_Equal:
                self.zoom(_STEP)
            case Qt.Key.Key_Minus:
                self.zoom(1 / _STEP)
            case Qt.Key.Key_0:
                self.fit()
            case Qt.Key.Key_1:
                self.actual()
            case Qt.Key.Key_BracketLeft | Qt.Key.Key_BracketRight if self._comparing:
                step = 0.05 if event.key() == Qt.Key.Key_BracketRight else -0.05
                self.wipe = min(max(self.wipe + step, 0.0), 1.0)
                self.update()
            case key if key in moves:
                self._pan(*moves[Qt.Key(key)])
            case _:
                super().keyPressEvent(event)

    def resizeEvent(self, event: QResizeEvent) -> None:
        """Some of the picture stays in sight."""
        if self.sight is not None and self.shown is not None:
            self.sight = self.sight.held(self.extent, self.shown.size)

    def _point(self, at: QPointF) -> tuple[float, float] | None:
        """The picture's point there, None beside it."""
        if self.shown is None:
            return None
        x, y = self.to_picture(at)
        width, height = self.shown.size
        return (x, y) if 0 <= x < width and 0 <= y < height else None

    @property
    def _comparing(self) -> bool:
        return self.wiping and self.shown is not None and self.shown.before is not None

    def _at_wipe(self, at: QPointF) -> bool:
        return self._comparing and abs(at.x() - self.wipe * self.width()) <= _GRIP

    # painting

    def paintEvent(self, event: QPaintEvent) -> None:
        """The part that is seen, marks, the tool."""
        painter = QPainter(self)
        painter.fillRect(self.rect(), QColor(self.theme.canvas))
        shown = self.shown
        if shown is None:
            painter.end()
            return
        if self.turning is not None:
            self._paint_turned(painter, shown)
        else:
            self._paint(painter, shown)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        self.tool.paint(painter, self)
        if self.remark:
            wide = painter.fontMetrics().horizontalAdvance(self.remark) + 20
            high = painter.fontMetrics().height() + 6
            _pill(painter, QRectF(8, self.height() - high - 8, wide, high), self.remark)
        painter.end()

    def _paint(self, painter: QPainter, shown: Shown) -> None:
        part = part_seen(self.seen, self.extent, shown.size, self.devicePixelRatioF())
        if part is None:
            return
        target = self._target(part)
        fine = self.seen.scale * self.devicePixelRatioF()
        painter.setRenderHint(QPainter.RenderHint.SmoothPixmapTransform, fine < 3)
        painter.drawImage(target, self._image(shown.pixels, part))
        for mark in shown.marks:
            if mark.name not in self.hidden:
                painter.drawImage(target, self._tint(mark.mask, mark.colour, part))
        if self._comparing and shown.before is not None:
            at = round(self.wipe * self.width())
            painter.save()
            painter.setClipRect(QRect(0, 0, at, self.height()))
            painter.drawImage(target, self._image(shown.before, part))
            painter.restore()
            self._paint_wipe(painter, at)

    def _paint_wipe(self, painter: QPainter, at: int) -> None:
        painter.setPen(QPen(QColor(self.theme.mark), 2))
        painter.drawLine(at, 0, at, self.height())
        for text, right in zip(self.sides, (True, False), strict=True):
            wide = painter.fontMetrics().horizontalAdvance(text) + 12
            box = QRectF(at - wide - 6 if right else at + 6, 6, wide, painter.fontMetrics().height() + 4)
            _pill(painter, box, text)

    def _paint_turned(self, painter: QPainter, shown: Shown) -> None:
        """The whole picture coarsely, each sample where the turning brings it from."""
        assert self.turning is not None
        width, height = shown.size
        left, right = self._edges(0, width)
        top, bottom = self._edges(1, height)
        if right <= left or bottom <= top:
            return
        x = _middles(left, right, _TURNED)
        y = _middles(top, bottom, max(2, round(_TURNED * (bottom - top) / (right - left))))
        level = max(0, int(np.log2(max(width / (2 * _TURNED), 1))))
        part = Part(level, 0, 0, width >> level, height >> level)
        small = self._pyramids[id(shown.pixels)].part(part)
        image = _qimage(displayed(turned(small, self.turning, x / width, y / height), self.exposure))
        painter.setRenderHint(QPainter.RenderHint.SmoothPixmapTransform)
        painter.drawImage(QRectF(self.to_widget(left, top), self.to_widget(right, bottom)), image)

    def _edges(self, axis: int, size: int) -> tuple[float, float]:
        """The first and last of the picture that is seen, along x (0) or y (1)."""
        first, last = self.to_picture(QPointF(0, 0)), self.to_picture(QPointF(*self.extent))
        return max(first[axis], 0.0), min(last[axis], float(size))

    def _target(self, part: Part) -> QRectF:
        step = 1 << part.level
        corner = self.to_widget(part.left * step, part.top * step)
        return QRectF(corner, self.to_widget(part.right * step, part.bottom * step))

    def _image(self, pixels: npt.NDArray[Any], part: Part) -> QImage:
        """For the screen; what was made last for a picture is kept."""
        pyramid = self._pyramids[id(pixels)]
        key = (id(pixels), part, self.exposure)
        if key not in self._made:
            self._forget(id(pixels))
            self._made[key] = _qimage(displayed(pyramid.part(part), self.exposure))
        return self._made[key]

    def _tint(self, mask: npt.NDArray[np.bool_], colour: tuple[int, int, int], part: Part) -> QImage:
        key = (id(mask), part, colour)
        if key not in self._made:
            self._forget(id(mask))
            made = tinted(self._pyramids[id(mask)].part(part), colour)
            kind = QImage.Format.Format_ARGB32_Premultiplied
            self._made[key] = QImage(made.tobytes(), made.shape[1], made.shape[0], kind).copy()
        return self._made[key]

    def _forget(self, number: int) -> None:
        self._made = {key: image for key, image in self._made.items() if key[0] != number}


def _qimage(pixels: npt.NDArray[np.uint8]) -> QImage:
    """A copy, since Qt keeps no reference to an array."""
    height, width = pixels.shape[:2]
    return QImage(
        np.ascontiguousarray(pixels).data, width, height, 3 * width, QImage.Format.Format_RGB888
    ).copy()


def _pill(painter: QPainter, box: QRectF, text: str) -> None:
    """Text on a dark ground, readable on any picture."""
    painter.setPen(Qt.PenStyle.NoPen)
    painter.setBrush(QColor(20, 20, 20, 190))
    painter.drawRoundedRect(box, 4, 4)
    painter.setPen(QColor("#ffffff"))
    painter.drawText(box, Qt.AlignmentFlag.AlignCenter, text)


def _middles(first: float, last: float, count: int) -> npt.NDArray[np.float64]:
    """The middles of `count` equal parts."""
    return first + (np.arange(count) + 0.5) * (last - first) / count
