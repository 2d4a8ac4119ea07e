"""Cards with a picture, a name and a line or two; and shelves that lay them out in rows."""

from __future__ import annotations

from collections.abc import Sequence

from PySide6.QtCore import QPointF, QRectF, QSize, Qt
from PySide6.QtGui import QColor, QImage, QPainter, QPainterPath, QPaintEvent, QPen, QResizeEvent
from PySide6.QtWidgets import QAbstractButton, QToolButton, QWidget

from studio_ui.look.icons import icon
from studio_ui.look.theme import DARK, Theme

WIDTH, PICTURE = 196, 110
_PAD, _GAP, _RADIUS = 8, 14, 6


class Card(QAbstractButton):
    """A button that shows a picture. A `faded` card cannot be pressed; what stands on it can be."""

    def __init__(
        self, title: str, lines: Sequence[str], image: QImage | None, *, faded: bool = False
    ) -> None:
        super().__init__()
        self.lines, self.image, self.faded = tuple(lines), image, faded
        self._theme = DARK
        self.setText(title)
        self.setAccessibleName(", ".join((title, *lines)))
        self.setToolTip("\n".join((title, *lines)))
        self.setCursor(Qt.CursorShape.ArrowCursor if faded else Qt.CursorShape.PointingHandCursor)
        self.setFocusPolicy(Qt.FocusPolicy.NoFocus if faded else Qt.FocusPolicy.StrongFocus)
        self.setAttribute(Qt.WidgetAttribute.WA_Hover)
        self._corner: QToolButton | None = None
        self.setFixedSize(self.sizeHint())

    def corner(self, tip: str) -> QToolButton:
        """A small button in the card's upper corner, made once."""
        if self._corner is None:
            button = QToolButton(self)
            button.setObjectName("corner")
            button.setToolTip(tip)
            button.setAccessibleName(f"{tip}: {self.text()}")
            button.setFixedSize(24, 24)
            button.move(self.width() - 28, 4)
            button.setIcon(icon("cancel", "#f2f2f0"))
            self._corner = button
        return self._corner

    def set_theme(self, theme: Theme) -> None:
        """Colours."""
        self._theme = theme
        self.update()

    def sizeHint(self) -> QSize:
        """The picture and the lines under it."""
        line = self.fontMetrics().height()
        return QSize(WIDTH, PICTURE + 2 * _PAD + line * (1 + len(self.lines)))

    def hitButton(self, position: object) -> bool:
        """Faded cards do nothing."""
        return not self.faded

    def paintEvent(self, event: QPaintEvent) -> None:
        """The picture cut to fill its place, the words elided."""
        theme, painter = self._theme, QPainter(self)
        painter.setRenderHints(QPainter.RenderHint.Antialiasing | QPainter.RenderHint.SmoothPixmapTransform)
        frame = QRectF(self.rect()).adjusted(1, 1, -1, -1)
        path = QPainterPath()
        path.addRoundedRect(frame, _RADIUS, _RADIUS)
        painter.fillPath(path, QColor(theme.raised))
        place = QRectF(frame.left(), frame.top(), frame.width(), PICTURE)
        painter.save()
        painter.setClipPath(path)
        self._paint_picture(painter, place)
        painter.restore()
        bright = (self.underMouse() or self.hasFocus()) and not self.faded
        painter.setPen(QPen(QColor(theme.accent if bright else theme.border), 2 if self.hasFocus() else 1))
        painter.drawPath(path)
        metrics = self.fontMetrics()
        top = place.bottom() + _PAD
        room = frame.width() - 2 * _PAD
        for number, text in enumerate((self.text(), *self.lines)):
            font = self.font()
            font.setBold(number == 0)
            painter.setFont(font)
            painter.setPen(QColor(theme.text if number == 0 and not self.faded else theme.dim))
            middle = Qt.TextElideMode.ElideMiddle if number else Qt.TextElideMode.ElideRight
            shown = painter.fontMetrics().elidedText(text, middle, int(room))
            line = QRectF(frame.left() + _PAD, top, room, metrics.height())
            painter.drawText(line, int(Qt.AlignmentFlag.AlignVCenter), shown)
            top += metrics.height()

    def _paint_picture(self, painter: QPainter, place: QRectF) -> None:
        painter.fillRect(place, QColor(self._theme.canvas))
        if self.image is None:
            pen = QPen(QColor(self._theme.dim), 1.4)
            painter.setPen(pen)
            middle = place.center()
            painter.drawRoundedRect(QRectF(middle.x() - 22, middle.y() - 16, 44, 32), 3, 3)
            painter.drawPolyline(
                [middle + QPointF(*at) for at in ((-22, 10), (-8, -4), (4, 8), (10, 2), (22, 12))]
            )
            return
        if self.faded:
            painter.setOpacity(0.3)
        size = self.image.size()
        scale = max(place.width() / size.width(), place.height() / size.height())
        wide, high = place.width() / scale, place.height() / scale
        source = QRectF((size.width() - wide) / 2, (size.height() - high) / 2, wide, high)
        painter.drawImage(place, self.image, source)


class Shelf(QWidget):
    """Cards in rows, as many beside each other as there is room for."""

    def __init__(self) -> None:
        super().__init__()
        self.cards: list[Card] = []

    def put(self, cards: Sequence[Card]) -> None:
        """Other cards instead."""
        for card in self.cards:
            card.hide()
            card.deleteLater()
        self.cards = list(cards)
        for card in self.cards:
            card.setParent(self)
            card.show()
        self._place()

    def hasHeightForWidth(self) -> bool:
        """Narrower is higher."""
        return True

    def heightForWidth(self, width: int) -> int:
        """For all rows."""
        if not self.cards:
            return 0
        rows = -(-len(self.cards) // self._columns(width))
        high = max(card.height() for card in self.cards)
        return rows * high + (rows - 1) * _GAP

    def sizeHint(self) -> QSize:
        """One row of four."""
        return QSize(4 * WIDTH + 3 * _GAP, self.heightForWidth(max(self.width(), WIDTH)))

    def minimumSizeHint(self) -> QSize:
        """One card beside another would be too much to ask for."""
        return QSize(WIDTH, self.heightForWidth(max(self.width(), WIDTH)))

    def resizeEvent(self, event: QResizeEvent) -> None:
        """Lay out again."""
        self._place()

    def _columns(self, width: int) -> int:
        return max(1, (width + _GAP) // (WIDTH + _GAP))

    def _place(self) -> None:
        columns = self._columns(self.width())
        high = max((card.height() for card in self.cards), default=0)
        for index, card in enumerate(self.cards):
            row, column = divmod(index, columns)
            card.move(column * (WIDTH + _GAP), row * (high + _GAP))
        self.setFixedHeight(self.heightForWidth(self.width()))
