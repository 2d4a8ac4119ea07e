"""How the library's rows are painted: a ball over its name, headings across, a sign where one is broken."""

from __future__ import annotations

from collections.abc import Callable

from PySide6.QtCore import QModelIndex, QPersistentModelIndex, QPoint, QRect, QRectF, QSize, Qt
from PySide6.QtGui import QColor, QFont, QFontMetrics, QIcon, QPainter, QPalette, QPen, QTextLayout
from PySide6.QtWidgets import QLineEdit, QStyle, QStyledItemDelegate, QStyleOptionViewItem, QWidget

from studio_core.library.shelf import Entry
from studio_ui.library.model import ROW, Row
from studio_ui.look.theme import DARK

BALL = 56
"""Logical pixels across a ball."""
_PAD, _LINES = 4, 2
_NARROWEST = BALL + 20
_Index = QModelIndex | QPersistentModelIndex


class Cells(QStyledItemDelegate):
    """`picture(entry)` is asked for what is seen alone. Cells share the width `across` evenly.

    Where there is room for one column only, names stand beside their balls.
    """

    def __init__(self, parent: QWidget, picture: Callable[[Entry], QIcon]) -> None:
        super().__init__(parent)
        self.theme = DARK
        self.across = 3 * _NARROWEST
        self._picture = picture

    @property
    def columns(self) -> int:
        """How many balls are beside each other."""
        return max(1, self.across // _NARROWEST)

    def sizeHint(self, option: QStyleOptionViewItem, index: _Index) -> QSize:
        """Headings and remarks take a row of their own."""
        row: Row = index.data(ROW)
        metrics: QFontMetrics = option.fontMetrics
        if row.title:
            return QSize(self.across, metrics.height() + 12)
        if row.note:
            box = metrics.boundingRect(QRect(0, 0, self.across - 4 * _PAD, 10_000), _WRAPPED, row.note)
            return QSize(self.across, box.height() + 2 * _PAD)
        if self.columns == 1:
            return QSize(self.across, BALL + 2 * _PAD)
        return QSize(self.across // self.columns, BALL + 3 * _PAD + _LINES * metrics.height())

    def paint(self, painter: QPainter, option: QStyleOptionViewItem, index: _Index) -> None:
        """One row."""
        row: Row = index.data(ROW)
        box: QRect = option.rect
        painter.save()
        if row.entry is not None:
            self._material(painter, option, box, row.entry)
        elif row.title:
            self._heading(painter, box, row)
        else:
            painter.setPen(QColor(self.theme.dim))
            painter.drawText(box.adjusted(2 * _PAD, 0, -2 * _PAD, 0), _WRAPPED, row.note)
        painter.restore()

    def updateEditorGeometry(self, editor: QWidget, option: QStyleOptionViewItem, index: _Index) -> None:
        """Over the name."""
        words = self._words(option.rect)
        high = editor.sizeHint().height()
        top = words.center().y() - high // 2 if self.columns == 1 else words.top()
        editor.setGeometry(QRect(words.left(), top, words.width(), high))

    def createEditor(self, parent: QWidget, option: QStyleOptionViewItem, index: _Index) -> QWidget:
        """A line for the name."""
        made = QLineEdit(parent)
        made.setAccessibleName("Name of the material")
        return made

    def shown(self, entry: Entry) -> QIcon:
        """The picture of an entry as it is now."""
        return self._picture(entry)

    def ball(self, box: QRect) -> QRect:
        """Where the ball is in a cell."""
        if self.columns == 1:
            return QRect(box.left() + _PAD, box.top() + _PAD, BALL, BALL)
        return QRect(box.left() + (box.width() - BALL) // 2, box.top() + _PAD, BALL, BALL)

    def _words(self, box: QRect) -> QRect:
        if self.columns == 1:
            return box.adjusted(BALL + 3 * _PAD, _PAD, -_PAD, -_PAD)
        return box.adjusted(_PAD, BALL + 2 * _PAD, -_PAD, -_PAD)

    def _heading(self, painter: QPainter, box: QRect, row: Row) -> None:
        font = QFont(painter.font())
        font.setBold(True)
        line = box.adjusted(2 * _PAD, 4, -2 * _PAD, 0)
        middle = int(Qt.AlignmentFlag.AlignLeft | Qt.AlignmentFlag.AlignVCenter)
        painter.setPen(QColor(self.theme.text))
        painter.setFont(font)
        painter.drawText(line, middle, row.title)
        wide = painter.fontMetrics().horizontalAdvance(row.title)
        font.setBold(False)
        painter.setFont(font)
        painter.setPen(QColor(self.theme.dim))
        if row.count:
            painter.drawText(line.adjusted(wide + 8, 0, 0, 0), middle, str(row.count))

    def _material(self, painter: QPainter, option: QStyleOptionViewItem, box: QRect, entry: Entry) -> None:
        widget: QWidget = option.widget
        state: QStyle.StateFlag = option.state
        palette: QPalette = option.palette
        widget.style().drawPrimitive(QStyle.PrimitiveElement.PE_PanelItemViewItem, option, painter, widget)
        chosen = bool(state & QStyle.StateFlag.State_Selected)
        place = self.ball(box)
        if entry.kept is not None:
            self._picture(entry).paint(painter, place)
        else:
            self._broken(painter, place, palette.highlightedText().color() if chosen else None)
        if chosen:
            painter.setPen(palette.highlightedText().color())
        else:
            painter.setPen(QColor(self.theme.text if entry.kept is not None else self.theme.dim))
        one = self.columns == 1
        across = Qt.AlignmentFlag.AlignLeft if one else Qt.AlignmentFlag.AlignHCenter
        _name(painter, self._words(box), entry.name, across, middle=one)

    def _broken(self, painter: QPainter, place: QRect, colour: QColor | None) -> None:
        pen = QPen(colour or QColor(self.theme.problem), 1.6)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        pen.setStyle(Qt.PenStyle.DashLine)
        painter.setPen(pen)
        painter.drawEllipse(QRectF(place).adjusted(10, 10, -10, -10))
        font = QFont(painter.font())
        font.setPixelSize(26)
        font.setBold(True)
        before = painter.font()
        painter.setFont(font)
        painter.drawText(place, int(Qt.AlignmentFlag.AlignCenter), "!")
        painter.setFont(before)


_WRAPPED = int(Qt.AlignmentFlag.AlignLeft | Qt.AlignmentFlag.AlignVCenter) | int(Qt.TextFlag.TextWordWrap)


def name_lines(text: str, metrics: QFontMetrics, font: QFont, width: int) -> list[str]:
    """A name in at most two lines; what is longer ends in an ellipsis."""
    layout = QTextLayout(text, font)
    layout.beginLayout()
    lines: list[str] = []
    while len(lines) < _LINES:
        line = layout.createLine()
        if not line.isValid():
            break
        line.setLineWidth(width)
        start = line.textStart()
        last = len(lines) == _LINES - 1
        lines.append(text[start:] if last else text[start : start + line.textLength()].rstrip())
    layout.endLayout()
    return [metrics.elidedText(line, Qt.TextElideMode.ElideRight, width) for line in lines]


def _name(painter: QPainter, box: QRect, text: str, across: Qt.AlignmentFlag, *, middle: bool) -> None:
    metrics = painter.fontMetrics()
    lines = name_lines(text, metrics, painter.font(), box.width())
    top = box.top() if not middle else box.center().y() - len(lines) * metrics.height() // 2
    for number, line in enumerate(lines):
        at = QRect(QPoint(box.left(), top + number * metrics.height()), QSize(box.width(), metrics.height()))
        painter.drawText(at, int(across | Qt.AlignmentFlag.AlignVCenter), line)


__all__ = ["BALL", "Cells", "name_lines"]
