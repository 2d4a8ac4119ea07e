"""Through the room on foot: keys that are held move the eye, level with the floor."""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Callable, Mapping

import numpy as np
from PySide6.QtCore import QTimer

from studio_core.scene.transform import vec3
from studio_core.session import Session, View
from studio_core.signal import Signal
from studio_ui.canvas.projection import axes_of, eye_of
from studio_ui.feed import PictureFeed

WAYS: Mapping[str, tuple[int, int, int]] = {
    "w": (0, 0, 1),
    "s": (0, 0, -1),
    "a": (-1, 0, 0),
    "d": (1, 0, 0),
    "e": (0, 1, 0),
    "q": (0, -1, 0),
}
"""Steps to the right, up and ahead by key."""
SPEED, HURRY = 1.4, 3.0
"""Metres a second of somebody who walks, and how many times that with Shift."""
_TICK_MS = 16
_LONGEST = 0.1  # seconds of a step: what was missed while a picture was made is not caught up with


class Walking:
    """While `active` the keys of `WAYS` walk, with Shift quicker; `changed()` when it starts or ends."""

    def __init__(
        self,
        session: Session,
        feed: PictureFeed,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self.active = False
        self.changed: Signal[[]] = Signal()
        self._session, self._feed, self._clock = session, feed, clock
        self._held: dict[str, bool] = {}  # by key: whether in a hurry
        self._last = 0.0
        self._timer = QTimer()
        self._timer.setInterval(_TICK_MS)
        self._timer.timeout.connect(self._tick)

    def start(self) -> None:
        """From now on keys walk."""
        if not self.active:
            self.active = True
            self.changed.emit()

    def stop(self) -> None:
        """Stand, and let the keys be what they were."""
        self.stand()
        if self.active:
            self.active = False
            self.changed.emit()

    def wants(self, key: str) -> bool:
        """Whether a key walks now."""
        return self.active and key.removeprefix("shift+") in WAYS

    def key(self, key: str, pressed: bool) -> bool:
        """A key was pressed or let go; whether it walks."""
        if not self.wants(key):
            return False
        way = key.removeprefix("shift+")
        if not pressed:
            self._held.pop(way, None)
            if not self._held:
                self.stand()
            return True
        if not self._held:
            self._feed.hold()
            self._last = self._clock()
            self._timer.start()
        self._held[way] = key != way
        return True

    def step(self, seconds: float) -> None:
        """Walk for so long as the held keys say."""
        way = np.array([WAYS[key] for key in self._held], np.float64).sum(axis=0)
        length = float(np.linalg.norm(way))
        if length > 0:
            quick = HURRY if any(self._held.values()) else 1.0
            self._session.look(walked(self._session.view, way / length * SPEED * quick * seconds))

    def _tick(self) -> None:
        now = self._clock()
        seconds, self._last = min(now - self._last, _LONGEST), now
        self.step(seconds)

    def stand(self) -> None:
        """As if all keys were let go."""
        self._held.clear()
        if self._timer.isActive():
            self._timer.stop()
            self._feed.release()


def walked(view: View, way: np.ndarray) -> View:
    """The view from so many metres to the right, up and ahead; level, whichever way one looks."""
    right, up, back = axes_of(view)
    ahead = np.array([-back[0], 0.0, -back[2]])
    if np.linalg.norm(ahead) < 1e-3:  # straight down or up: towards the picture's top
        ahead = np.array([up[0], 0.0, up[2]]) * (1 if back[1] > 0 else -1)
    ahead = ahead / np.linalg.norm(ahead)
    level = np.array([right[0], 0.0, right[2]])
    level = level / max(float(np.linalg.norm(level)), 1e-9)
    eye = eye_of(view) + way[0] * level + way[1] * np.array([0.0, 1.0, 0.0]) + way[2] * ahead
    return dataclasses.replace(view, transform=dataclasses.replace(view.transform, translation=vec3(eye)))
