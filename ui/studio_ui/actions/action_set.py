"""The actions of one window as Qt's, made from the catalogue; menus and toolbar filled with them."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from PySide6.QtCore import Qt
from PySide6.QtGui import QAction, QActionGroup, QKeySequence
from PySide6.QtWidgets import QMenu, QMenuBar, QToolBar, QWidget

from studio_ui.actions.catalogue import ACTIONS, specs
from studio_ui.actions.spec import REASONS, ActionSpec
from studio_ui.features import Condition, Handler
from studio_ui.look.icons import icon
from studio_ui.look.theme import Theme
from studio_ui.shortcuts import Shortcuts


class ActionSet:
    """The actions of one window; `refresh` asks the conditions again."""

    def __init__(
        self,
        owner: QWidget,
        canvas: QWidget,
        handlers: Mapping[str, Handler],
        conditions: Mapping[str, Condition],
        done: Callable[[], object] = lambda: None,
        shortcuts: Shortcuts | None = None,
    ) -> None:
        """`done` is called after an action. ValueError when handlers, conditions and actions do not match."""
        _match("handler", {spec.id for spec in specs()}, set(handlers))
        _match("condition", {name for spec in specs() for name in _asked(spec)}, set(conditions))
        self.actions: dict[str, QAction] = {}
        self.menus: dict[str, QMenu] = {}
        self._conditions, self._done, self._shortcuts = conditions, done, shortcuts
        groups: dict[str, QActionGroup] = {}
        for spec in specs():
            action = self.actions[spec.id] = self._make(spec, owner, handlers[spec.id])
            if spec.canvas:
                action.setShortcutContext(Qt.ShortcutContext.WidgetWithChildrenShortcut)
                canvas.addAction(action)
            else:
                owner.addAction(action)
            if spec.group:
                groups.setdefault(spec.group, QActionGroup(owner)).addAction(action)
        self.label()
        if shortcuts is not None:
            shortcuts.changed.connect(self.label)

    def _make(self, spec: ActionSpec, owner: QWidget, handler: Handler) -> QAction:
        action = QAction(spec.text, owner)
        action.setStatusTip(spec.tip)
        action.setCheckable(spec.checkable)
        action.setIconVisibleInMenu(not spec.checkable)  # there the check mark tells

        def run(checked: bool = False) -> None:
            handler()
            self._done()

        action.triggered.connect(run)
        return action

    def __getitem__(self, name: str) -> QAction:
        return self.actions[name]

    def refresh(self) -> None:
        """Enable what can be done now, and check what is on."""
        known = {name: condition() for name, condition in self._conditions.items()}
        for spec in specs():
            if spec.enabled:
                self.actions[spec.id].setEnabled(known[spec.enabled])
            if spec.checked:
                self.actions[spec.id].setChecked(known[spec.checked])

    def label(self) -> None:
        """Keys as they are now, in menus and tooltips."""
        for spec in specs():
            keys = self._shortcuts.of(spec.id) if self._shortcuts is not None else spec.shortcut
            action = self.actions[spec.id]
            action.setShortcut(QKeySequence(keys))
            told = f" ({action.shortcut().toString(QKeySequence.SequenceFormat.NativeText)})" if keys else ""
            action.setToolTip(f"{spec.text.rstrip('…')}{told}" + (f"\n{spec.tip}" if spec.tip else ""))

    def reasons(self) -> dict[QAction, tuple[str, str]]:
        """Every action's id, and what is told while it is disabled."""
        return {self.actions[s.id]: (s.id, REASONS.get(s.enabled, "")) for s in specs()}

    def fill_menus(self, bar: QMenuBar) -> None:
        """Menus in the order of the actions."""
        line = False
        last = ""
        for spec in ACTIONS:
            if spec is None:
                line = True
                continue
            top = spec.menu.split("/")[0]
            if line and top == last:
                self.menus[top].addSeparator()
            line, last = False, top
            self.menu(bar, spec.menu).addAction(self.actions[spec.id])

    def menu(self, bar: QMenuBar, path: str) -> QMenu:
        """The menu of that path, made when it is first asked for."""
        if path not in self.menus:
            above, _, name = path.rpartition("/")
            parent = self.menu(bar, above) if above else bar
            # top menus open by Alt and their first letter
            self.menus[path] = parent.addMenu(name if above else f"&{name}")
        return self.menus[path]

    def fill_bar(self, bar: QToolBar) -> None:
        """The actions of the toolbar; a line wherever the menus have one or change."""
        last: str | None = None
        line = False
        for spec in ACTIONS:
            line = line or spec is None
            if spec is None or not spec.bar:
                continue
            if last is not None and (line or last != spec.menu):
                bar.addSeparator()
            bar.addAction(self.actions[spec.id])
            last, line = spec.menu, False

    def set_theme(self, theme: Theme) -> None:
        """Icons in the theme's colour."""
        for spec in specs():
            if spec.icon:
                self.actions[spec.id].setIcon(icon(spec.icon, theme.text, theme.on_accent))


def _asked(spec: ActionSpec) -> list[str]:
    return [name for name in (spec.enabled, spec.checked) if name]


def _match(kind: str, wanted: set[str], found: set[str]) -> None:
    """Nothing is missing, and nothing is left over."""
    if wanted - found:
        raise ValueError(f"no {kind} for {', '.join(sorted(wanted - found))}")
    if found - wanted:
        raise ValueError(f"a {kind} for nothing: {', '.join(sorted(found - wanted))}")
