"""Looking around with the mouse: what a drag or the wheel does to the view, from press to release."""

from __future__ import annotations

from typing import Literal

import numpy as np
import numpy.typing as npt

from studio_core.document import Document
from studio_core.session import Session, View
from studio_ui.canvas import navigation
from studio_ui.canvas.projection import bounds, eye_of, ray
from studio_ui.canvas.viewport import Pointer, Viewport
from studio_ui.feed import PictureFeed

F64 = npt.NDArray[np.float64]
Mode = Literal["orbit", "pan", "zoom"]
_NOTCH = 0.86  # of the distance that is left after a step of the wheel
_PULL = 3.0  # natural logarithm of the distance for a drag over the picture's height


class Looking:
    """`start`, any number of `move`, `end`; `wheel` stands alone. Pictures are quick in between."""

    def __init__(self, viewport: Viewport, document: Document, session: Session, feed: PictureFeed) -> None:
        self.mode: Mode | None = None
        """What is under way."""
        self._viewport, self._document, self._session, self._feed = viewport, document, session, feed
        self._pivot: F64 | None = None
        self._last: Pointer | None = None

    def mode_of(self, press: Pointer) -> Mode:
        """What a drag with this button and these keys does, where no tool wants it."""
        if press.button == "right" or (press.button == "middle" and press.shift):
            return "pan"
        if press.button == "middle" and press.ctrl:
            return "zoom"
        return "orbit"

    def touched(self, x: float, y: float) -> F64 | None:
        """(3,) the point of the world that is seen at a point of the canvas."""
        view, probe = self._session.view, self._viewport.probe(x, y)
        if probe is None or not np.isfinite(probe.distance):
            return None
        made: F64 = eye_of(view) + ray(view, x, y) * probe.distance
        return made

    def start(self, mode: Mode, press: Pointer) -> None:
        """A drag begins, where the button was pressed."""
        self.end()
        self.mode, self._last = mode, press
        self._pivot = self.touched(press.x, press.y)
        if mode == "orbit":
            chosen = self._middle_of_selection()
            self._pivot = chosen if chosen is not None else self._pivot
        self._feed.hold()

    def move(self, pointer: Pointer) -> None:
        """The mouse is there now."""
        if self.mode is None or self._last is None:
            return
        dx = (pointer.x - self._last.x) * pointer.pixels[0] / max(pointer.pixels[1], 1)
        dy = pointer.y - self._last.y
        self._last = pointer
        self._session.look(self._moved(self._session.view, dx, dy))

    def end(self) -> None:
        """The button was released: a full picture follows."""
        if self.mode is not None:
            self.mode = self._last = self._pivot = None
            self._feed.release()

    def wheel(self, pointer: Pointer, steps: float) -> None:
        """Towards what is under the mouse, or away from it."""
        probe = self._viewport.probe(pointer.x, pointer.y)
        distance = probe.distance if probe is not None else None
        self._feed.step()
        view = navigation.zoom(self._session.view, _NOTCH**steps, pointer.x, pointer.y, distance)
        self._session.look(view)

    def _moved(self, view: View, dx: float, dy: float) -> View:
        if self.mode == "orbit":
            return navigation.orbit(view, dx, dy, self._pivot)
        if self.mode == "pan":
            away = None if self._pivot is None else float(np.linalg.norm(self._pivot - eye_of(view)))
            return navigation.pan(view, dx, dy, away)
        return navigation.zoom(view, float(np.exp(_PULL * dy)))

    def _middle_of_selection(self) -> F64 | None:
        scene = self._document.scene
        found = bounds(scene, [node for node in self._session.selection if node in scene.nodes])
        if found is None:
            return None
        made: F64 = (found[0] + found[1]) / 2
        return made
