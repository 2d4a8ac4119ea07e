"""Lighting: a shelf of environments, all lights in a list, and what the chosen ones are like."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path

from PySide6.QtCore import QTimer
from PySide6.QtGui import QPaintEvent
from PySide6.QtWidgets import QMenu, QPushButton, QToolButton

from studio_core.copies import duplicate
from studio_core.edits import Add, Compound, Remove, SetFields
from studio_core.scene.diff import Changes
from studio_core.scene.nodes import Environment, Light, NodeId, Scene, new_id
from studio_ui.context import Context
from studio_ui.forms.node_sink import NodeSink
from studio_ui.look.theme import Theme
from studio_ui.panels.environment_shelf import EnvironmentShelf
from studio_ui.panels.lamps import LAMPS
from studio_ui.panels.light_form import NodeForm
from studio_ui.panels.light_list import LightList
from studio_ui.panels.node_kinds import kinds_name
from studio_ui.panels.panel import Panel, clear, heading, note, row
from studio_ui.panels.properties import shared_infos
from studio_ui.panels.shelf_list import ShelfList


class LightingPanel(Panel):
    """Every light in a list; the chosen ones' parameters below."""

    id = "lighting"
    title = "Lighting"

    def __init__(
        self,
        context: Context,
        shelf: EnvironmentShelf,
        load: Callable[[], object],
        ask_folder: Callable[[str], Path | None],
    ) -> None:
        super().__init__(context)
        self.lights: tuple[NodeId, ...] = ()
        self.shelf = shelf
        self.form: NodeForm | None = None
        self._sink = NodeSink(context, lambda: self.lights)
        self._ask_folder = ask_folder
        self._soloed: NodeId | None = None
        self._before_solo: dict[NodeId, bool] = {}
        everything = self.scroller()
        everything.addWidget(heading("Environment"))
        self.environments = ShelfList(shelf)
        everything.addWidget(self.environments)
        self.load = QPushButton("Load…")
        self.load.setToolTip(
            "A picture of the light all around: EXR or HDR, twice as wide as high, or a cube"
        )
        self.load.clicked.connect(lambda: load())
        folder = QPushButton("Add folder…")
        folder.setToolTip("List the EXR and HDR pictures of a folder here")
        folder.clicked.connect(self._add_folder)
        everything.addLayout(row(self.load, folder))
        everything.addWidget(heading("Lights"))
        self.list = LightList()
        self.list.switched = self.switch
        self.list.soloed = self.solo
        self.list.chosen = self._chosen
        self.list.renamed = self._rename
        everything.addWidget(self.list)
        everything.addLayout(row(*self._buttons()))
        self._column = self.inside(everything)
        everything.addStretch(1)
        self._listed: object = None
        self._built: object = self
        self._soon = QTimer(self)
        self._soon.setSingleShot(True)
        self._soon.timeout.connect(self.refresh)
        self._seen = QTimer(self)
        self._seen.setSingleShot(True)
        self._seen.timeout.connect(shelf.start)
        self.subscriptions.add(
            context.document.changed.connect(self._edited),
            context.session.selected.connect(self._selected),
            shelf.changed.connect(self.environments.refresh),
            shelf.close,
        )
        self.refresh()

    def _buttons(self) -> list[QToolButton]:
        add = QToolButton()
        add.setText("Add lamp")
        add.setToolTip("A new lamp above the middle of the scene")
        add.setPopupMode(QToolButton.ToolButtonPopupMode.InstantPopup)
        menu = QMenu(add)
        for text, make in LAMPS.items():
            menu.addAction(text, partial(self.add_lamp, text, make))
        add.setMenu(menu)
        copy = self.tool("duplicate", "Duplicate the chosen lamps")
        remove = self.tool("delete", "Delete the chosen lights")
        copy.clicked.connect(self.copy)
        remove.clicked.connect(self.remove)
        return [add, copy, remove]

    def set_theme(self, theme: Theme) -> None:
        """Icons of another theme."""
        super().set_theme(theme)
        self._listed = None
        self.environments.set_theme(theme)
        self.refresh()

    def paintEvent(self, event: QPaintEvent) -> None:
        """The shelf is filled when somebody first looks at it (tabs are shown before they can be seen)."""
        super().paintEvent(event)
        self._seen.start(0)

    def refresh(self) -> None:
        """Show the scene's lights as they are now."""
        scene = self.context.document.scene
        lights = sorted(scene.of(Light), key=lambda light: not isinstance(light, Environment))
        solo = self._solo_now(scene)
        listed = ([(light.id, light.name, light.hidden, type(light)) for light in lights], solo)
        if listed != self._listed:
            self._listed = listed
            self.list.show_lights(lights, solo, self.theme)
        self.lights = tuple(light for light in self.lights if light in scene.nodes)
        if not self.lights and lights:
            self.lights = (lights[0].id,)
        if self.list.selected != self.lights:
            self.list.select_lights(self.lights)
        self._show(scene)

    # the choice

    def _edited(self, before: Scene, after: Scene, changes: Changes) -> None:
        if any(isinstance(scene.nodes.get(n), Light) for n in changes.nodes for scene in (before, after)):
            self._soon.start(0)

    def _selected(self) -> None:
        scene = self.context.document.scene
        lights = tuple(n for n in self.context.session.selection if isinstance(scene.nodes.get(n), Light))
        if lights and lights != self.lights:
            self.lights = lights
            self.refresh()

    def _chosen(self, lights: tuple[NodeId, ...]) -> None:
        if lights:
            self.lights = lights
            self._show(self.context.document.scene)
            self.context.session.select(lights)

    def _show(self, scene: Scene) -> None:
        lights = [scene[light] for light in self.lights]
        key = (self.lights, tuple(type(light) for light in lights))
        if key != self._built:
            self._built = key
            self._sink.commit()
            clear(self._column)
            self.form = None
            if lights:
                if len(lights) > 1:
                    self._column.addWidget(note(f"What is set counts for all {kinds_name(lights)}."))
                self.form = NodeForm(type(lights[-1]), shared_infos(lights), self._sink)
                self._column.addWidget(self.form)
            else:
                self._column.addWidget(note("The scene has no light: load an environment or add a lamp."))
        if self.form is not None and lights:
            self.form.show_nodes(scene, lights)

    # edits

    def add_lamp(self, name: str, make: Callable[[NodeId, str, Scene], Light]) -> None:
        """A lamp above the middle of the scene, chosen."""
        scene = self.context.document.scene
        taken = {node.name for node in scene.nodes.values()}
        free = next(n for n in (name, *(f"{name} {i}" for i in range(2, 10**6))) if n not in taken)
        lamp = make(new_id("lamp"), free, scene)
        if self.context.editing.apply(Add((lamp,), label=f"Add {name.lower()}")):
            self.context.session.select([lamp.id])
            self.refresh()

    def copy(self) -> None:
        """The chosen lamps once more, beside them."""
        scene = self.context.document.scene
        lamps = tuple(n for n in self.lights if not isinstance(scene[n], Environment))
        if not lamps:
            self.context.journal.write("There is one environment at a time: choose a lamp to duplicate.")
            return
        edit = duplicate(scene, lamps)
        if self.context.editing.apply(edit):
            self.context.session.select(node.id for node in edit.nodes)

    def remove(self) -> None:
        """Delete the chosen lights."""
        scene = self.context.document.scene
        if self.lights:
            nodes = [scene[light] for light in self.lights]
            what = nodes[0].name if len(nodes) == 1 else kinds_name(nodes)
            self.context.editing.apply(Remove(self.lights, f"Delete {what}"))

    def switch(self, light: NodeId, on: bool) -> None:
        """On or off."""
        node = self.context.document.scene[light]
        if node.hidden is on:
            label = f"Switch {node.name} {'on' if on else 'off'}"
            self.context.editing.apply(SetFields(light, {"hidden": not on}, label))

    def solo(self, light: NodeId) -> None:
        """Only this light; a second time brings the others back as they were."""
        scene = self.context.document.scene
        lights = list(scene.of(Light))
        name = scene[light].name
        if self._solo_now(scene) == light:
            label, before = f"All lights besides {name}", self._before_solo
            hidden = {other.id: before.get(other.id, False) for other in lights}
        else:
            if self._solo_now(scene) is None:
                self._before_solo = {other.id: other.hidden for other in lights}
            label, hidden = f"Only {name}", {other.id: other.id != light for other in lights}
            self._soloed = light
        edits = tuple(SetFields(n, {"hidden": value}) for n, value in hidden.items())
        self.context.editing.apply(Compound(label, edits))

    def _solo_now(self, scene: Scene) -> NodeId | None:
        """The light that was made the only one, while it is."""
        on = [light.id for light in scene.of(Light) if not light.hidden]
        return self._soloed if on == [self._soloed] and self._before_solo.keys() - {self._soloed} else None

    def _rename(self, light: NodeId, name: str) -> None:
        old = self.context.document.scene[light].name
        if name and name != old:
            self.context.editing.apply(SetFields(light, {"name": name}, f"Rename {old}"))
        elif not name:
            self._listed = None
            self._soon.start(0)

    def _add_folder(self) -> None:
        folder = self._ask_folder("Folder with environments")
        if folder is not None:
            self.shelf.add_folder(folder)
