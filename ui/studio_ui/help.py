"""The Help menu: keys and mouse, plugins, about."""

from __future__ import annotations

from collections.abc import Callable, Iterable

from PySide6.QtWidgets import QMessageBox, QWidget

from studio_core import __version__
from studio_ui.actions.catalogue import specs
from studio_ui.actions.mouse import MOUSE
from studio_ui.context import Context
from studio_ui.dialogs import KeysDialog
from studio_ui.plugins.dialog import PluginsDialog
from studio_ui.settings import Settings
from studio_ui.shortcuts import Shortcuts, shown


class Help:
    """Windows that tell about the program."""

    def __init__(
        self,
        parent: QWidget,
        context: Context,
        settings: Settings,
        shortcuts: Shortcuts,
        looking: Callable[[], Iterable[tuple[str, str]]],
    ) -> None:
        """`looking` tells what the mouse does to the view."""
        self._parent, self._context, self._looking = parent, context, looking
        self._settings, self._shortcuts = settings, shortcuts

    def handlers(self) -> dict[str, Callable[[], object]]:
        """By action id."""
        return {"help.keys": self.keys, "help.plugins": self.plugins, "help.about": self.about}

    def conditions(self) -> dict[str, Callable[[], bool]]:
        """None."""
        return {}

    def keys(self) -> None:
        """What mouse and keys do."""
        own = ((spec.text.rstrip("…"), shown(self._shortcuts.of(spec.id))) for spec in specs())
        keys = [(what, how) for what, how in own if how]
        KeysDialog(self._parent, [*MOUSE, *self._looking(), *keys]).open()

    def plugins(self) -> None:
        """What is loaded and what failed."""
        context = self._context
        PluginsDialog(self._parent, context.host, self._settings, context.tasks).open()

    def about(self) -> None:
        """Which version this is."""
        text = f"<b>Lucarne {__version__}</b><p>Furnish and light rooms truthfully.</p>"
        QMessageBox.about(self._parent, "About Lucarne", text)
