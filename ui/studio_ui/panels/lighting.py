"""Lighting: the environment's picture and how it is turned, tinted and shown; lamps."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
import numpy.typing as npt
from PySide6.QtCore import QSignalBlocker, QSize, QTimer
from PySide6.QtGui import QImage, QPixmap
from PySide6.QtWidgets import QCheckBox, QLabel, QListWidget, QListWidgetItem, QMenu, QPushButton, QToolButton

from studio_core.edits import Add, Edit, Remove, SetFields
from studio_core.kernels.tonemap import tonemap
from studio_core.params import Value, param_infos
from studio_core.scene.diff import Changes
from studio_core.scene.geometry import Image
from studio_core.scene.nodes import (
    AreaLamp,
    DirectionalLamp,
    Environment,
    Light,
    NodeId,
    PointLamp,
    Scene,
    SpotLamp,
    new_id,
)
from studio_core.scene.transform import Transform, looking, vec3
from studio_ui.canvas.projection import bounds
from studio_ui.context import Context
from studio_ui.icons import icon
from studio_ui.panels.node_kinds import kind_icon
from studio_ui.panels.panel import Panel, clear, note, row
from studio_ui.param_form import ParamForm
from studio_ui.sinks import EditSink
from studio_ui.theme import Theme

_PREVIEW = (264, 132)
_SUN_FROM = (0.5, 0.8, 0.4)


class LightingPanel(Panel):
    """Every light in a list; the chosen one's parameters below."""

    id = "lighting"
    title = "Lighting"

    def __init__(self, context: Context, load: Callable[[], object]) -> None:
        super().__init__(context)
        self.light: NodeId | None = None
        self._sink = EditSink(context.editing, self._make, self._label)
        self.form: ParamForm | None = None
        self.preview = QLabel()
        self.preview.setMinimumHeight(20)
        self.load = QPushButton("Load environment…")
        self.load.setToolTip(
            "A picture of the light all around: EXR or HDR, twice as wide as high, or a cube"
        )
        self.load.clicked.connect(lambda: load())
        self.list = QListWidget()
        self.list.setIconSize(QSize(18, 18))
        self.list.setMaximumHeight(120)
        self.list.currentItemChanged.connect(lambda item, _: self._chosen(item))
        self.add = QToolButton()
        self.add.setText("Add lamp")
        self.add.setPopupMode(QToolButton.ToolButtonPopupMode.InstantPopup)
        menu = QMenu(self.add)
        for text, make in LAMPS.items():
            menu.addAction(text, partial(self.add_lamp, text, make))
        self.add.setMenu(menu)
        remove = self.tool("delete", "Delete the light")
        remove.clicked.connect(self._remove)
        self.column.addWidget(self.load)
        self.column.addWidget(self.preview)
        self.column.addWidget(self.list)
        self.column.addLayout(row(self.add, remove))
        self._column = self.scroller()
        self._lights: list[tuple[NodeId, str, bool]] = []
        self._image: Image | None = None
        self._built: object = self
        self._soon = QTimer(self)
        self._soon.setSingleShot(True)
        self._soon.timeout.connect(self.refresh)
        self.subscriptions.add(
            context.document.changed.connect(self._edited), context.session.selected.connect(self._selected)
        )
        self.refresh()

    def set_theme(self, theme: Theme) -> None:
        """Icons of another theme."""
        super().set_theme(theme)
        self._lights = []
        self.refresh()

    def refresh(self) -> None:
        """Show the scene's lights as they are now."""
        scene = self.context.document.scene
        lights = sorted(scene.of(Light), key=lambda light: not isinstance(light, Environment))
        rows = [(light.id, light.name, light.hidden) for light in lights]
        if rows != self._lights:
            self._lights = rows
            with QSignalBlocker(self.list):
                self.list.clear()
                for light in lights:
                    text = f"{light.name} (off)" if light.hidden else light.name
                    item = QListWidgetItem(
                        icon(kind_icon(light), self.theme.text, selected=self.theme.on_accent), text
                    )
                    item.setData(256, light.id)
                    self.list.addItem(item)
        if self.light not in scene.nodes:
            self.light = rows[0][0] if rows else None
        index = next((i for i, (node, _, _) in enumerate(rows) if node == self.light), -1)
        with QSignalBlocker(self.list):
            self.list.setCurrentRow(index)
        self._show_picture(next((e for e in lights if isinstance(e, Environment)), None))
        self._show(scene)

    def add_lamp(self, name: str, make: Callable[[NodeId, str, Scene], Light]) -> None:
        """A lamp above the middle of the scene, chosen."""
        scene = self.context.document.scene
        taken = {node.name for node in scene.nodes.values()}
        free = next(n for n in (name, *(f"{name} {i}" for i in range(2, 10**6))) if n not in taken)
        lamp = make(new_id("lamp"), free, scene)
        if self.context.editing.apply(Add((lamp,), label=f"Add {name.lower()}")):
            self.light = lamp.id
            self.context.session.select([lamp.id])
            self.refresh()

    def _edited(self, before: Scene, after: Scene, changes: Changes) -> None:
        if any(isinstance(scene.nodes.get(n), Light) for n in changes.nodes for scene in (before, after)):
            self._soon.start(0)

    def _selected(self) -> None:
        for node in self.context.session.selection:
            if any(node == light for light, _, _ in self._lights):
                self.light = node
                self.refresh()
                return

    def _chosen(self, item: QListWidgetItem | None) -> None:
        self.light = item.data(256) if item is not None else None
        self._show(self.context.document.scene)
        if self.light is not None:
            self.context.session.select([self.light])

    def _show(self, scene: Scene) -> None:
        light = scene.nodes.get(self.light) if self.light is not None else None
        key = (self.light, type(light))
        if key != self._built:
            self._built = key
            self._sink.commit()
            clear(self._column)
            self.form = None
            if isinstance(light, Light):
                self._on = QCheckBox("On")
                self._on.toggled.connect(lambda on: self._switch(on))
                self._column.addWidget(self._on)
                self.form = ParamForm(param_infos(type(light)), self._sink, skip=("locked", "hidden"))
                self._column.addWidget(self.form)
            else:
                self._column.addWidget(note("The scene has no light: load an environment or add a lamp."))
            self._column.addStretch(1)
        if self.form is not None and light is not None:
            self.form.show_values({name: getattr(light, name) for name in self.form.fields})
            with QSignalBlocker(self._on):
                self._on.setChecked(not light.hidden)

    def _show_picture(self, environment: Environment | None) -> None:
        image = environment.image if environment is not None else None
        if image is self._image:
            return
        self._image = image
        if image is None:
            self.preview.hide()
            return
        pixels = tonemap(thumbnail(image, *_PREVIEW))
        height, width = pixels.shape[:2]
        picture = QImage(pixels.tobytes(), width, height, 3 * width, QImage.Format.Format_RGB888)
        self.preview.setPixmap(QPixmap.fromImage(picture))
        self.preview.show()

    def _switch(self, on: bool) -> None:
        if self.light is not None:
            name = self.context.document.scene[self.light].name
            label = f"Switch {name} {'on' if on else 'off'}"
            self.context.editing.apply(SetFields(self.light, {"hidden": not on}, label))

    def _label(self, name: str) -> str:
        assert self.light is not None
        light = self.context.document.scene[self.light]
        return f"{param_infos(type(light))[name].label} of {light.name}"

    def _make(self, name: str, value: Value) -> Edit:
        assert self.light is not None
        return SetFields(self.light, {name: value}, self._label(name))

    def _remove(self) -> None:
        if self.light is not None:
            self.context.editing.apply(Remove((self.light,), "Delete light"))


