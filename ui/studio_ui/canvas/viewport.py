"""What the window needs of a canvas, whatever draws it."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Literal, Protocol

import numpy as np
import numpy.typing as npt
from PySide6.QtGui import QImage
from PySide6.QtWidgets import QWidget

from studio_core.scene.nodes import NodeId, Scene
from studio_core.scene.transform import Vec3
from studio_core.session import View
from studio_core.shading.artifacts import Picture
from studio_core.signal import Signal
from studio_ui.canvas.glyphs import Glyph
from studio_ui.canvas.overlay import NOTHING, Overlay
from studio_ui.feed import Freshness
from studio_ui.look.theme import Theme

Button = Literal["left", "middle", "right", "none"]
GRID = (0.62, 0.64, 0.68)
"""Colour of the lines on the ground, as displayed."""


@dataclass(frozen=True)
class Pointer:
    """A mouse event: (x, y) in 0…1 from the top left of the canvas, `button` what was pressed or is held.

    `pixels` are the canvas' logical width and height, for thresholds that are felt by the hand.
    """

    kind: Literal["press", "move", "release", "double"]
    x: float
    y: float
    button: Button = "none"
    shift: bool = False
    ctrl: bool = False
    alt: bool = False
    pixels: tuple[int, int] = (1, 1)


@dataclass(frozen=True)
class Probe:
    """What lies under a point of the canvas: node (None: nothing), metres along the ray, linear radiance.

    `point` is where that is in the world; None where there is nothing. `share` of its light came by way of
    other surfaces, in a picture that shows that.
    """

    node: NodeId | None
    distance: float
    radiance: tuple[float, float, float]
    point: Vec3 | None = None
    share: float | None = None


class Viewport(Protocol):
    """Shows pictures and reports what the hand does. `resized` gives device pixels.

    `wheel` gives steps of a mouse wheel, away from the hand positive; `scroll` what two fingers slid on a
    touchpad, right and down, in shares of the canvas' height; `pinch` by which share they spread.
    """

    widget: QWidget
    pointer: Signal[[Pointer]]
    wheel: Signal[[Pointer, float]]
    scroll: Signal[[Pointer, float, float]]
    pinch: Signal[[Pointer, float]]
    key: Signal[[str, bool]]
    left: Signal[[]]
    resized: Signal[[int, int]]

    def set_picture(self, picture: Picture | None, view: View | None) -> None:
        """Another picture, and the view it was made for."""
        ...

    def set_scene(self, scene: Scene) -> None:
        """What the scene has come to: a canvas that can shows things where they are, before their picture."""
        ...

    def set_freshness(self, state: Freshness) -> None:
        """Mark the picture."""
        ...

    def set_display(self, exposure: float, tonemap: str) -> None:
        """Exposure in EV and the view transform; nothing is shaded."""
        ...

    def set_selection(self, nodes: Iterable[NodeId]) -> None:
        """Meshes to be outlined (and glyphs to be lit)."""
        ...

    def set_guides(
        self,
        view: View,
        glyphs: Iterable[Glyph],
        boxes: npt.NDArray[np.float64] | None = None,
        overlay: Overlay = NOTHING,
    ) -> None:
        """Marks over the picture as the present view sees them; `boxes` (N, 2, 3) follow a gesture.

        A canvas that can draw at once what the view sees, before there is a picture of it, does so.
        """
        ...

    def set_grid(self, shown: bool) -> None:
        """Lines on the ground."""
        ...

    def set_message(self, text: str) -> None:
        """A line over an empty canvas."""
        ...

    def set_theme(self, theme: Theme) -> None:
        """Colours around and over the picture."""
        ...

    def placed(self) -> tuple[float, float, float, float]:
        """Where the picture lies on the canvas: left, top, right, bottom, 0…1 from the top left."""
        ...

    def probe(self, x: float, y: float) -> Probe | None:
        """What the shown picture has at a point of the canvas; None outside or without a picture."""
        ...

    def glyph_at(self, x: float, y: float) -> NodeId | None:
        """The lamp or camera drawn near a point of the canvas."""
        ...

    def seen_in(
        self, start: tuple[float, float], end: tuple[float, float]
    ) -> Mapping[NodeId, tuple[int, int]]:
        """By node: pixels between two points of the canvas, and all its pixels; a lamp or camera is one."""
        ...

    def want_keys(self, wanted: Callable[[str], bool]) -> None:
        """Keys of these names come as `key` signals, before all shortcuts of the window.

        A letter is named in small, with `shift+` before one that is typed with Shift; other keys are
        `enter`, `backspace`, `escape`, or what they type. Keys with Ctrl, Alt or Meta have no name.
        `focus` is released when the keyboard goes to another part of the window.
        """
        ...

    def grab_image(self) -> QImage:
        """The canvas as it is seen."""
        ...

    def release(self) -> None:
        """Give everything back: this canvas is not shown any more."""
        ...
