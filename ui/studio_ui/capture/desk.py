"""The capture that is worked on: its settings as edits, and what the stages make of them, always the newest.

Nothing here is a widget. Everything but the work itself happens on the window's thread.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from PySide6.QtCore import QTimer

from studio_core.capturing.artifacts import CaptureState
from studio_core.capturing.edits import set_settings
from studio_core.capturing.settings import CaptureSettings, StitchSettings
from studio_core.contract import CaptureRun
from studio_core.edits import Edit
from studio_core.errors import Cancelled, LucarneError, PluginError
from studio_core.imaging.photograph import Photograph
from studio_core.scene.capture import Capture
from studio_core.scene.diff import Changes
from studio_core.scene.nodes import NodeId, Scene
from studio_core.shading.job import Job
from studio_core.shading.scheduler import ComputeThread, Executor
from studio_core.signal import Signal
from studio_ui.capture.photographs import Read, gathered
from studio_ui.context import Context, Subscriptions
from studio_ui.tasks import Task

SOON_MS = 120  # between a change and the work on it
SECTIONS = tuple(f.name for f in dataclasses.fields(CaptureSettings))
_MADE_BY = {
    "brackets": "bracket",
    "response": "radiance",
    "lights": "radiance",
    "circles": "lens",
    "registration": "registration",
    "reflections": "reflections",
    "stitched": "stitch",
    "captured": "calibration",
}
"""Of every part of a state, the section of the settings that it is made with."""
PLUGIN = "fisheye"


class CaptureDesk:
    """`changed()` when another capture, its settings or photographs are there; `told()` when results are.

    `state` keeps what earlier settings gave until something newer is there; `fresh` names the parts that
    are the newest settings'. `wanted` is whether anybody looks: without, nothing is computed.
    """

    def __init__(self, context: Context, folder: Callable[[], Path | None]) -> None:
        """`folder` is the project's."""
        self.changed: Signal[[]] = Signal()
        self.told: Signal[[]] = Signal()
        self.node: NodeId | None = None
        self.state = CaptureState()
        self.fresh: frozenset[str] = frozenset()
        self.error = ""
        self.missing: tuple[str, ...] = ()  # sentences on photographs that cannot be read
        self.task: Task | None = None
        self.executor: Executor | None = None  # a thread of its own from the first run on
        self.photographs: Mapping[str, Photograph] = {}
        self._context, self._folder = context, folder
        self.stitched_with: StitchSettings | None = None  # of the joined picture that is in `state`
        self._run: CaptureRun | None = None
        self._capture: Capture | None = None
        self._done: tuple[Any, ...] | None = None  # photographs and settings of the last run, or of this one
        self._wanted = self._closed = False
        self._timer = QTimer()
        self._timer.setSingleShot(True)
        self._timer.setInterval(SOON_MS)
        self._timer.timeout.connect(self._start)
        self._subscriptions = Subscriptions()
        self._subscriptions.add(
            context.document.changed.connect(self._edited), context.editing.settled.connect(self._schedule)
        )

    # which one

    @property
    def capture(self) -> Capture | None:
        """As it is now."""
        return self._capture

    @property
    def settings(self) -> CaptureSettings:
        """Its settings."""
        return self._capture.settings if self._capture is not None else CaptureSettings()

    @property
    def busy(self) -> bool:
        """Whether something is computed, or about to be."""
        return self.task is not None or self._timer.isActive()

    def open(self, node: NodeId | None) -> None:
        """Work on another capture, or on none."""
        if node == self.node and self._capture is not None:
            return
        self._forget()
        self.node = node
        self._follow(self._context.document.scene)
        mine = {kept.digest for kept in self._capture.photographs} if self._capture is not None else set()
        self.photographs = {n: photograph for n, photograph in self.photographs.items() if n in mine}

    def want(self, wanted: bool) -> None:
        """Somebody looks, or nobody any more: what runs is finished all the same."""
        self._wanted = wanted
        self._schedule()

    def give(self, photographs: Mapping[str, Photograph]) -> None:
        """Photographs that have just been read: they need not be read again."""
        self.photographs = {**self.photographs, **photographs}

    def close(self) -> None:
        """The window goes."""
        self._closed = True
        self._timer.stop()
        self._subscriptions.close()
        self.stop()
        if self.executor is not None:
            self.executor.close()

    # edits

    def edit(self, settings: CaptureSettings, label: str) -> Edit:
        """The edit that decides this."""
        assert self.node is not None
        return set_settings(self.node, settings, label)

    def change(self, section: str, label: str, **values: Any) -> Edit:
        """The edit of some values of a section."""
        new = dataclasses.replace(getattr(self.settings, section), **values)
        return self.edit(dataclasses.replace(self.settings, **{section: new}), label)

    def apply(self, section: str, label: str, **values: Any) -> None:
        """One step."""
        if self._capture is not None:
            self._context.editing.apply(self.change(section, label, **values))

    def begin(self, label: str) -> bool:
        """A drag starts."""
        return self._capture is not None and self._context.editing.begin(self, label)

    def preview(self, section: str, label: str, **values: Any) -> None:
        """The drag goes on."""
        if self._capture is not None:
            self._context.editing.preview(self, self.change(section, label, **values))

    def commit(self) -> None:
        """The drag is one step."""
        self._context.editing.commit(self)

    def cancel(self) -> None:
        """The drag never was."""
        self._context.editing.cancel(self)

    # following

    def _edited(self, before: Scene, after: Scene, changes: Changes) -> None:
        if self.node is not None and after.nodes.get(self.node) is not self._capture:
            self._follow(after)

    def _follow(self, scene: Scene) -> None:
        found = scene.nodes.get(self.node) if self.node is not None else None
        if not isinstance(found, Capture):
            self._forget()  # undone, or another project: it may come back, but memory is short
            self.photographs = {}
        self._capture = found if isinstance(found, Capture) else None
        self.changed.emit()
        self._schedule()

    def _schedule(self) -> None:
        """Work on the newest soon, once no drag is under way."""
        if not self._closed and self._wanted and self._wish() not in (None, self._done):
            self._timer.start()

    def _wish(self) -> tuple[Any, ...] | None:
        if self._capture is None or not self._capture.photographs:
            return None
        return tuple(kept.digest for kept in self._capture.photographs), self._capture.settings

    # running

    def again(self) -> None:
        """Once more: what failed or was cancelled."""
        self._done = None
        self._schedule()

    def stop(self) -> None:
        """Cancel; what is there stays."""
        if self.task is not None:
            self.task.job.cancel()

    def _start(self) -> None:
        wish = self._wish()
        if self._closed or wish == self._done or self._context.editing.busy:
            return  # while something is dragged `settled` is still to come
        if self.task is not None:
            self.task.job.cancel()
            return  # its end starts this
        capture, old = self._capture, self._done
        if capture is None or wish is None:
            return
        if old is not None and old[0] == wish[0]:
            self.fresh -= _after(old[1], wish[1])
        else:
            self.fresh = frozenset()
        self._done, self.error, self.missing = wish, "", ()
        known, kept, settings = dict(self.photographs), capture.photographs, capture.settings
        folder, run, context = self._folder(), self._run, self._context

        def work(job: Job) -> tuple[CaptureRun, CaptureState]:
            read = gathered(kept, known, folder, job)
            job.publish(read)
            running = run if run is not None else _opened(context)
            return running, running.run(read.photographs, settings, job)

        def done(result: tuple[CaptureRun, CaptureState]) -> None:
            self._run = result[0]
            self._ended(task, result[1])

        def failed(error: Exception) -> None:
            self._failed(task, error)

        self.executor = self.executor or ComputeThread()
        task = context.tasks.run(
            f"Light of {capture.name}",
            work,
            done,
            failed,
            executor=self.executor,
            published=lambda artifact: self._published(task, artifact),
        )
        if task.ended is None:
            self.task = task
        self.told.emit()

    def _published(self, task: Task, artifact: Read | CaptureState) -> None:
        if task.job.cancelled or self._closed or self._capture is None:
            return
        if isinstance(artifact, Read):
            self.photographs = {photograph.digest: photograph for photograph in artifact.photographs}
            self.missing = artifact.notes
        else:
            self.state = merged(self.state, artifact)
            self.fresh = reached(artifact)
            if "stitched" in self.fresh and self._done is not None:
                self.stitched_with = self._done[1].stitch
        self.told.emit()

    def _ended(self, task: Task, state: CaptureState) -> None:
        if task.job.cancelled:  # too late
            self._failed(task, Cancelled(task.job.label))
            return
        self.task = None
        self._published(task, state)
        self._next()

    def _failed(self, task: Task, error: Exception) -> None:
        self.task = None
        if not isinstance(error, Cancelled):
            known = isinstance(error, LucarneError)
            self.error = str(error) if known else "This did not work because of a fault: see the Log panel."
        elif self._wish() == self._done:
            self.error = "Cancelled: what is shown may be that of earlier settings."
        self._next()

    def _next(self) -> None:
        if self._closed:
            return
        self.told.emit()
        self._schedule()

    def _forget(self) -> None:
        self.stop()
        self.state, self.fresh, self.error, self.missing = CaptureState(), frozenset(), "", ()
        self._run, self._done, self._capture = None, None, None
        self.stitched_with = None


def merged(old: CaptureState, new: CaptureState) -> CaptureState:
    """The newer state, with what it has not reached yet from the older one."""
    there = reached(new)
    kept = {name: getattr(old, name) for name in _MADE_BY if name not in there}
    return dataclasses.replace(new, **kept)


def reached(state: CaptureState) -> frozenset[str]:
    """Which parts of a state are there."""
    parts = {name: getattr(state, name) for name in _MADE_BY}
    return frozenset(n for n, part in parts.items() if part is not None and part != {})


def _after(old: CaptureSettings, new: CaptureSettings) -> frozenset[str]:
    """The parts that are no longer what the settings say."""
    changed = [name for name in SECTIONS if getattr(old, name) != getattr(new, name)]
    if not changed:
        return frozenset()
    first = SECTIONS.index(changed[0])
    return frozenset(part for part, section in _MADE_BY.items() if SECTIONS.index(section) >= first)


def _opened(context: Context) -> CaptureRun:
    if context.services is None:
        raise PluginError("nothing here can make light out of photographs")
    made: CaptureRun = context.host.get("capturer", PLUGIN).open(context.services)
    return made
