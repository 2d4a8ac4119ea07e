"""How the window looks: theme, ground grid, which canvas; all of it remembered."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from functools import partial

from PySide6.QtWidgets import QApplication

from studio_ui.canvas.choice import PREFERENCES, CanvasChoice
from studio_ui.canvas.switch_viewport import SwitchViewport
from studio_ui.settings import Settings
from studio_ui.theme import DARK, THEMES, Theme, wear


class Appearance:
    """`wearers` are told of another theme: whatever draws with its colours."""

    def __init__(self, settings: Settings, viewport: SwitchViewport, canvas: CanvasChoice) -> None:
        self.theme = DARK
        self.grid = False
        self._settings, self._viewport, self._canvas = settings, viewport, canvas
        self._wearers: list[Callable[[Theme], object]] = []

    def handlers(self) -> dict[str, Callable[[], object]]:
        """By action id."""
        made: dict[str, Callable[[], object]] = {"view.grid": lambda: self.set_grid(not self.grid)}
        made |= {f"view.{name}": partial(self.set_theme, theme) for name, theme in THEMES.items()}
        made |= {f"view.canvas_{name}": partial(self._canvas.prefer, name) for name in PREFERENCES}
        return made

    def conditions(self) -> dict[str, Callable[[], bool]]:
        """What is checked, by name."""
        made: dict[str, Callable[[], bool]] = {"grid": lambda: self.grid}
        made |= {f"theme_{name}": partial(self._wears, name) for name in THEMES}
        made |= {f"canvas_{name}": partial(self._prefers, name) for name in PREFERENCES}
        return made

    def start(self, wearers: Iterable[Callable[[Theme], object]]) -> None:
        """As it was left."""
        self._wearers = list(wearers)
        self.set_theme(THEMES.get(self._settings.get("theme", DARK.name), DARK))
        self.set_grid(self._settings.get("grid", False))

    def set_grid(self, shown: bool) -> None:
        """Lines on the ground."""
        self.grid = shown
        self._settings.set("grid", shown)
        self._viewport.set_grid(shown)

    def set_theme(self, theme: Theme) -> None:
        """Another theme."""
        self.theme = theme
        self._settings.set("theme", theme.name)
        application = QApplication.instance()
        if isinstance(application, QApplication):
            wear(application, theme)
        for wearer in self._wearers:
            wearer(theme)

    def _wears(self, name: str) -> bool:
        return self.theme.name == name

    def _prefers(self, name: str) -> bool:
        return self._canvas.preference == name
