"""Looking around with mouse, wheel and touchpad: what the hand does to the view, as the preset says."""

from __future__ import annotations

from typing import Literal

import numpy as np
import numpy.typing as npt

from studio_core.document import Document
from studio_core.scene.nodes import Scene
from studio_core.session import Session, View
from studio_core.signal import Signal
from studio_ui.canvas import navigation
from studio_ui.canvas.flight import Flight
from studio_ui.canvas.presets import LUCARNE, Preset
from studio_ui.canvas.projection import bounds, project
from studio_ui.canvas.viewport import Pointer, Viewport
from studio_ui.canvas.walking import Walking
from studio_ui.feed import PictureFeed

F64 = npt.NDArray[np.float64]
Mode = Literal["orbit", "pan", "zoom", "turn"]
_NOTCH = 0.86  # of the distance that is left after a step of the wheel
_PULL = 3.0  # natural logarithm of the distance for a drag over the picture's height
_FINGER_STEPS = 10.0  # of the wheel, for fingers that slide over the picture's height
_SAME = 2.0  # logical pixels that the mouse may slip between two steps at one place


class Looking:
    """`start`, any number of `move`, `end`; wheel and fingers stand alone. Pictures are quick in between.

    Every gesture stops a `flight` that is under way.
    """

    def __init__(self, viewport: Viewport, document: Document, session: Session, feed: PictureFeed) -> None:
        self.mode: Mode | None = None
        """What is under way."""
        self.preset: Preset = LUCARNE
        self.inverted = False
        """Whether the wheel goes the other way."""
        self.cancelled: Signal[[]] = Signal()
        """A drag was taken back; the view is about to be the one before it."""
        self.flight = Flight(session, feed)
        self.walking = Walking(session, feed)
        self._viewport, self._document, self._session, self._feed = viewport, document, session, feed
        self._pivot: F64 | None = None
        self._last: Pointer | None = None
        self._before = session.view
        self._anchor: F64 | None = None  # where the last steps of wheel or fingers led
        self._at: tuple[Pointer, View, Scene] | None = None  # what that holds for
        self._off = [viewport.scroll.connect(self.scroll), viewport.pinch.connect(self.pinch)]

    def close(self) -> None:
        """Stop listening, and moving."""
        self.flight.stop()
        self.walking.stop()
        for off in self._off:
            off()

    def mode_of(self, press: Pointer) -> Mode | None:
        """What a drag with this button and these keys does to the view; None: it is the tools' own."""
        gesture = self.preset.gesture(press)
        if self.walking.active and gesture != "light" and press.button != "middle":
            return "turn"
        return None if gesture == "light" else gesture

    def turns_light(self, press: Pointer) -> bool:
        """Whether a drag with this button and these keys turns the light."""
        return self.preset.gesture(press) == "light"

    def touched(self, x: float, y: float) -> F64 | None:
        """(3,) the point of the world that is seen at a point of the canvas."""
        probe = self._viewport.probe(x, y)
        return None if probe is None or probe.point is None else np.array(probe.point)

    def start(self, mode: Mode, press: Pointer, pivot: F64 | None = None) -> None:
        """A drag begins, where the button was pressed; it goes around `pivot`, or what is meant there."""
        self.end()
        self.flight.stop()
        self.mode, self._last, self._before = mode, press, self._session.view
        self._pivot = self._meant(mode, press) if pivot is None else pivot
        self._feed.hold()

    def move(self, pointer: Pointer) -> None:
        """The mouse is there now."""
        if self.mode is None or self._last is None:
            return
        dx = (pointer.x - self._last.x) * pointer.pixels[0] / max(pointer.pixels[1], 1)
        dy = pointer.y - self._last.y
        self._last = pointer
        self._session.look(self._moved(self.mode, self._pivot, dx, dy))

    def end(self) -> None:
        """The button was released: a full picture follows."""
        if self.mode is not None:
            self.mode = self._last = self._pivot = None
            self._feed.release()

    def cancel(self) -> None:
        """Take the drag back."""
        if self.mode is not None:
            now, before = self._session.view, self._before
            self.cancelled.emit()
            self._session.look(before.sized(now.width, now.height))
            self.end()

    def wheel(self, pointer: Pointer, steps: float) -> None:
        """Towards what is under the mouse, or away from it; its place in the picture stays."""
        factor = _NOTCH ** (-steps if self.inverted else steps)
        self._zoom(pointer, factor)

    def scroll(self, pointer: Pointer, dx: float, dy: float) -> None:
        """Two fingers slid on a touchpad, in shares of the picture's height."""
        gesture = self.preset.slid(pointer)
        if self.mode is not None:
            return
        if gesture is None or gesture == "light":
            self.wheel(pointer, dy * _FINGER_STEPS)
        elif gesture == "zoom":
            self._zoom(pointer, float(np.exp(-_PULL * (-dy if self.inverted else dy))))
        else:
            if not self._still(pointer):
                self._anchor = self._meant(gesture, pointer)
            self._step(pointer, self._moved(gesture, self._anchor, dx, dy))

    def pinch(self, pointer: Pointer, share: float) -> None:
        """Two fingers spread by a share of what lay between them."""
        if self.mode is None:
            self._zoom(pointer, 1 / max(1 + share, 0.1))

    def pivot(self) -> F64:
        """(3,) what is turned about where no mouse says it: the selection if it is seen, or the target."""
        found = self._middle_of_selection()
        return found if found is not None else np.array(self._session.view.target)

    def _zoom(self, pointer: Pointer, factor: float) -> None:
        if not self._still(pointer):
            self._anchor = self.touched(pointer.x, pointer.y)
        view = self._session.view
        if self._anchor is not None and navigation.depth(view, self._anchor) > 0:
            view = navigation.approach(view, factor, self._anchor)
        else:
            view = navigation.zoom(view, factor, pointer.x, pointer.y)
        self._step(pointer, view)

    def _still(self, pointer: Pointer) -> bool:
        """Whether this step goes on with the last one: then what was meant is what was meant before.

        The picture may not have followed yet, and a point asked for anew would lie where it was.
        """
        if self._at is None:
            return False
        last, view, scene = self._at
        slip = np.hypot(
            (last.x - pointer.x) * pointer.pixels[0],
            (last.y - pointer.y) * pointer.pixels[1],
        )
        return slip <= _SAME and view == self._session.view and scene is self._document.scene

    def _step(self, pointer: Pointer, view: View) -> None:
        self.flight.stop()
        self._feed.step()
        self._session.look(view)
        self._at = (pointer, self._session.view, self._document.scene)

    def _moved(self, mode: Mode, pivot: F64 | None, dx: float, dy: float) -> View:
        view = self._session.view
        if mode == "orbit":
            return navigation.orbit(view, dx, dy, pivot)
        if mode == "turn":
            return navigation.turn(view, dx, dy)
        away = None if pivot is None else navigation.depth(view, pivot)
        if mode == "pan":
            return navigation.pan(view, dx, dy, away if away is None or away > 0 else None)
        factor = float(np.exp(_PULL * dy))
        return navigation.zoom(view, factor) if pivot is None else navigation.approach(view, factor, pivot)

    def _meant(self, mode: Mode, pointer: Pointer) -> F64 | None:
        """What a gesture at a point of the canvas goes around, or along with."""
        chosen = self._middle_of_selection() if mode == "orbit" else None
        return chosen if chosen is not None else self.touched(pointer.x, pointer.y)

    def _middle_of_selection(self) -> F64 | None:
        """Of what is chosen, where it is in sight."""
        scene = self._document.scene
        found = bounds(scene, [node for node in self._session.selection if node in scene.nodes])
        if found is None:
            return None
        middle: F64 = (found[0] + found[1]) / 2
        place = project(self._session.view, middle)[0]
        seen = bool(np.isfinite(place).all() and (place >= 0).all() and (place <= 1).all())
        return middle if seen else None
