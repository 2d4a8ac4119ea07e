"""Strokes before they are made: who looks from where, with which tool, along which path."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from studio_core.arrays import frozen_map
from studio_core.scene.nodes import Scene
from studio_core.scene.transform import Vec3, looking
from studio_core.session import View
from studio_core.shading.offline import scene_view
from studio_core.strokes.marks import Marks
from studio_core.strokes.tools import Gesture, ToolSettings

SAMPLES = 2
"""Along each side of a pixel."""


@dataclass(frozen=True)
class Look:
    """What is painted on: what a camera of that name sees (None: the first), who stands at a `place`, or who
    is `standing` somewhere already; and pixels.
    """

    camera: str | None = None
    place: tuple[Vec3, Vec3] | None = None
    """From where, and to where."""
    standing: View | None = None
    fov: float = 45.0
    width: int = 960
    height: int = 540

    def view(self, scene: Scene) -> View:
        """In a scene; EditError where it has no such camera."""
        if self.standing is not None:
            made = self.standing.sized(self.width, self.height)
        elif self.place is None:
            made = scene_view(scene, self.camera, self.width, self.height)
        else:
            made = View(looking(*self.place), self.fov, self.width, self.height)
        return dataclasses.replace(made, antialias=SAMPLES, fine_edges=True)


@dataclass(frozen=True, eq=False)
class PaintedStroke:
    """One that is to be painted on a picture. `fields` are those of `Stroke` that were chosen."""

    tool: str
    gesture: Gesture
    settings: ToolSettings = ToolSettings()
    look: Look = Look()
    fields: Mapping[str, Any] = field(default_factory=frozen_map)
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class MarkedStroke:
    """One whose marks are known, on objects by name or id."""

    tool: str
    objects: tuple[str, ...]
    marks: Marks
    fields: Mapping[str, Any] = field(default_factory=frozen_map)


Planned = PaintedStroke | MarkedStroke

__all__ = ["Look", "MarkedStroke", "PaintedStroke", "Planned"]
