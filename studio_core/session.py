"""What a person is looking at and holding: view, selection, backend. Not part of the document."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from studio_core.arrays import frozen_map
from studio_core.scene.diff import Aspect
from studio_core.scene.nodes import Camera, NodeId, Scene
from studio_core.scene.transform import IDENTITY, Transform, looking
from studio_core.signal import Signal

ALL, DIRECT, INDIRECT, SHARE = "all", "direct", "indirect", "share"
LIGHTS = (ALL, DIRECT, INDIRECT, SHARE)
"""Which light is looked at: all, what comes straight from lamps and sky, what came by way of other surfaces,
the share of that."""


@dataclass(frozen=True)
class View:
    """A pinhole camera: world from camera, vertical angle in degrees, pixels, orbit distance in metres.

    A pixel is the mean of `antialias`² samples; with `fine_edges` those in which something ends have 16 where
    that is more. Where `whole` is not 0 this is a part: `height` rows from row `top` on of a picture that is
    `whole` rows high, and `fov` is that of the whole. Raises ValueError for a view of nothing.
    """

    transform: Transform = IDENTITY
    fov: float = 45.0
    width: int = 960
    height: int = 540
    focus: float = 3.0
    antialias: int = 2
    fine_edges: bool = False
    top: int = 0
    whole: int = 0

    def __post_init__(self) -> None:
        if min(self.width, self.height, self.antialias) < 1 or not 0 < self.fov < 180:
            raise ValueError("a view needs pixels, samples in them, and an angle between 0 and 180°")
        if self.top < 0 or ((self.whole or self.top) and self.top + self.height > self.whole):
            raise ValueError("a part of a picture must lie in it")

    @classmethod
    def of(cls, camera: Camera, scene: Scene, width: int, height: int) -> View:
        """What a camera of the scene sees."""
        world = scene.world(camera.id)
        return cls(dataclasses.replace(world, scale=1.0), camera.fov, width, height, camera.focus)

    @property
    def target(self) -> tuple[float, float, float]:
        """The point that the view orbits, world."""
        x, y, z, _ = (float(v) for v in self.transform.matrix() @ (0.0, 0.0, -self.focus, 1.0))
        return (x, y, z)

    @property
    def rows(self) -> int:
        """Pixels down the whole picture, of which this may be a part."""
        return self.whole or self.height

    def part(self, top: int, height: int) -> View:
        """Some rows of the picture. ValueError where they are not in it."""
        return dataclasses.replace(self, top=top, height=height, whole=self.rows)

    def sized(self, width: int, height: int) -> View:
        """The same view in other pixels."""
        return dataclasses.replace(self, width=max(1, width), height=max(1, height))


def framing(low: Iterable[float], high: Iterable[float], view: View) -> View:
    """A three-quarter view from the front that shows the whole box, metres."""
    corners = np.array([tuple(low), tuple(high)])
    centre = corners.mean(axis=0)
    radius = max(float(np.linalg.norm(corners[1] - corners[0])) / 2, 1e-3)
    half = np.radians(view.fov / 2)
    half = min(half, np.arctan(np.tan(half) * view.width / view.height))
    distance = radius / np.sin(half)
    eye = centre + distance * np.array([0.45, 0.35, 0.82]) / np.linalg.norm([0.45, 0.35, 0.82])
    return dataclasses.replace(view, transform=looking(eye, centre), focus=float(distance))


class Session:
    """`changed(aspect)` tells what the picture must follow; `selected()` tells the panels.

    While `bouncing`, light goes on between surfaces by the method `indirect`, with its own of
    `indirect_params`, which are kept by method; `light`, one of `LIGHTS`, is looked at.
    """

    def __init__(self, view: View | None = None) -> None:
        self.view = view or View()
        self.selection: tuple[NodeId, ...] = ()
        self.backend = "cuts"
        self.params: Mapping[str, Any] = frozen_map()
        self.bouncing = True
        self.indirect = "gather"
        self.indirect_params: Mapping[str, Mapping[str, Any]] = frozen_map()
        self.light = ALL
        self.exposure = 0.0
        self.tonemap = "srgb"
        self.changed: Signal[[Aspect]] = Signal()
        self.selected: Signal[[]] = Signal()
        self.displayed: Signal[[]] = Signal()

    def look(self, view: View) -> None:
        """Another view."""
        if view != self.view:
            self.view = view
            self.changed.emit(Aspect.VIEW)

    def select(self, nodes: Iterable[NodeId]) -> None:
        """Another selection, without doubles, in order."""
        made = tuple(dict.fromkeys(nodes))
        if made != self.selection:
            self.selection = made
            self.selected.emit()

    def shade_with(self, backend: str, params: Mapping[str, Any] | None = None) -> None:
        """Another backend, or other parameters for it."""
        self.backend, self.params = backend, frozen_map(params or {})
        self.changed.emit(Aspect.QUALITY)

    def bounce(
        self, on: bool | None = None, method: str | None = None, params: Mapping[str, Any] | None = None
    ) -> None:
        """Light between surfaces: on or off, by another method, with other parameters of the method."""
        before = (self.bouncing, self.indirect, self.indirect_params)
        self.bouncing = self.bouncing if on is None else on
        self.indirect = method or self.indirect
        if params is not None:
            self.indirect_params = frozen_map({**self.indirect_params, self.indirect: frozen_map(params)})
        if before != (self.bouncing, self.indirect, self.indirect_params):
            self.changed.emit(Aspect.INDIRECT)

    def show_light(self, light: str) -> None:
        """Look at other light, of `LIGHTS`. ValueError for another name."""
        if light not in LIGHTS:
            raise ValueError(f"there is no light {light!r} to look at; known: {', '.join(LIGHTS)}")
        if light != self.light:
            self.light = light
            self.changed.emit(Aspect.INDIRECT)

    def display(self, *, exposure: float | None = None, tonemap: str | None = None) -> None:
        """How the picture is shown; nothing is shaded again."""
        self.exposure = self.exposure if exposure is None else exposure
        self.tonemap = self.tonemap if tonemap is None else tonemap
        self.displayed.emit()
