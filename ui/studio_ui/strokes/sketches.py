"""Small pictures of what other reasons would look like: shaded in idle time, around the stroke alone."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from PySide6.QtCore import QObject, QTimer

from studio_core.errors import EditError
from studio_core.scene.diff import Aspect, Changes, diff, view_changed
from studio_core.scene.nodes import NodeId, Scene
from studio_core.scene.transform import looking
from studio_core.session import Session, View
from studio_core.shading.artifacts import Picture
from studio_core.shading.frame import Frame
from studio_core.shading.job import Job
from studio_core.strokes.solution import Reason
from studio_core.strokes.stroke import Stroke
from studio_ui.context import Context, Subscriptions
from studio_ui.feed import Freshness
from studio_ui.tasks import Task

WIDTH, HEIGHT = 132, 96
_ROOM = 1.8  # times the stroke's size, that is seen
_LEAST, _MOST = 6.0, 60.0  # degrees
_WAIT_MS = 150
_KEPT = 12  # pictures


class Sketches(QObject):
    """One at a time, while the picture is up to date and `free()`; whatever is asked of pictures stops it."""

    def __init__(self, context: Context, free: Callable[[], bool] = lambda: True) -> None:
        super().__init__()
        self._context, self._free = context, free
        self._pipeline: Any = None
        self._before: Frame | None = None
        self._waiting: list[tuple[Scene, NodeId, Reason, Callable[[Picture], object]]] = []
        self._task: Task | None = None
        self._kept: dict[int, _Kept] = {}  # by id of the reason, the newest last
        self._soon = QTimer(self)
        self._soon.setSingleShot(True)
        self._soon.timeout.connect(self._next)
        self._subscriptions = Subscriptions()
        self._subscriptions.add(context.feed.freshness.connect(lambda _: self.follow()))

    @property
    def session(self) -> Session:
        """How pictures are shown."""
        return self._context.session

    @property
    def done(self) -> bool:
        """Whether none is wanted."""
        return self._task is None and not self._waiting

    def close(self) -> None:
        """Make no more."""
        self.forget()
        self._subscriptions.close()

    def forget(self) -> None:
        """Nobody looks any more."""
        self._waiting.clear()
        self._soon.stop()
        if self._task is not None:
            self._task.job.cancel()

    def want(self, scene: Scene, stroke: NodeId, reason: Reason, done: Callable[[Picture], object]) -> None:
        """A picture of the scene as a reason would make it, of the place of a stroke.

        One that was made of that reason is given at once; another follows if it is out of date.
        """
        kept = self._kept.get(id(reason))
        if kept is not None:
            done(kept.picture)
            if kept.shows(scene, around(scene, stroke, self._context.session.view)):
                return
        self._waiting.append((scene, stroke, reason, done))
        self.follow()

    def follow(self) -> None:
        """Begin, or make way for what comes first."""
        free, state = self._free(), self._context.feed.state
        if free and state is Freshness.CURRENT:
            self._soon.start(_WAIT_MS)
        elif self._task is not None and (not free or state is Freshness.STALE):
            self._task.job.cancel()

    def _next(self) -> None:
        now = self._free() and self._context.feed.state is Freshness.CURRENT
        if self._task is not None or not self._waiting or not now:
            return
        scene, stroke, reason, done = wish = self._waiting[0]
        view = around(scene, stroke, self._context.session.view)
        if view is None:
            del self._waiting[0]
            return
        frame = self._context.feed.frame(scene, view, moving=True)  # as exact as in the hand

        def work(job: Job) -> _Kept | None:
            try:
                other = reason.edit(scene)
            except EditError:  # the scene has changed too much since
                return None
            return _Kept(reason, other, view, self._shade(dataclasses.replace(frame, scene=other), job))

        def ended(found: _Kept | None) -> None:
            self._task = None
            if wish in self._waiting and (found is not None or not cancelled()):
                self._waiting.remove(wish)
            if found is not None:
                self._kept = dict([*self._kept.items(), (id(reason), found)][-_KEPT:])
                done(found.picture)
            self.follow()

        def cancelled() -> bool:
            return task.job.cancelled

        task = self._task = self._context.tasks.run(
            "Small picture",
            work,
            ended,
            lambda error: ended(None),
            quiet=True,
            executor=self._context.compute,
        )

    def _shade(self, frame: Frame, job: Job) -> Picture:
        """On the compute thread, which owns the pipeline."""
        before = self._before
        if self._pipeline is None or before is None or before.params != frame.params:
            self._pipeline, before = self._context.feed.another(), None
        changes = Changes() if before is None else diff(before.scene, frame.scene)
        if before is not None and before.view != frame.view:
            changes |= view_changed()
        self._before = frame
        made: Picture = self._pipeline.update(frame, changes, job)
        return made


@dataclass(frozen=True, eq=False)
class _Kept:
    """A picture, the reason it is of, and what it shows from where."""

    reason: Reason
    scene: Scene
    view: View
    picture: Picture

    def shows(self, scene: Scene, view: View | None) -> bool:
        """Whether it would look the same again."""
        try:
            changes = diff(self.scene, self.reason.edit(scene))
        except EditError:
            return False
        return view == self.view and not changes.aspects & ~Aspect.NAME


def around(scene: Scene, stroke: NodeId, view: View) -> View | None:
    """From where a view is, at where a stroke's marks are; None without marks."""
    node = scene.nodes.get(stroke)
    marks = node.marks if isinstance(node, Stroke) else None
    if marks is None or not isinstance(node, Stroke) or not len(marks):
        return None
    places = []
    for number, name in enumerate(node.objects):
        if name in scene.nodes:
            matrix = scene.world(name).matrix()
            places.append(marks.place[marks.object == number] @ matrix[:3, :3].T + matrix[:3, 3])
    found = np.concatenate(places) if places else np.zeros((0, 3))
    if not len(found):
        return None
    eye = np.array(view.transform.translation)
    ways = found - eye
    ways /= np.maximum(np.linalg.norm(ways, axis=1, keepdims=True), 1e-9)
    towards = ways.mean(axis=0)
    towards /= max(float(np.linalg.norm(towards)), 1e-9)
    if abs(towards[1]) > 0.999:
        towards = np.array([0.03, towards[1], 0.03])
    angle = float(np.degrees(np.quantile(np.arccos(np.clip(ways @ towards, -1, 1)), 0.95)))
    fov = float(np.clip(2 * angle * _ROOM, _LEAST, _MOST))
    return View(looking(eye, eye + towards), fov, WIDTH, HEIGHT, view.focus, antialias=2)


__all__ = ["HEIGHT", "WIDTH", "Sketches", "around"]
