"""In the status bar: how many problems and warnings nobody has looked at; a click shows them."""

from __future__ import annotations

from collections.abc import Callable

from PySide6.QtWidgets import QToolButton

from studio_ui.context import Subscriptions
from studio_ui.journal import Journal
from studio_ui.look.role import set_role


class Badge(QToolButton):
    """Hidden while there is nothing to look at."""

    def __init__(self, journal: Journal, show_log: Callable[[], object]) -> None:
        super().__init__()
        self._journal = journal
        self.setAutoRaise(True)
        self.setToolTip("Show the log")
        self.clicked.connect(lambda: show_log())
        self._subscriptions = Subscriptions()
        self._subscriptions.add(
            journal.added.connect(lambda _: self.refresh()), journal.seen.connect(self.refresh)
        )
        self.refresh()

    def close_panel(self) -> None:
        """Stop listening."""
        self._subscriptions.close()

    def refresh(self) -> None:
        """Count them."""
        problems, warnings = self._journal.unseen("problem"), self._journal.unseen("warning")
        parts = [
            f"{count} {what}{'s' * (count > 1)}"
            for count, what in ((problems, "problem"), (warnings, "warning"))
            if count
        ]
        self.setText(", ".join(parts))
        self.setAccessibleName(f"{self.text()}: show the log" if parts else "Show the log")
        set_role(self, "problem" if problems else "warning")
        self.setVisible(bool(parts))
