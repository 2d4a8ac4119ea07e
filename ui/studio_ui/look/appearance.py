"""How the window looks: theme, ground grid, which canvas; all of it remembered."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from functools import partial

from PySide6.QtCore import Qt
from PySide6.QtGui import QGuiApplication
from PySide6.QtWidgets import QApplication

from studio_ui.canvas.choice import PREFERENCES, CanvasChoice
from studio_ui.canvas.switch_viewport import SwitchViewport
from studio_ui.look.theme import DARK, LIGHT, THEMES, Theme, wear
from studio_ui.preferences.catalogue import SYSTEM
from studio_ui.preferences.store import Preferences


class Appearance:
    """`wearers` are told of another theme: whatever draws with its colours."""

    def __init__(self, preferences: Preferences, viewport: SwitchViewport, canvas: CanvasChoice) -> None:
        self.theme = DARK
        self._preferences, self._viewport, self._canvas = preferences, viewport, canvas
        self._wearers: list[Callable[[Theme], object]] = []
        self._off = [
            preferences.bind("theme", lambda _: self._dress()),
            preferences.bind("grid", viewport.set_grid),
            preferences.bind("canvas", self._follow_canvas),
        ]

    def handlers(self) -> dict[str, Callable[[], object]]:
        """By action id."""
        made: dict[str, Callable[[], object]] = {"view.grid": lambda: self.set_grid(not self.grid)}
        made |= {f"view.{name}": partial(self._preferences.set, "theme", name) for name in (SYSTEM, *THEMES)}
        made |= {f"view.canvas_{name}": partial(self._canvas.prefer, name) for name in PREFERENCES}
        return made

    def conditions(self) -> dict[str, Callable[[], bool]]:
        """What is checked, by name."""
        made: dict[str, Callable[[], bool]] = {"grid": lambda: self.grid}
        made |= {f"theme_{name}": partial(self._wears, name) for name in (SYSTEM, *THEMES)}
        made |= {f"canvas_{name}": partial(self._prefers, name) for name in PREFERENCES}
        return made

    def start(self, wearers: Iterable[Callable[[Theme], object]]) -> None:
        """As it was left."""
        self._wearers = list(wearers)
        QGuiApplication.styleHints().colorSchemeChanged.connect(self._system_changed)
        self._dress()
        self._viewport.set_grid(self.grid)

    def close(self) -> None:
        """Stop following."""
        for off in self._off:
            off()
        QGuiApplication.styleHints().colorSchemeChanged.disconnect(self._system_changed)

    @property
    def grid(self) -> bool:
        """Whether there are lines on the ground."""
        return bool(self._preferences.get("grid"))

    def set_grid(self, shown: bool) -> None:
        """Lines on the ground."""
        self._preferences.set("grid", shown)

    def _dress(self) -> None:
        """In the theme that is preferred."""
        wanted = self._preferences.get("theme")
        self.theme = theme = THEMES.get(wanted) or system_theme(QGuiApplication.styleHints().colorScheme())
        application = QApplication.instance()
        if isinstance(application, QApplication):
            wear(application, theme)
        for wearer in self._wearers:
            wearer(theme)

    def _system_changed(self, scheme: Qt.ColorScheme) -> None:
        if self._preferences.get("theme") == SYSTEM:
            self._dress()

    def _follow_canvas(self, preference: str) -> None:
        if self._canvas.preference != preference:
            self._canvas.prefer(preference)

    def _wears(self, name: str) -> bool:
        return bool(self._preferences.get("theme") == name)

    def _prefers(self, name: str) -> bool:
        return self._canvas.preference == name


def system_theme(scheme: Qt.ColorScheme) -> Theme:
    """The theme of the desktop's colour scheme; dark where it does not say."""
    return LIGHT if scheme is Qt.ColorScheme.Light else DARK
