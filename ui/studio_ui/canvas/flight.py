"""From one view to another in a short, smooth movement that any other movement interrupts."""

from __future__ import annotations

import dataclasses

import numpy as np
from PySide6.QtCore import QEasingCurve, QVariantAnimation

from studio_core.scene.transform import Quat, Transform, normalized, vec3
from studio_core.session import Session, View
from studio_ui.canvas.projection import axes_of
from studio_ui.feed import PictureFeed

MILLISECONDS = 220


class Flight:
    """Moves the session's view. `animated` False goes there at once."""

    def __init__(self, session: Session, feed: PictureFeed) -> None:
        self.animated = True
        self.goal: View | None = None
        """Where it goes, while it does."""
        self._session, self._feed = session, feed
        self._start, self._last = session.view, session.view
        self._clock = QVariantAnimation()
        self._clock.setStartValue(0.0)
        self._clock.setEndValue(1.0)
        self._clock.setDuration(MILLISECONDS)
        self._clock.setEasingCurve(QEasingCurve.Type.InOutCubic)
        self._clock.valueChanged.connect(self._tick)
        self._clock.finished.connect(self.stop)

    def to(self, view: View) -> None:
        """Go there; the pixels stay the session's."""
        self.stop()
        now = self._session.view
        view = view.sized(now.width, now.height)
        if view == now:
            return
        if not self.animated:
            self._feed.step()
            self._session.look(view)
            return
        self.goal, self._start, self._last = view, now, now
        self._feed.hold()
        self._clock.start()

    def stop(self) -> None:
        """Stay where it has come to."""
        if self.goal is not None:
            self.goal = None
            self._clock.stop()
            self._feed.release()

    def _tick(self, share: float) -> None:
        goal, now = self.goal, self._session.view
        if goal is None:
            return
        if now.sized(goal.width, goal.height) != self._last.sized(goal.width, goal.height):
            self.stop()  # somebody else looked elsewhere
            return
        self._last = between(self._start, goal, share).sized(now.width, now.height)
        self._session.look(self._last)


def between(start: View, goal: View, share: float) -> View:
    """The view a `share` of the way: around the target where both have the same one."""
    if share <= 0 or share >= 1:
        return start if share <= 0 else goal
    rotation = slerp(start.transform.rotation, goal.transform.rotation, share)
    focus = float(np.exp((1 - share) * np.log(start.focus) + share * np.log(goal.focus)))
    target = (1 - share) * np.array(start.target) + share * np.array(goal.target)
    turned = dataclasses.replace(goal, transform=Transform(rotation=rotation))
    eye = target + axes_of(turned)[2] * focus
    fov = (1 - share) * start.fov + share * goal.fov
    return dataclasses.replace(goal, transform=Transform(vec3(eye), rotation), fov=fov, focus=focus)


def slerp(a: Quat, b: Quat, share: float) -> Quat:
    """The rotation a `share` of the shorter way from `a` to `b` (Shoemake 1985)."""
    start, end = np.array(a), np.array(b)
    cosine = float(start @ end)
    if cosine < 0:
        end, cosine = -end, -cosine
    angle = np.arccos(min(cosine, 1.0))
    if angle < 1e-6:
        made = (1 - share) * start + share * end
    else:
        made = (np.sin((1 - share) * angle) * start + np.sin(share * angle) * end) / np.sin(angle)
    w, x, y, z = (float(v) for v in made)
    return normalized((w, x, y, z))
