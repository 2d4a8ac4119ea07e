"""Panels of third-party plugins: made when they are first shown, so that the start waits for nobody."""

from __future__ import annotations

from PySide6.QtGui import QShowEvent
from PySide6.QtWidgets import QDockWidget, QWidget

from studio_core.contract import PanelMaker
from studio_core.errors import PluginError
from studio_ui.context import Context
from studio_ui.layout import THIRD_PARTY
from studio_ui.panels.panel import Panel, note


class PluginPanel(Panel):
    """The place of a panel: a plugin's widget, or a sentence that says why there is none."""

    def __init__(self, context: Context, name: str) -> None:
        super().__init__(context)
        self.name, self.id = name, f"{THIRD_PARTY}{name}"
        self.title = name.replace("_", " ").capitalize()
        self.widget: QWidget | None = None
        self._tried = False

    def showEvent(self, event: QShowEvent) -> None:
        """Now it is needed."""
        super().showEvent(event)
        if not self._tried:
            self._tried = True
            self._fill()

    def _fill(self) -> None:
        context = self.context
        plugin = context.host.provider("panel", self.name)
        try:
            maker: PanelMaker = context.host.get("panel", self.name)
            made = maker.make(context)
            if not isinstance(made, QWidget):
                raise PluginError(f"its panel is a {type(made).__name__}, not a widget")
        except (Exception, SystemExit) as error:
            if not isinstance(error, PluginError) or "failed to load" not in str(error):
                context.host.report(plugin.id, f"panel {self.name!r} could not be made", error)
            told = f"The panel “{self.title}” of the plugin {plugin.label or plugin.id} did not work."
            context.journal.problem(told, PluginError(f"{told} Help ▸ Plugins says why."))
            self.column.addWidget(note(f"{told} Help ▸ Plugins says why."))
            self.column.addStretch(1)
            return
        self.widget = made
        self.column.addWidget(made, 1)
        dock = self.parentWidget()
        if isinstance(dock, QDockWidget):
            dock.setWindowTitle(str(maker.title))


def plugin_panels(context: Context) -> list[PluginPanel]:
    """One for each panel that plugins offer."""
    return [PluginPanel(context, name) for name in context.host.names("panel")]
