"""The view cube over the picture: which way one looks, a click looks from there, a drag turns the view."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from PySide6.QtCore import QEvent, QPointF, QRectF, QSize, Qt
from PySide6.QtGui import (
    QColor,
    QFont,
    QMouseEvent,
    QPainter,
    QPaintEvent,
    QPen,
    QPolygonF,
    QTransform,
    QWheelEvent,
)
from PySide6.QtWidgets import QToolTip, QWidget

from studio_core.session import View
from studio_core.signal import Signal
from studio_ui.canvas.cube_shape import Face, Way, faces, field_at, flat, spoken
from studio_ui.canvas.projection import axes_of
from studio_ui.look.theme import DARK, Theme

SIZE = QSize(126, 122)
_HALF = 25.0  # logical pixels of half the cube's side
_MIDDLE = QPointF(66.0, 58.0)
_HOME = QRectF(4.0, 4.0, 22.0, 22.0)
_RING = 1.72  # half sides
_BELOW = -1.15
_SLIP = 4.0  # logical pixels that a click may slip
_LETTERS = 64.0  # pixels of a face while its name is written
_SUN = QColor("#f4c04e")

Part = Way | str
"""A field of the cube, or `home`."""


class ViewCube(QWidget):
    """`looked(way)`, `home()`; `pressed`, `dragged(dx, dy)` in logical pixels from there, `let_go`."""

    def __init__(self) -> None:
        super().__init__()
        self.looked: Signal[[Way]] = Signal()
        self.home: Signal[[]] = Signal()
        self.pressed: Signal[[]] = Signal()
        self.dragged: Signal[[float, float]] = Signal()
        self.let_go: Signal[[]] = Signal()
        self.hovered: Part | None = None
        self._axes = np.eye(3)
        self._sun: npt.NDArray[np.float64] | None = None
        self._theme = DARK
        self._press: QPointF | None = None
        self._mouse: QPointF | None = None
        self._dragging = False
        self.setFixedSize(SIZE)
        self.setMouseTracking(True)
        self.setAccessibleName("View cube")
        self.setAccessibleDescription("Looks from a side; keys 1, 3 and 7, with Ctrl from the other side")

    def set_view(self, view: View) -> None:
        """Turn as the view is turned."""
        axes = axes_of(view)
        if not np.array_equal(axes, self._axes):
            self._axes = axes
            if self._mouse is not None and not self._dragging:
                self._hover(self.part_at(self._mouse))
            self.update()

    def set_sun(self, direction: npt.ArrayLike | None) -> None:
        """(3,) where most light comes from, in the world; None: from no side."""
        self._sun = None if direction is None else np.asarray(direction, np.float64)
        self.update()

    def set_theme(self, theme: Theme) -> None:
        """Colours of another theme."""
        self._theme = theme
        self.update()

    def part_at(self, at: QPointF) -> Part | None:
        """What lies at a place of the widget."""
        if _HOME.contains(at):
            return "home"
        place = (at - _MIDDLE) / _HALF
        return field_at(self._axes, place.x(), place.y())

    def place_of(self, way: Way) -> QPointF | None:
        """Where a field lies in the widget, on the face that shows it best; None when it is not seen."""
        for face in sorted(faces(self._axes), key=lambda face: -face.facing):
            for field in face.fields:
                if field.way == way:
                    x, y = field.corners.mean(axis=0)
                    return _MIDDLE + QPointF(x, y) * _HALF
        return None

    # the hand

    def mousePressEvent(self, event: QMouseEvent) -> None:
        """A click or a drag begins; beside the cube it belongs to the picture."""
        if event.button() is not Qt.MouseButton.LeftButton or self.part_at(event.position()) is None:
            event.ignore()
            return
        self._press, self._dragging = event.position(), False

    def mouseMoveEvent(self, event: QMouseEvent) -> None:
        """Light what lies under the mouse, or turn."""
        at = self._mouse = event.position()
        if self._press is None:
            self._hover(self.part_at(at))
            return
        by = at - self._press
        if not self._dragging and by.manhattanLength() > _SLIP:
            self._dragging = True
            self._hover(None)
            self.pressed.emit()
        if self._dragging:
            self.dragged.emit(by.x(), by.y())

    def mouseReleaseEvent(self, event: QMouseEvent) -> None:
        """Look from there, or stop turning."""
        press, self._press = self._press, None
        if self._dragging:
            self._dragging = False
            self.let_go.emit()
            return
        part = None if press is None else self.part_at(press)
        if part == "home":
            self.home.emit()
        elif isinstance(part, tuple):
            self.looked.emit(part)

    def leaveEvent(self, event: QEvent) -> None:
        """Nothing is under the mouse."""
        self._mouse = None
        self._hover(None)

    def wheelEvent(self, event: QWheelEvent) -> None:
        """Not for the cube."""
        event.ignore()

    def event(self, event: QEvent) -> bool:
        """Say what a click does."""
        if event.type() is QEvent.Type.ToolTip:
            part = self.hovered
            if part is not None:
                words = f"From {told(part)}" if isinstance(part, tuple) else "Everything, from the front"
                QToolTip.showText(self.mapToGlobal(self.rect().bottomLeft()), words, self)
            return True
        return super().event(event)

    def _hover(self, part: Part | None) -> None:
        if part != self.hovered:
            self.hovered = part
            self.setCursor(Qt.CursorShape.PointingHandCursor if part else Qt.CursorShape.ArrowCursor)
            self.update()

    # the look

    def paintEvent(self, event: QPaintEvent) -> None:
        """The ring on the ground, the cube, the way home."""
        painter = QPainter(self)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        from_above = self._axes[2][1] >= 0
        if from_above:
            self._paint_ring(painter)
        for face in sorted(faces(self._axes), key=lambda face: face.facing):
            self._paint_face(painter, face)
        if not from_above:
            self._paint_ring(painter)
        self._paint_home(painter)
        painter.end()

    def _polygon(self, corners: npt.NDArray[np.float64]) -> QPolygonF:
        return QPolygonF([_MIDDLE + QPointF(x, y) * _HALF for x, y in corners.tolist()])

    def _paint_face(self, painter: QPainter, face: Face) -> None:
        theme = self._theme
        ground = QColor(theme.raised).darker(round(100 + 22 * (1 - face.facing)))
        ground.setAlpha(238)
        outline = self._polygon(face.corners)
        painter.setPen(QPen(QColor(theme.border), 1))
        painter.setBrush(ground)
        painter.drawPolygon(outline)
        lit = False
        for field in face.fields:
            if field.way == self.hovered:
                painter.setPen(Qt.PenStyle.NoPen)
                painter.setBrush(QColor(theme.accent))
                painter.drawPolygon(self._polygon(field.corners))
                lit = field.way == face.way
        if face.facing < 0.16:  # too narrow to be read
            return
        letters = QPolygonF(QRectF(0, 0, _LETTERS, _LETTERS))
        letters.removeLast()
        turned = QTransform()
        if QTransform.quadToQuad(letters, outline, turned):
            painter.save()
            painter.setTransform(turned, True)
            font = QFont(self.font())
            font.setPixelSize(16)
            font.setBold(True)
            painter.setFont(font)
            ink = QColor(theme.on_accent if lit else theme.text)
            ink.setAlphaF(min(1.0, 0.35 + face.facing))
            painter.setPen(ink)
            painter.drawText(QRectF(0, 0, _LETTERS, _LETTERS), int(Qt.AlignmentFlag.AlignCenter), face.name)
            painter.restore()

    def _paint_ring(self, painter: QPainter) -> None:
        angle = np.linspace(0, 2 * np.pi, 49)
        ring = np.stack([_RING * np.sin(angle), np.full(49, _BELOW), _RING * np.cos(angle)], axis=1)
        spots = self._polygon(flat(self._axes, ring))
        painter.setBrush(Qt.BrushStyle.NoBrush)
        painter.setPen(QPen(QColor(0, 0, 0, 90), 3.2))
        painter.drawPolyline(spots)
        painter.setPen(QPen(QColor(255, 255, 255, 170), 1.4))
        painter.drawPolyline(spots)
        if self._sun is None:
            return
        level = self._sun * (1.0, 0.0, 1.0)
        length = float(np.linalg.norm(level))
        if length < 1e-3:  # straight from above
            return
        place = level / length * _RING + (0.0, _BELOW, 0.0)
        x, y = flat(self._axes, place[None])[0]
        at = _MIDDLE + QPointF(x, y) * _HALF
        painter.setPen(QPen(QColor(0, 0, 0, 120), 2.6))
        for ray in range(8):
            way = QPointF(np.cos(ray * np.pi / 4), np.sin(ray * np.pi / 4))
            painter.drawLine(at + way * 4.5, at + way * 7.5)
        painter.setPen(QPen(_SUN, 1.4))
        for ray in range(8):
            way = QPointF(np.cos(ray * np.pi / 4), np.sin(ray * np.pi / 4))
            painter.drawLine(at + way * 4.5, at + way * 7.5)
        painter.setPen(QPen(QColor(0, 0, 0, 120), 1))
        painter.setBrush(_SUN)
        painter.drawEllipse(at, 3.6, 3.6)

    def _paint_home(self, painter: QPainter) -> None:
        theme, lit = self._theme, self.hovered == "home"
        ground = QColor(theme.accent if lit else theme.raised)
        ground.setAlpha(255 if lit else 200)
        painter.setPen(Qt.PenStyle.NoPen)
        painter.setBrush(ground)
        painter.drawRoundedRect(_HOME, 5, 5)
        pen = QPen(QColor(theme.on_accent if lit else theme.text), 1.5)
        pen.setJoinStyle(Qt.PenJoinStyle.RoundJoin)
        pen.setCapStyle(Qt.PenCapStyle.RoundCap)
        painter.setPen(pen)
        painter.setBrush(Qt.BrushStyle.NoBrush)
        left, top = _HOME.left(), _HOME.top()
        roof = ((5, 11.5), (11, 6), (17, 11.5))
        walls = ((7, 10.5), (7, 16.5), (15, 16.5), (15, 10.5))
        for line in (roof, walls):
            painter.drawPolyline(QPolygonF([QPointF(left + x, top + y) for x, y in line]))


def told(way: Way) -> str:
    """`the top`, `the front right`: where a click looks from."""
    return f"the {spoken(way).lower()}"
