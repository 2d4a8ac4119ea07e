"""Gestures as values: each turns where the mouse is, or what was typed, into the edit it has come to.

All edits are relative to the scene at the press; `Editing.preview` applies them to it.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Protocol

import numpy as np
import numpy.typing as npt

from studio_core.edits import Add, Compound, Edit, SetFields
from studio_core.quantities import format_quantity
from studio_core.scene.nodes import Environment, NodeId, Scene
from studio_core.session import View
from studio_core.units import LENGTH_UNITS
from studio_ui.canvas.gizmos import COLOURS, Frame
from studio_ui.canvas.overlay import Overlay, Wires
from studio_ui.canvas.projection import bounds
from studio_ui.canvas.snapping import Snap
from studio_ui.canvas.viewport import Pointer

F64 = npt.NDArray[np.float64]
_LINE = 50.0  # metres to either side that an axis is drawn


@dataclass(frozen=True)
class Words:
    """How amounts are told: the unit of lengths (as `LENGTH_UNITS`), the decimal mark."""

    unit: str = "m"
    mark: str = "."

    def length(self, metres: float) -> str:
        """`80 cm`, `1.25 m`, `-3 mm`, `2'7.5"`."""
        shown, decimals = self.unit, LENGTH_UNITS[self.unit].decimals
        if shown == "m" and abs(metres) < 1:
            shown, decimals = ("cm", 1) if abs(metres) >= 0.01 or not metres else ("mm", 1)
        return format_quantity(metres, "m", shown, decimals, mark=self.mark)

    def angle(self, degrees: float) -> str:
        """`15°`, `-2.5°`."""
        return format_quantity(degrees, "°", decimals=1, mark=self.mark)

    def factor(self, factor: float) -> str:
        """`120%`."""
        return format_quantity(factor, "", "%", 1, mark=self.mark)


class Drag(Protocol):
    """A gesture between press and release."""

    @property
    def unit(self) -> str | None:
        """That of what can be typed; None: nothing can."""
        ...

    @property
    def label(self) -> str:
        """What the history will call it."""
        ...

    def edit(self, pointer: Pointer) -> Edit:
        """What the gesture does with the mouse there."""
        ...

    def type(self, amount: float | None) -> None:
        """From now on this amount counts, and not the mouse; None gives it back to the mouse."""
        ...

    def told(self) -> str:
        """How far it has come, in few words."""
        ...

    @property
    def frame(self) -> Frame | None:
        """Where the gizmo stands now."""
        ...

    def marks(self) -> Overlay:
        """What the gesture has to show."""
        ...


@dataclass(frozen=True, eq=False)
class Hold:
    """What was taken hold of: nodes of a scene that is seen through `view`, at a point (3,) of the world.

    `copies` leaves the nodes and moves copies of them; `called` is what the history calls them.
    """

    scene: Scene
    nodes: tuple[NodeId, ...]
    view: View
    frame: Frame
    press: Pointer
    grip: F64
    snap: Snap = Snap()
    copies: bool = False
    world_axes: bool = True
    called: str = ""
    words: Words = Words()

    def title(self, verb: str) -> str:
        """`Move Chair`, `Copy 3 objects`."""
        return f"{'Copy' if self.copies else verb} {self.called}"

    def magnet(self, pointer: Pointer) -> bool:
        """Whether things snap now: Ctrl turns it round."""
        return self.snap.on != pointer.ctrl

    def axis_line(self, axis: int) -> Overlay:
        """The line that a movement keeps to."""
        along = self.frame.axes[axis] * _LINE
        line = np.array([[self.frame.pivot - along, self.frame.pivot + along]])
        return Overlay((Wires(line, f"#99{COLOURS[axis][1:]}", 1.0, bare=True),))


class CopyDrag:
    """The same gesture with `copies`, which `add` makes."""

    def __init__(self, add: Add, copies: tuple[NodeId, ...], inner: Drag) -> None:
        self.add, self.copies, self._inner = add, copies, inner
        self.unit = inner.unit

    @property
    def label(self) -> str:
        """`Copy Chair 80 cm along X`."""
        return self._inner.label

    def edit(self, pointer: Pointer) -> Compound:
        """New copies, moved."""
        edit = self._inner.edit(pointer)
        return Compound(edit.label, (self.add, edit))

    def type(self, amount: float | None) -> None:
        """See `Drag`."""
        self._inner.type(amount)

    def told(self) -> str:
        """See `Drag`."""
        return self._inner.told()

    @property
    def frame(self) -> Frame | None:
        """See `Drag`."""
        return self._inner.frame

    def marks(self) -> Overlay:
        """See `Drag`."""
        return self._inner.marks()


class LightDrag:
    """Turns the environment about the vertical."""

    label, unit, frame = "Rotate light", "°", None

    def __init__(self, environment: Environment, start: Pointer) -> None:
        self._node, self._from, self._azimuth = environment.id, start.x, environment.azimuth
        self._turned = 0.0
        self._typed: float | None = None

    def edit(self, pointer: Pointer) -> SetFields:
        """A drag across the picture is one turn."""
        self._turned = (pointer.x - self._from) * 360 if self._typed is None else self._typed
        return SetFields(self._node, {"azimuth": (self._azimuth + self._turned) % 360}, self.label)

    def type(self, amount: float | None) -> None:
        """Degrees."""
        self._typed = amount

    def told(self) -> str:
        """The angle."""
        return Words().angle(self._turned)

    def marks(self) -> Overlay:
        """Nothing: the light is seen."""
        return Overlay()


def named(scene: Scene, nodes: tuple[NodeId, ...], verb: str) -> str:
    """`Move Chair`, `Move 3 objects`."""
    return f"{verb} {called(scene, nodes)}"


def called(scene: Scene, nodes: tuple[NodeId, ...]) -> str:
    """`Chair`, `3 objects`."""
    return scene[nodes[0]].name if len(nodes) == 1 else f"{len(nodes)} objects"


def middle(scene: Scene, nodes: Iterable[NodeId]) -> F64:
    """Centre of the box around nodes."""
    found = bounds(scene, nodes)
    made: F64 = (found[0] + found[1]) / 2 if found is not None else np.zeros(3)
    return made
