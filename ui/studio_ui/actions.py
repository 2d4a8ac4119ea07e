"""Everything the window can be told to do, as data; menus, toolbar and the list of keys are made from it."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass

from PySide6.QtCore import Qt
from PySide6.QtGui import QAction, QActionGroup, QKeySequence
from PySide6.QtWidgets import QMenu, QMenuBar, QToolBar, QWidget

from studio_ui.icons import icon
from studio_ui.theme import Theme


@dataclass(frozen=True)
class ActionSpec:
    """One action: `menu` is a path (`Edit`, `View/Look from`), `enabled` the name of a condition.

    `canvas` limits the shortcut to the picture; actions of one `group` exclude each other; `bar` puts it on
    the toolbar.
    """

    id: str
    text: str
    menu: str
    shortcut: str = ""
    icon: str = ""
    enabled: str = ""
    canvas: bool = False
    bar: bool = False
    group: str = ""
    checkable: bool = False


def _a(id: str, text: str, menu: str, shortcut: str = "", **more: object) -> ActionSpec:
    return ActionSpec(id, text, menu, shortcut, **more)  # type: ignore[arg-type]


SEPARATOR = None
ACTIONS: tuple[ActionSpec | None, ...] = (
    _a("file.new", "New", "File", "Ctrl+N", icon="new"),
    _a("file.open", "Open…", "File", "Ctrl+O", icon="open", bar=True),
    _a("file.save", "Save", "File", "Ctrl+S", icon="save", bar=True, enabled="savable"),
    _a("file.save_as", "Save as…", "File", "Ctrl+Shift+S"),
    SEPARATOR,
    _a("file.import", "Import model…", "File", "Ctrl+I", icon="import", bar=True),
    _a("file.environment", "Load environment…", "File", icon="environment"),
    SEPARATOR,
    _a("file.export_picture", "Export picture…", "File", "Ctrl+E", icon="picture", enabled="picture"),
    _a("file.export_glb", "Export scene as GLB…", "File"),
    _a("file.export_mitsuba", "Export scene for Mitsuba…", "File"),
    SEPARATOR,
    _a("file.quit", "Quit", "File", "Ctrl+Q"),
    _a("edit.undo", "Undo", "Edit", "Ctrl+Z", icon="undo", bar=True, enabled="undo"),
    _a("edit.redo", "Redo", "Edit", "Ctrl+Shift+Z", icon="redo", bar=True, enabled="redo"),
    SEPARATOR,
    _a("edit.duplicate", "Duplicate", "Edit", "Ctrl+D", icon="duplicate", enabled="selection"),
    _a("edit.delete", "Delete", "Edit", "Delete", icon="delete", enabled="selection"),
    SEPARATOR,
    _a("edit.select_all", "Select all", "Edit", "Ctrl+A"),
    _a("edit.select_none", "Select nothing", "Edit", "Ctrl+Shift+A", enabled="selection"),
    _a("tool.select", "Select", "Object", "Q", icon="select", bar=True, group="tool", canvas=True),
    _a("tool.move", "Move", "Object", "W", icon="move", bar=True, group="tool", canvas=True),
    _a("tool.rotate", "Rotate", "Object", "Shift+R", icon="rotate", bar=True, group="tool", canvas=True),
    SEPARATOR,
    _a("object.drop", "Drop to floor", "Object", "End", icon="drop", bar=True, enabled="movable"),
    _a("object.left", "Nudge left", "Object/Nudge", "Left", canvas=True, enabled="movable"),
    _a("object.right", "Nudge right", "Object/Nudge", "Right", canvas=True, enabled="movable"),
    _a("object.away", "Nudge away", "Object/Nudge", "Up", canvas=True, enabled="movable"),
    _a("object.near", "Nudge closer", "Object/Nudge", "Down", canvas=True, enabled="movable"),
    _a("object.up", "Nudge up", "Object/Nudge", "PgUp", canvas=True, enabled="movable"),
    _a("object.down", "Nudge down", "Object/Nudge", "PgDown", canvas=True, enabled="movable"),
    _a("object.turn_left", "Turn left 15°", "Object/Nudge", ",", canvas=True, enabled="movable"),
    _a("object.turn_right", "Turn right 15°", "Object/Nudge", ".", canvas=True, enabled="movable"),
    SEPARATOR,
    _a("object.group", "Group", "Object", "Ctrl+G", enabled="selection"),
    _a("object.ungroup", "Ungroup", "Object", "Ctrl+Shift+G", enabled="group"),
    _a("object.hide", "Hide", "Object", "H", enabled="selection", canvas=True),
    _a("object.show_all", "Show all", "Object", "Alt+H", canvas=True),
    _a("object.lock", "Lock", "Object", "Ctrl+L", enabled="selection"),
    _a("view.frame_selection", "Frame selection", "View", "F", icon="frame", bar=True, canvas=True),
    _a("view.frame_all", "Frame all", "View", "Home", canvas=True),
    SEPARATOR,
    _a("view.front", "Front", "View/Look from", "1", canvas=True),
    _a("view.back", "Back", "View/Look from", "Ctrl+1", canvas=True),
    _a("view.right", "Right", "View/Look from", "3", canvas=True),
    _a("view.left", "Left", "View/Look from", "Ctrl+3", canvas=True),
    _a("view.top", "Top", "View/Look from", "7", canvas=True),
    _a("view.bottom", "Bottom", "View/Look from", "Ctrl+7", canvas=True),
    _a("view.new_camera", "New camera from view", "View", "Ctrl+Alt+0", icon="camera"),
    _a("view.aim_camera", "Set chosen camera to view", "View", enabled="camera"),
    SEPARATOR,
    _a("view.brighter", "Brighter", "View", "+", canvas=True),
    _a("view.darker", "Darker", "View", "-", canvas=True),
    _a("view.grid", "Ground grid", "View", "G", canvas=True, checkable=True),
    _a("view.canvas_auto", "Automatic", "View/Canvas", group="canvas"),
    _a("view.canvas_gpu", "Graphics card", "View/Canvas", group="canvas"),
    _a("view.canvas_software", "Software", "View/Canvas", group="canvas"),
    _a("view.dark", "Dark theme", "View/Theme", group="theme"),
    _a("view.light", "Light theme", "View/Theme", group="theme"),
    SEPARATOR,
    _a("shade.again", "Compute again", "View", "F5"),
    _a("shade.cancel", "Stop computing", "View", "Shift+F5", enabled="computing"),
    _a("window.reset", "Reset layout", "Window"),
    _a("help.keys", "Keys and mouse", "Help", "F1"),
    _a("help.plugins", "Plugins", "Help"),
    _a("help.about", "About Lucarne", "Help"),
)  # fmt: skip
"""In the order of the menus; None is a line between actions."""

TIPS = {
    "file.new": "An empty project",
    "file.open": "Open a project",
    "file.save": "Save the project",
    "file.import": "Add furniture from a file",
    "file.environment": "Light from an HDR picture",
    "edit.duplicate": "A copy beside it; the mesh is shared",
    "tool.select": "Choose only; a drag looks around",
    "tool.move": "Drag what is chosen over the floor; Shift up and down; Ctrl in steps of 5 cm",
    "tool.rotate": "Drag what is chosen to turn it; Ctrl in steps of 15°",
    "object.drop": "Let what is chosen stand on the floor",
    "object.group": "Hold what is chosen together",
    "object.lock": "Not picked or moved in the picture",
    "view.frame_selection": "See all of what is chosen (or everything)",
    "view.grid": "Lines on the ground: decimetres, metres, ten metres",
    "view.canvas_auto": "The graphics card where there is one",
    "view.canvas_gpu": "Draw the picture with OpenGL",
    "view.canvas_software": "Draw the picture without the graphics card",
    "view.brighter": "Half an EV more exposure",
    "view.darker": "Half an EV less exposure",
}
"""What an action does, where its name does not say it all."""

MOUSE = (
    ("Choose", "Click; Ctrl+click adds"),
    ("Choose a part of a group", "Double-click; Esc leaves the group"),
    ("Look around", "Left drag on what is not chosen, or Alt+left drag, or middle drag"),
    ("Slide the view", "Right drag, or Shift+middle drag"),
    ("Zoom to the cursor", "Wheel"),
    ("Move what is chosen", "Left drag on it; Shift up and down; Ctrl in 5 cm steps; Esc cancels"),
    ("Turn what is chosen", "R held and left drag, or the Rotate tool; Ctrl in 15° steps"),
    ("Turn the light", "Shift+right drag"),
)


def specs() -> Iterator[ActionSpec]:
    """All actions without the lines between them."""
    return (spec for spec in ACTIONS if spec is not None)


class ActionSet:
    """The actions of one window; `refresh` asks the conditions again."""

    def __init__(
        self,
        owner: QWidget,
        canvas: QWidget,
        handlers: Mapping[str, Callable[[], object]],
        conditions: Mapping[str, Callable[[], bool]],
    ) -> None:
        self.actions: dict[str, QAction] = {}
        self.menus: dict[str, QMenu] = {}
        self._conditions = conditions
        groups: dict[str, QActionGroup] = {}
        for spec in specs():
            action = QAction(spec.text, owner)
            if spec.shortcut:
                action.setShortcut(QKeySequence(spec.shortcut))
            keys = f" ({spec.shortcut})" if spec.shortcut else ""
            tip = TIPS.get(spec.id, "")
            action.setToolTip(f"{spec.text.rstrip('…')}{keys}" + (f"\n{tip}" if tip else ""))
            action.setStatusTip(tip)
            handler = handlers[spec.id]
            action.triggered.connect(lambda checked=False, run=handler: run())
            if spec.canvas:
                action.setShortcutContext(Qt.ShortcutContext.WidgetWithChildrenShortcut)
                canvas.addAction(action)
            else:
                owner.addAction(action)
            action.setCheckable(bool(spec.group) or spec.checkable)
            if spec.group:
                action.setIconVisibleInMenu(False)  # there the check mark tells
                groups.setdefault(spec.group, QActionGroup(owner)).addAction(action)
            self.actions[spec.id] = action

    def __getitem__(self, name: str) -> QAction:
        return self.actions[name]

    def refresh(self) -> None:
        """Enable what can be done now."""
        known = {name: condition() for name, condition in self._conditions.items()}
        for spec in specs():
            if spec.enabled:
                self.actions[spec.id].setEnabled(known[spec.enabled])

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
            self.menus[path] = parent.addMenu(name)
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
