"""What a screen reader would say of the controls of a window."""

from __future__ import annotations

from collections.abc import Iterator

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QAbstractButton, QLabel, QWidget

_INNER = ("qt_spinbox_lineedit", "qt_scrollarea_hcontainer", "qt_scrollarea_vcontainer")
"""Parts of Qt's own widgets, which the whole speaks for."""


def nameless(root: QWidget) -> list[str]:
    """The controls that Tab can reach and that nothing can be said of."""
    return [
        " < ".join(type(w).__name__ for w in (widget, widget.parentWidget()))
        for widget in _reached(root)
        if not _said(widget)
    ]


def _reached(root: QWidget) -> Iterator[QWidget]:
    for widget in root.findChildren(QWidget):
        own = widget.window() is root.window() and widget.objectName() not in _INNER
        if own and widget.focusPolicy() & Qt.FocusPolicy.TabFocus:
            yield widget


def _said(widget: QWidget) -> str:
    if widget.accessibleName():
        return widget.accessibleName()
    if isinstance(widget, QAbstractButton):
        action = getattr(widget, "defaultAction", lambda: None)()
        return widget.text() or (action.text() if action is not None else "")
    labels = widget.window().findChildren(QLabel)
    return next((label.text() for label in labels if label.buddy() is widget), "")
