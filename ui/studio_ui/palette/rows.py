"""How a row of the command palette is drawn: letters that were found in bold, the menu, the shortcut."""

from __future__ import annotations

from typing import TYPE_CHECKING

from PySide6.QtCore import QModelIndex, QPersistentModelIndex, QRect, QSize, Qt
from PySide6.QtGui import QColor, QFont, QPainter, QPalette
from PySide6.QtWidgets import QListView, QStyle, QStyledItemDelegate, QStyleOptionViewItem

if TYPE_CHECKING:
    from studio_ui.palette.palette import Entry

_PAD, _GAP = 8, 12


class RowDelegate(QStyledItemDelegate):
    """Rows of `Entry`; `entry` and `hits` are the roles under which the model has them."""

    def __init__(self, view: QListView, entry: int, hits: int) -> None:
        super().__init__(view)
        self._entry, self._hits = entry, hits

    def sizeHint(self, option: QStyleOptionViewItem, index: QModelIndex | QPersistentModelIndex) -> QSize:
        """One line with air."""
        return QSize(200, option.fontMetrics.height() + 12)

    def paint(
        self,
        painter: QPainter,
        option: QStyleOptionViewItem,
        index: QModelIndex | QPersistentModelIndex,
    ) -> None:
        """Background as in every list, then the texts."""
        entry: Entry = index.data(self._entry)
        hits: tuple[int, ...] = index.data(self._hits)
        widget = option.widget
        chosen = bool(option.state & QStyle.StateFlag.State_Selected)
        self.initStyleOption(option, index)
        option.text = ""
        widget.style().drawControl(QStyle.ControlElement.CE_ItemViewItem, option, painter, widget)
        colours = option.palette
        role = QPalette.ColorRole.HighlightedText if chosen else QPalette.ColorRole.Text
        text = colours.color(role)
        dim = text if chosen else colours.color(QPalette.ColorRole.PlaceholderText)
        area = option.rect.adjusted(_PAD, 0, -_PAD, 0)
        painter.save()
        area = self._right(painter, area, entry.shortcut, dim, option.font)
        mark = "✓ " if entry.checked else ""
        used = self._title(painter, area, mark, entry, hits, dim if entry.reason else text, option.font)
        rest = area.adjusted(used + _GAP, 0, 0, 0)
        told = entry.reason or entry.place
        painter.setPen(dim)
        painter.setFont(option.font)
        shown = painter.fontMetrics().elidedText(told, Qt.TextElideMode.ElideRight, max(rest.width(), 0))
        painter.drawText(rest, Qt.AlignmentFlag.AlignVCenter | Qt.AlignmentFlag.AlignLeft, shown)
        painter.restore()

    def _right(self, painter: QPainter, area: QRect, text: str, colour: QColor, font: QFont) -> QRect:
        """The shortcut at the right end; what is left of the area."""
        if not text:
            return area
        painter.setPen(colour)
        painter.setFont(font)
        painter.drawText(area, Qt.AlignmentFlag.AlignVCenter | Qt.AlignmentFlag.AlignRight, text)
        return area.adjusted(0, 0, -painter.fontMetrics().horizontalAdvance(text) - _GAP, 0)

    def _title(
        self,
        painter: QPainter,
        area: QRect,
        mark: str,
        entry: Entry,
        hits: tuple[int, ...],
        colour: QColor,
        font: QFont,
    ) -> int:
        """The title with its found letters in bold; how wide it is."""
        bold = QFont(font)
        bold.setBold(True)
        painter.setPen(colour)
        x = area.left()
        letters = [(letter, False) for letter in mark]
        letters += [(letter, number in hits) for number, letter in enumerate(entry.title)]
        for run, strong in _runs(letters):
            painter.setFont(bold if strong else font)
            wide = painter.fontMetrics().horizontalAdvance(run)
            box = QRect(x, area.top(), min(wide + 1, area.right() - x), area.height())
            painter.drawText(box, Qt.AlignmentFlag.AlignVCenter | Qt.AlignmentFlag.AlignLeft, run)
            x += wide
        return x - area.left()


def _runs(letters: list[tuple[str, bool]]) -> list[tuple[str, bool]]:
    """Letters of one kind beside each other as one text, so that they are spaced as type is."""
    made: list[tuple[str, bool]] = []
    for letter, strong in letters:
        if made and made[-1][1] == strong:
            made[-1] = (made[-1][0] + letter, strong)
        else:
            made.append((letter, strong))
    return made
