"""Where things are, how they are turned and how large they are: numbers for one thing or several."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Mapping, Sequence

from PySide6.QtGui import QShowEvent
from PySide6.QtWidgets import QHBoxLayout, QLabel, QWidget

from studio_core.edits import Move
from studio_core.params import ParamInfo, Value
from studio_core.scene.nodes import Camera, Light, NodeId, Scene
from studio_core.scene.size import own_size, pivot_words, resized
from studio_core.scene.transform import IDENTITY, Transform, Vec3
from studio_ui.canvas.drags import named
from studio_ui.context import Context
from studio_ui.forms.euler import from_euler, to_euler
from studio_ui.forms.hold import Hold
from studio_ui.forms.number_style import number_style
from studio_ui.forms.param_form import form_label_like, form_layout
from studio_ui.forms.reset_button import ResetButton, beside
from studio_ui.forms.sinks import EditSink, Sink
from studio_ui.forms.spin import Spin
from studio_ui.panels.panel import note

_POSITION = ParamInfo(
    "number", "Position", "Where its pivot is, from its group's pivot", unit="m", low=-1e6, high=1e6
)
_ANGLE = ParamInfo(
    "number", "Rotation", "About its pivot: tilt about x, turn about y, roll about z", unit="°",
    low=-3600, high=3600,
)  # fmt: skip
_SCALE = ParamInfo("number", "Scale", "About its pivot", low=1e-6, high=1e6, scale="log")
_SIZE = ParamInfo(
    "number",
    "Size",
    "Along its own axes; all of it grows alike, and its base stays where it is",
    unit="m",
    low=1e-6,
    high=1e6,
)
_AXES = ("x", "y", "z")
_SIDES = ("width", "depth", "height")
_ROUNDED = 1e-7  # what Euler angles lose on the way there and back is no edit
Moved = Callable[[Transform, NodeId, int, float], Transform]
_SCALE_ROW, _SIZE_ROW = 2, 3
_MOST = 20  # things that are measured; of more, the last ones


class Triple(QWidget):
    """Numbers of one kind side by side, each a parameter of its name for `sink`."""

    def __init__(self, info: ParamInfo, sink: Sink, names: Sequence[str] = _AXES) -> None:
        super().__init__()
        decimals = 2 if info.unit == "°" else 3
        self.spins = [Spin(info, decimals=decimals, show_unit=False) for _ in names]
        self._values: list[float] = [math.inf] * len(names)
        self._holds = [Hold(sink, name, spin) for name, spin in zip(names, self.spins, strict=True)]
        layout = QHBoxLayout(self)
        layout.setContentsMargins(0, 0, 0, 0)
        layout.setSpacing(3)
        for index, (spin, name) in enumerate(zip(self.spins, names, strict=True)):
            spin.setMinimumWidth(40)
            spin.setToolTip(f"{name.capitalize()}\n{info.doc}")
            spin.setAccessibleName(f"{info.label} {name}")
            spin.valueChanged.connect(lambda value, i=index: self._tell(i, value))
            layout.addWidget(spin, 1)

    def show_values(self, values: Sequence[float], mixed: Sequence[bool]) -> None:
        """Without telling; a dash for what is mixed."""
        for index, (spin, value, several) in enumerate(zip(self.spins, values, mixed, strict=True)):
            self._values[index] = math.inf if several else value
            (spin.show_mixed if several else spin.show_value)(value)

    def _tell(self, index: int, value: float) -> None:
        if abs(value - self._values[index]) >= _ROUNDED:
            self.spins[index].mixed = False
            self._values[index] = value
            self._holds[index].give(value)


class UnitLabel(QLabel):
    """A row's label with the unit in which the window shows what is beside it."""

    def __init__(self, info: ParamInfo, tool_tip: str) -> None:
        super().__init__()
        self._info = info
        form_label_like(self, tool_tip)
        self.follow_style()

    def follow_style(self) -> None:
        """Name the window's unit."""
        unit = number_style(self).unit_of(self._info.unit)
        self.setText(f"{self._info.label} ({unit})" if unit else self._info.label)

    def showEvent(self, event: QShowEvent) -> None:
        """That of the window that it has come to."""
        super().showEvent(event)
        self.follow_style()


