"""The toolbar: actions at the left, how the picture is seen at the right."""

from __future__ import annotations

from PySide6.QtWidgets import QSizePolicy, QToolBar, QToolButton, QWidget

from studio_ui.actions.action_set import ActionSet
from studio_ui.look.icons import icon
from studio_ui.look.theme import Theme


class Toolbar(QToolBar):
    """What does not fit is behind a button at the right end."""

    def __init__(self, actions: ActionSet, controls: QWidget) -> None:
        super().__init__("Toolbar")
        self.setObjectName("toolbar")
        self.setMovable(False)
        actions.fill_bar(self)
        room = QWidget()
        room.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Preferred)
        self.addWidget(room)
        self.addWidget(controls)

    def set_theme(self, theme: Theme) -> None:
        """The button for the rest, which Qt draws in no theme's colour."""
        rest = self.findChild(QToolButton, "qt_toolbar_ext_button")
        if isinstance(rest, QToolButton):
            rest.setIcon(icon("more", theme.text))
            rest.setToolTip("More")
            rest.setAccessibleName("More of the toolbar")
