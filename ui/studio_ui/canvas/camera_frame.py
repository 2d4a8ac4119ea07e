"""Over the picture while one looks through a camera: its frame, what lies outside dimmed, and its name."""

from __future__ import annotations

from PySide6.QtCore import QPointF, QRectF, Qt
from PySide6.QtGui import QColor, QPainter, QPainterPath, QPaintEvent, QPen
from PySide6.QtWidgets import QWidget

from studio_ui.canvas.framing import frame_in
from studio_ui.look.theme import DARK, Theme

_OUTSIDE = QColor(0, 0, 0, 90)
_LINE = QColor(255, 255, 255, 190)
_GROUND = QColor(20, 20, 20, 175)
_WORDS = QColor("#ececea")


class CameraFrame(QWidget):
    """Fills the canvas; not in the way of the mouse. Hidden while there is nothing to frame."""

    def __init__(self) -> None:
        super().__init__()
        self.aspect = 1.0
        self.text = ""
        self.kept = False
        self._theme = DARK
        self.setAttribute(Qt.WidgetAttribute.WA_TransparentForMouseEvents)
        self.hide()

    def show_frame(self, aspect: float, text: str, *, kept: bool) -> None:
        """The frame of a camera, and what is said of it; `kept` when it goes along with the view."""
        self.aspect, self.text, self.kept = aspect, text, kept
        self.update()
        self.show()

    def set_theme(self, theme: Theme) -> None:
        """Colours of another theme."""
        self._theme = theme
        self.update()

    def frame(self) -> QRectF:
        """Logical pixels."""
        return QRectF(*frame_in(self.aspect, self.width(), self.height()))

    def paintEvent(self, event: QPaintEvent) -> None:
        """Shade outside, line, words."""
        painter = QPainter(self)
        frame = self.frame()
        outside = QPainterPath()
        outside.setFillRule(Qt.FillRule.OddEvenFill)
        outside.addRect(QRectF(self.rect()))
        outside.addRect(frame)
        painter.fillPath(outside, _OUTSIDE)
        painter.setPen(QPen(QColor(self._theme.accent) if self.kept else _LINE, 1))
        painter.drawRect(frame.adjusted(0.5, 0.5, -0.5, -0.5))
        metrics = painter.fontMetrics()
        room = max(int(frame.width()) - 40, 24)
        text = metrics.elidedText(self.text, Qt.TextElideMode.ElideRight, room)
        box = QRectF(frame.topLeft() + QPointF(12, 12), frame.topLeft() + QPointF(12, 36))
        box.setWidth(metrics.horizontalAdvance(text) + 20)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        painter.setPen(Qt.PenStyle.NoPen)
        painter.setBrush(_GROUND)
        painter.drawRoundedRect(box, 12, 12)
        painter.setPen(QColor("#f0c078") if self.kept else _WORDS)
        painter.drawText(box, int(Qt.AlignmentFlag.AlignCenter), text)
        painter.end()