def set_environment(scene: Scene, image: Image, path: Path) -> Edit:
    """The edit that lights the scene with a picture; an environment that is there keeps its settings."""
    old = next(scene.of(Environment), None)
    if old is not None:
        return SetFields(
            old.id, {"image": image, "name": path.stem, "hidden": False}, f"Environment {path.stem}"
        )
    made = Environment(id=new_id("environment"), name=path.stem, image=image)
    return Add((made,), label=f"Environment {path.stem}")


def thumbnail(image: Image, width: int, height: int) -> npt.NDArray[np.float32]:
    """(h, w, 3) linear, at most that large, scaled so that its mean is a middle grey."""
    pixels = image.pixels[..., :3]
    step = max(1, -(-pixels.shape[1] // width), -(-pixels.shape[0] // height))
    skip = max(1, step // 3)  # three samples across are enough for a thumbnail
    pixels, step = pixels[::skip, ::skip], step // skip
    rows, columns = pixels.shape[0] // step, pixels.shape[1] // step
    blocks = pixels[: rows * step, : columns * step].reshape(rows, step, columns, step, -1)
    small = blocks.mean(axis=(1, 3))
    clipped = np.minimum(small, np.percentile(small, 95))
    made: npt.NDArray[np.float32] = np.asarray(small * (0.25 / max(float(clipped.mean()), 1e-12)), np.float32)
    return made


def _above(scene: Scene) -> tuple[tuple[float, float, float], float]:
    """The middle of the scene's floor, and a height for a lamp."""
    found = bounds(scene)
    if found is None:
        return (0.0, 0.0, 0.0), 2.2
    low, high = found
    middle = (low + high) / 2
    return vec3((middle[0], low[1], middle[2])), float(min(max(high[1] - 0.3, low[1] + 1.8), low[1] + 2.4))


def _down(scene: Scene) -> Transform:
    foot, height = _above(scene)
    return looking((foot[0], height, foot[2]), foot, (0, 0, -1))


def _point(node: NodeId, name: str, scene: Scene) -> Light:
    return PointLamp(id=node, name=name, transform=_down(scene), intensity=2.0, temperature=2700.0)


def _spot(node: NodeId, name: str, scene: Scene) -> Light:
    return SpotLamp(id=node, name=name, transform=_down(scene), intensity=5.0, temperature=2700.0)


def _area(node: NodeId, name: str, scene: Scene) -> Light:
    place = _down(scene)
    return AreaLamp(
        id=node, name=name, transform=place, intensity=8.0, temperature=4000.0, width=0.6, height=0.6
    )


def _sun(node: NodeId, name: str, scene: Scene) -> Light:
    foot, _ = _above(scene)
    place = looking([f + 3 * d for f, d in zip(foot, _SUN_FROM, strict=True)], foot)
    return DirectionalLamp(id=node, name=name, transform=place, intensity=3.0, temperature=5500.0)


LAMPS: dict[str, Callable[[NodeId, str, Scene], Light]] = {
    "Point lamp": _point,
    "Spot lamp": _spot,
    "Area lamp": _area,
    "Sun": _sun,
}