class PlaceEditor(QWidget):
    """Position, rotation, scale and size of what is chosen; an edit of all of it is one step."""

    def __init__(self, context: Context) -> None:
        super().__init__()
        self.context = context
        self._nodes: tuple[NodeId, ...] = ()
        self.position = self._triple(_POSITION, "Move", _shifted)
        self.rotation = self._triple(_ANGLE, "Turn", _turned)
        self.scale = self._triple(_SCALE, "Scale", _scaled, ("scale",))
        self.size = self._triple(_SIZE, "Resize", self._sized, _SIDES)
        resets = {
            "translation": ResetButton("position", lambda: self._reset("translation", "Move")),
            "rotation": ResetButton("rotation", lambda: self._reset("rotation", "Turn")),
            "scale": ResetButton("scale", lambda: self._reset("scale", "Scale")),
        }
        self.resets: Mapping[str, ResetButton] = resets
        layout = form_layout(self)
        rows = ((_POSITION, self.position), (_ANGLE, self.rotation), (_SCALE, self.scale))
        self._layout = layout
        for (info, triple), reset in zip(rows, resets.values(), strict=True):
            layout.addRow(UnitLabel(info, info.doc), beside(triple, reset))
        tip = f"Width × depth × height\n{_SIZE.doc}"
        self.pivot = note("")
        self.pivot.setToolTip("The point that its position tells, and about which it is turned and scaled")
        layout.addRow(UnitLabel(_SIZE, tip), beside(self.size, ResetButton("size", lambda: None)))
        layout.addRow(self.pivot)

    def show_nodes(self, scene: Scene, nodes: tuple[NodeId, ...]) -> None:
        """Those things as they are now."""
        self._nodes = nodes
        nodes = nodes[-_MOST:]
        places = [scene[node].transform for node in nodes]
        self._show(self.position, [place.translation for place in places])
        self._show(self.rotation, [to_euler(place.rotation) for place in places])
        self._show(self.scale, [(place.scale,) for place in places])
        sizes = [size for size in (own_size(scene, node) for node in nodes) if size is not None]
        if sizes:
            self._show(self.size, sizes)
        grows = not all(isinstance(scene[node], Camera | Light) for node in nodes)
        self._layout.setRowVisible(_SCALE_ROW, grows)
        self._layout.setRowVisible(_SIZE_ROW, bool(sizes))
        pivot = pivot_words(scene, nodes[0]) if len(self._nodes) == 1 else ""
        self.pivot.setText(f"Pivot {pivot}")
        self.pivot.setVisible(bool(pivot))
        for name, button in self.resets.items():
            button.offer(any(getattr(place, name) != getattr(IDENTITY, name) for place in places))

    def _show(self, triple: Triple, rows: Sequence[Sequence[float]]) -> None:
        mixed = [any(abs(row[i] - rows[-1][i]) > 1e-9 for row in rows) for i in range(len(rows[-1]))]
        triple.show_values(rows[-1], mixed)

    # edits

    def _triple(self, info: ParamInfo, verb: str, moved: Moved, names: Sequence[str] = _AXES) -> Triple:
        """Numbers that make a thing's new transform by `moved(transform, node, index, value)`."""

        def edit(name: str, value: Value) -> Move | None:
            return self._edit(verb, lambda old, node: moved(old, node, names.index(name), value))

        return Triple(info, EditSink(self.context.editing, edit, lambda _: self._label(verb)), names)

    def _label(self, verb: str) -> str:
        """What the history calls an edit of what is chosen."""
        return named(self.context.document.scene, self._there(), verb)

    def _edit(self, verb: str, moved: Callable[[Transform, NodeId], Transform]) -> Move | None:
        """The edit that gives all of them another transform; None when nothing is left of them."""
        scene, nodes = self.context.document.scene, self._there()
        made = {node: moved(scene[node].transform, node) for node in nodes}
        return Move(made, self._label(verb)) if made else None

    def _there(self) -> tuple[NodeId, ...]:
        scene = self.context.document.scene
        return tuple(node for node in self._nodes if node in scene.nodes)

    def _sized(self, old: Transform, node: NodeId, index: int, value: float) -> Transform:
        scene = self.context.document.scene
        size = own_size(scene, node)
        return resized(scene, node, value / size[index]) if size is not None and size[index] > 0 else old

    def _reset(self, name: str, verb: str) -> None:
        fields = {name: getattr(IDENTITY, name)}
        edit = self._edit(verb, lambda old, _: dataclasses.replace(old, **fields))
        if edit is not None:
            self.context.editing.apply(edit)


def _shifted(old: Transform, _: NodeId, index: int, value: float) -> Transform:
    return dataclasses.replace(old, translation=_with(old.translation, index, value))


def _turned(old: Transform, _: NodeId, index: int, value: float) -> Transform:
    return dataclasses.replace(old, rotation=from_euler(_with(to_euler(old.rotation), index, value)))


def _scaled(old: Transform, _: NodeId, index: int, value: float) -> Transform:
    return dataclasses.replace(old, scale=value)


def _with(values: Vec3, index: int, value: float) -> Vec3:
    """Three numbers of which one is another."""
    x, y, z = (value if i == index else old for i, old in enumerate(values))
    return (x, y, z)
