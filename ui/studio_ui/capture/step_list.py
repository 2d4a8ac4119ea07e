"""The steps in a list with marks and lines; where there is little room, a choice of one line."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from PySide6.QtCore import QModelIndex, QPersistentModelIndex, QRect, QSignalBlocker, QSize, Qt
from PySide6.QtGui import QColor, QPainter, QPen
from PySide6.QtWidgets import (
    QListWidget,
    QListWidgetItem,
    QStackedWidget,
    QStyle,
    QStyledItemDelegate,
    QStyleOptionViewItem,
    QToolButton,
    QVBoxLayout,
    QWidget,
)

from studio_ui.capture.telling import STEPS, Told
from studio_ui.forms.fields import Combo
from studio_ui.look.theme import DARK, Theme
from studio_ui.panels.panel import row

SIGNS = {"done": "✓", "warning": "!", "error": "×", "working": "…", "waiting": "·"}
WORDS = {
    "done": "done",
    "warning": "has something to look at",
    "error": "did not work",
    "working": "at work",
    "waiting": "waiting",
}
_TOLD = Qt.ItemDataRole.UserRole
_PAD, _SIGN = 7, 20  # pixels


class StepList(QStackedWidget):
    """`chosen(id)` when the person goes to another step."""

    def __init__(self) -> None:
        super().__init__()
        self.chosen: Callable[[str], object] = lambda step: None
        self.theme = DARK
        self._told: Mapping[str, Told] = {}
        self.list = QListWidget()
        self.list.setAccessibleName("Steps of the capture")
        self.list.setItemDelegate(_StepDelegate(self))
        self.list.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        for step in STEPS:
            item = QListWidgetItem(step.title)
            item.setData(_TOLD, Told("waiting"))
            self.list.addItem(item)
        self.list.currentRowChanged.connect(self._went)
        self.combo = Combo()
        self.combo.setAccessibleName("Step of the capture")
        self.combo.addItems([step.title for step in STEPS])
        self.combo.activated.connect(self._went)
        self.back, self.next = _arrow("‹", "Previous step"), _arrow("›", "Next step")
        self.back.clicked.connect(lambda: self._by(-1))
        self.next.clicked.connect(lambda: self._by(1))
        small = QWidget()
        column = QVBoxLayout(small)
        column.setContentsMargins(0, 0, 0, 0)
        column.addLayout(row(self.back, self.combo, self.next, stretch=1))
        self.addWidget(self.list)
        self.addWidget(small)
        self._fit()

    def set_theme(self, theme: Theme) -> None:
        """Another theme."""
        self.theme = theme
        self.list.viewport().update()

    def set_small(self, small: bool) -> None:
        """One line, or a list."""
        self.setCurrentIndex(int(small))
        self._fit()

    def _fit(self) -> None:
        if self.currentIndex() == 1:
            self.setFixedHeight(self.combo.sizeHint().height() + 4)
        else:
            self.setFixedHeight(self.list.sizeHintForRow(0) * len(STEPS) + 4)

    def show_step(self, step: str) -> None:
        """The step that is worked on."""
        index = [s.id for s in STEPS].index(step)
        with QSignalBlocker(self.list):
            self.list.setCurrentRow(index)
        self.combo.setCurrentIndex(index)
        self.back.setEnabled(index > 0)
        self.next.setEnabled(index + 1 < len(STEPS))

    def tell(self, told: Mapping[str, Told]) -> None:
        """Marks and lines."""
        if told == self._told:
            return
        self._told = dict(told)
        for index, step in enumerate(STEPS):
            found = told[step.id]
            item = self.list.item(index)
            item.setData(_TOLD, found)
            item.setToolTip("\n".join([found.line, *found.warnings]).strip())
            said = f"{step.title}: {WORDS[found.mark]}. {found.line}"
            item.setData(Qt.ItemDataRole.AccessibleTextRole, said)
            self.combo.setItemText(index, f"{SIGNS[found.mark]}  {step.title}")

    def _by(self, step: int) -> None:
        self._went(self.combo.currentIndex() + step)

    def _went(self, index: int) -> None:
        if 0 <= index < len(STEPS):
            self.chosen(STEPS[index].id)


class _StepDelegate(QStyledItemDelegate):
    """Sign, title, and the line below it."""

    def __init__(self, owner: StepList) -> None:
        super().__init__(owner)
        self._owner = owner

    def sizeHint(self, option: QStyleOptionViewItem, index: QModelIndex | QPersistentModelIndex) -> QSize:
        """Two lines."""
        return QSize(120, 2 * option.fontMetrics.height() + _PAD)

    def paint(
        self, painter: QPainter, option: QStyleOptionViewItem, index: QModelIndex | QPersistentModelIndex
    ) -> None:
        """As the theme has it."""
        theme, told = self._owner.theme, index.data(_TOLD)
        chosen = bool(option.state & QStyle.StateFlag.State_Selected)
        box = QRect(option.rect)
        painter.save()
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        if chosen:
            painter.fillRect(box, QColor(theme.accent))
        elif option.state & QStyle.StateFlag.State_MouseOver:
            painter.fillRect(box, QColor(theme.raised))
        text, dim = (theme.on_accent, theme.on_accent) if chosen else (theme.text, theme.dim)
        done = "#5fae5a" if theme.name == "dark" else "#35802f"
        colours = {"done": done, "warning": theme.warning, "error": theme.problem}
        sign = QColor(theme.on_accent if chosen else colours.get(told.mark, theme.dim))
        ring = QRect(box.left() + 4, box.top() + (box.height() - 16) // 2, 16, 16)
        painter.setPen(QPen(sign, 1.4))
        painter.drawEllipse(ring)
        painter.drawText(ring, Qt.AlignmentFlag.AlignCenter, SIGNS[told.mark])
        inner = box.adjusted(_SIGN + 8, _PAD // 2, -4, -_PAD // 2)
        upper = QRect(inner.left(), inner.top(), inner.width(), inner.height() // 2)
        lower = QRect(inner.left(), upper.bottom() + 1, inner.width(), inner.height() - upper.height())
        metrics = option.fontMetrics
        painter.setPen(QColor(text))
        where = upper if told.line else inner
        painter.drawText(where, Qt.AlignmentFlag.AlignVCenter, str(index.data()))
        painter.setPen(QColor(dim))
        line = metrics.elidedText(told.line, Qt.TextElideMode.ElideRight, lower.width())
        painter.drawText(lower, Qt.AlignmentFlag.AlignVCenter, line)
        if option.state & QStyle.StateFlag.State_HasFocus:
            painter.setPen(QPen(QColor(theme.text), 1, Qt.PenStyle.DotLine))
            painter.drawRect(box.adjusted(1, 1, -2, -2))
        painter.restore()


def _arrow(text: str, tip: str) -> QToolButton:
    made = QToolButton()
    made.setText(text)
    made.setToolTip(tip)
    made.setAccessibleName(tip)
    return made
