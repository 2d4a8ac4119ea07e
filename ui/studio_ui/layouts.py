"""Window ▸ Layouts: panels as furnishing or lighting wants them, none at all, and the person's own."""

from __future__ import annotations

import base64
from collections.abc import Callable
from functools import partial

from PySide6.QtCore import QByteArray
from PySide6.QtGui import QAction
from PySide6.QtWidgets import QMenu

from studio_ui.ask import Ask
from studio_ui.layout import Layout
from studio_ui.settings import Settings

_KEY = "layouts"
BUILT_IN: dict[str, tuple[tuple[str, ...], tuple[str, ...]]] = {
    "furnish": (
        ("outliner", "library", "history", "jobs", "log", "properties", "materials", "cameras"),
        ("outliner", "history", "properties"),
    ),
    "light": (
        ("outliner", "jobs", "log", "cameras", "lighting", "materials", "shading"),
        ("outliner", "jobs", "lighting"),
    ),
}
"""Panels that are shown, and which of them are in front."""


class Layouts:
    """Named layouts of one window."""

    def __init__(self, layout: Layout, settings: Settings, ask: Ask) -> None:
        self._layout, self._settings, self._ask = layout, settings, ask
        self._own: list[QAction] = []

    def handlers(self) -> dict[str, Callable[[], object]]:
        """By action id."""
        made: dict[str, Callable[[], object]] = {
            f"window.{name}": partial(self._layout.arrange, *panels) for name, panels in BUILT_IN.items()
        }
        made["window.picture_only"] = self._layout.toggle_picture_only
        made["window.save_layout"] = self.save
        return made

    def conditions(self) -> dict[str, Callable[[], bool]]:
        """Whether the picture is alone."""
        return {"picture_only": lambda: self._layout.picture_only}

    @property
    def names(self) -> list[str]:
        """The person's own layouts."""
        return sorted(self._stored())

    def save(self) -> None:
        """Keep the panels as they are now under a name; a name that is there is replaced."""
        name = self._ask.text("Save layout", "Name of the layout", "My layout")
        if name is not None and name.strip():
            state = base64.b64encode(self._layout.state().data()).decode()
            self._settings.set(_KEY, {**self._stored(), name.strip(): state})

    def use(self, name: str) -> None:
        """One of the person's own."""
        stored = self._stored().get(name)
        if stored is not None:
            self._layout.set_state(QByteArray.fromBase64(stored.encode()))

    def delete(self, name: str) -> None:
        """Forget one."""
        self._settings.set(_KEY, {n: state for n, state in self._stored().items() if n != name})

    def offer(self, menu: QMenu) -> None:
        """The person's own below the others, whenever the menu shows."""
        menu.aboutToShow.connect(lambda: self.fill(menu))
        self.fill(menu)

    def fill(self, menu: QMenu) -> None:
        """Put them there."""
        for action in self._own:
            menu.removeAction(action)
            action.deleteLater()
        self._own = []
        if not self.names:
            return
        self._own.append(menu.addSeparator())
        for name in self.names:
            self._own.append(menu.addAction(name, partial(self.use, name)))
        remove = QMenu("Delete layout", menu)
        for name in self.names:
            remove.addAction(name, partial(self.delete, name))
        self._own.append(menu.addMenu(remove))

    def _stored(self) -> dict[str, str]:
        found = self._settings.get(_KEY, {})
        return {name: state for name, state in found.items() if isinstance(state, str)}
