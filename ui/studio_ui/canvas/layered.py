"""What lies over the canvas: bars at its lower edge, and what fills it (start page, what a drop would do)."""

from __future__ import annotations

from PySide6.QtCore import QEvent, QObject, QSize
from PySide6.QtGui import QResizeEvent
from PySide6.QtWidgets import QWidget

_MARGIN, _GAP = 10, 6
_BOTTOM = 44  # above the badge that says how fresh the picture is


class Layered(QWidget):
    """A canvas with widgets over it that take nothing of its room. Later fillers lie above earlier ones."""

    def __init__(self, canvas: QWidget) -> None:
        super().__init__()
        self._canvas = canvas
        self._fillers: list[QWidget] = []
        self._bars: list[QWidget] = []
        canvas.setParent(self)
        self.setFocusProxy(canvas)
        self.setMinimumSize(canvas.minimumSizeHint().expandedTo(QSize(160, 120)))

    def fill(self, widget: QWidget) -> None:
        """Cover all of the canvas whenever the widget is shown."""
        self._fillers.append(widget)
        self._take(widget)

    def bar(self, widget: QWidget) -> None:
        """A bar below the earlier ones, over all fillers, as high as it wants."""
        self._bars.append(widget)
        self._take(widget)

    def sizeHint(self) -> QSize:
        """What the canvas would like."""
        return self._canvas.sizeHint()

    def resizeEvent(self, event: QResizeEvent) -> None:
        """Everything follows."""
        self._place()

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        """Bars move when one of them comes, goes or changes its height."""
        if event.type() in (QEvent.Type.ShowToParent, QEvent.Type.HideToParent, QEvent.Type.LayoutRequest):
            self._place()
        return False

    def _take(self, widget: QWidget) -> None:
        widget.setParent(self)  # which hides it
        widget.installEventFilter(self)
        for bar in self._bars:
            bar.raise_()
        self._place()

    def _place(self) -> None:
        self._canvas.setGeometry(self.rect())
        for widget in self._fillers:
            widget.setGeometry(self.rect())
        bottom, width = self.height() - _BOTTOM, max(self.width() - 2 * _MARGIN, 0)
        for widget in reversed(self._bars):
            if widget.isHidden():
                continue
            across = min(width, max(widget.sizeHint().width(), widget.minimumWidth()))
            height = widget.heightForWidth(across) if widget.hasHeightForWidth() else -1
            height = height if height > 0 else widget.sizeHint().height()
            widget.setGeometry((self.width() - across) // 2, bottom - height, across, height)
            bottom -= height + _GAP
