"""Gestures as values: each turns where the mouse is into the edit that the gesture has come to.

All edits are relative to the scene at the press; `Editing.preview` applies them to it.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Protocol

import numpy as np
import numpy.typing as npt

from studio_core.edits import Edit, Move, SetFields
from studio_core.scene.arranging import shifted, turned
from studio_core.scene.nodes import Environment, NodeId, Scene
from studio_core.session import View
from studio_ui.canvas.projection import axes_of, bounds, eye_of, ray
from studio_ui.canvas.viewport import Pointer

F64 = npt.NDArray[np.float64]
GRID = 0.05  # metres
ANGLE_GRID = 15.0  # degrees
_FLAT = 0.03  # sine of the lowest angle at which the floor is followed
_FURTHEST = 12.0  # times the distance at the press


class Drag(Protocol):
    """A gesture between press and release."""

    label: str

    def edit(self, pointer: Pointer) -> Edit:
        """What the gesture does with the mouse there."""
        ...


def named(scene: Scene, nodes: tuple[NodeId, ...], verb: str) -> str:
    """`Move Chair`, `Move 3 objects`."""
    return f"{verb} {scene[nodes[0]].name}" if len(nodes) == 1 else f"{verb} {len(nodes)} objects"


class MoveDrag:
    """Over the horizontal plane through the point that was picked; with Shift up and down."""

    def __init__(self, scene: Scene, nodes: tuple[NodeId, ...], view: View, point: npt.ArrayLike) -> None:
        self.label = named(scene, nodes, "Move")
        self._scene, self._nodes, self._view = scene, nodes, view
        self._point = np.asarray(point, np.float64)
        self._delta = np.zeros(3)
        self._vertical = False
        self._base, self._grip = np.zeros(3), self._point
        self._lead = np.array(scene.world(nodes[0]).translation)

    def edit(self, pointer: Pointer) -> Move:
        """The nodes so that the picked point lies under the mouse."""
        if pointer.shift != self._vertical:  # go on from here along the other directions
            self._vertical = pointer.shift
            self._base = self._delta
            self._grip = self._touch(pointer, self._point + self._base)
        step = self._touch(pointer, self._point + self._base) - self._grip
        step = step * (0, 1, 0) if self._vertical else step * (1, 0, 1)
        delta = self._base + step
        if pointer.ctrl:
            snapped = np.round((self._lead + delta) / GRID) * GRID - self._lead
            delta = np.where(np.abs(step) > 0, snapped, delta)
        self._delta = delta
        return Move(shifted(self._scene, self._nodes, delta), self.label)

    def _touch(self, pointer: Pointer, through: F64) -> F64:
        """Where the mouse's ray meets the plane through a point."""
        eye, towards = eye_of(self._view), ray(self._view, pointer.x, pointer.y)
        back = axes_of(self._view)[2]
        normal = np.array([0.0, 1.0, 0.0])
        if self._vertical:
            normal = np.array([back[0], 0.0, back[2]])
            length = np.linalg.norm(normal)
            normal = normal / length if length > 1e-6 else back
        elif abs(towards[1]) < _FLAT or (towards[1] * (through - eye)[1]) <= 0:
            normal = back  # near the horizon: follow the hand in the picture's plane
        slope = float(towards @ normal)
        if abs(slope) < 1e-9:
            return through
        reach = float((through - eye) @ normal) / slope
        furthest = _FURTHEST * max(float(np.linalg.norm(through - eye)), 0.1)
        return eye + towards * float(np.clip(reach, 0.0, furthest))


class TurnDrag:
    """About the vertical through the middle of what is turned; with Ctrl in steps."""

    def __init__(self, scene: Scene, nodes: tuple[NodeId, ...], start: Pointer) -> None:
        self.label = named(scene, nodes, "Turn")
        self._scene, self._nodes, self._from = scene, nodes, start.x
        self._pivot = middle(scene, nodes)

    def edit(self, pointer: Pointer) -> Move:
        """A drag across the picture is one turn."""
        degrees = (pointer.x - self._from) * 360
        if pointer.ctrl:
            degrees = round(degrees / ANGLE_GRID) * ANGLE_GRID
        return Move(turned(self._scene, self._nodes, degrees, self._pivot), self.label)


class LightDrag:
    """Turns the environment about the vertical."""

    label = "Rotate light"

    def __init__(self, environment: Environment, start: Pointer) -> None:
        self._node, self._from, self._azimuth = environment.id, start.x, environment.azimuth

    def edit(self, pointer: Pointer) -> SetFields:
        """A drag across the picture is one turn."""
        azimuth = (self._azimuth + (pointer.x - self._from) * 360) % 360
        return SetFields(self._node, {"azimuth": azimuth}, self.label)


def middle(scene: Scene, nodes: Iterable[NodeId]) -> F64:
    """Centre of the box around nodes."""
    found = bounds(scene, nodes)
    made: F64 = (found[0] + found[1]) / 2 if found is not None else np.zeros(3)
    return made
