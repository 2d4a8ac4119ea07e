"""Preferences as a feature of the window: the dialog, the palette's entries, and what follows them."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from PySide6.QtWidgets import QWidget

from studio_ui.forms.number_style import NumberStyle, set_number_style
from studio_ui.palette.palette import Entry
from studio_ui.preferences.catalogue import ALL, KEYS, SYSTEM
from studio_ui.preferences.store import Preferences
from studio_ui.shortcuts import Shortcuts
from studio_ui.tasks import Tasks

if TYPE_CHECKING:
    from studio_ui.preferences.dialog import PreferencesDialog


class PreferencesFeature:
    """Opens the dialog over a window and dresses the window's numbers."""

    def __init__(
        self, window: QWidget, preferences: Preferences, shortcuts: Shortcuts, tasks: Tasks, cache: Path
    ) -> None:
        self._window, self._preferences = window, preferences
        self._shortcuts, self._tasks, self._cache = shortcuts, tasks, cache
        self._dialog: PreferencesDialog | None = None
        for name in ("length_unit", "decimal_mark"):
            preferences.bind(name, lambda _: self.dress_numbers())

    def handlers(self) -> dict[str, Callable[[], object]]:
        """By action id."""
        return {"edit.preferences": self.open, "edit.keys": partial(self.open, page=KEYS)}

    def conditions(self) -> dict[str, Callable[[], bool]]:
        """None."""
        return {}

    def open(self, *, page: str = "", name: str = "") -> PreferencesDialog:
        """Show the dialog, at a page or at a preference."""
        from studio_ui.preferences.dialog import PreferencesDialog  # not needed to start

        if self._dialog is None:
            self._dialog = PreferencesDialog(
                self._window, self._preferences, self._shortcuts, self._tasks, self._cache
            )
            self._dialog.finished.connect(lambda _: self._forget())
        if page:
            self._dialog.show_page(page)
        self._dialog.show()
        self._dialog.raise_()
        self._dialog.activateWindow()
        if name:
            self._dialog.show_preference(name)
        return self._dialog

    def entries(self) -> Iterator[Entry]:
        """Every preference, for the command palette."""
        for preference in ALL:
            run = partial(self.open, name=preference.name)
            place = f"Preferences ▸ {preference.page}"
            yield Entry(
                f"preference.{preference.name}", preference.info.label, place, run, hint=preference.info.doc
            )

    def dress_numbers(self) -> None:
        """Numbers of the window in the preferred unit."""
        mark = self._preferences.get("decimal_mark")
        unit = self._preferences.get("length_unit")
        set_number_style(self._window, NumberStyle(unit, "" if mark == SYSTEM else mark))

    def _forget(self) -> None:
        self._dialog = None
