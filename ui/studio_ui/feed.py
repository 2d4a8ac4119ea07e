"""From changes of document and session to pictures: what to ask the scheduler for, and how finely.

While somebody drags or looks around, pictures are unsmoothed, as small as they must be to come quickly, and
each is asked for as soon as the last was seen; at rest one full, smoothed picture follows. Single moves
and undo are shown like that too before they are exact. Where only light and materials change, what is seen
at rest stays, and no ray is traced for it again. No Qt here.
"""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
from typing import Any

from studio_core.document import Document
from studio_core.scene.diff import Aspect, Changes, everything, view_changed
from studio_core.scene.nodes import Light, Scene
from studio_core.session import Session, View
from studio_core.shading.artifacts import MeasuredError, Picture
from studio_core.shading.frame import Frame, IndirectChoice
from studio_core.shading.job import Job
from studio_core.shading.scheduler import Executor, Scheduler
from studio_core.signal import Signal
from studio_ui.lazy_pipeline import LazyPipeline, Shading
from studio_ui.pace import Pace

_SLOW = Aspect.TRANSFORM | Aspect.STRUCTURE
"""What takes long to be exact: also a single step of it, such as undo, is first seen quickly."""
_LOOKS = Aspect.MATERIAL | Aspect.STROKES | Aspect.LIGHT | Aspect.GAIN | Aspect.NAME
"""What leaves every surface where it is."""
REST_MS = 260
REST_PIXELS, REST_SAMPLES = 2_400_000, 4_500_000


Answering = Callable[[Any, Job], Any]
"""What is asked of the compute thread: with its `LazyPipeline`, and a job that tells when to stop."""


class Freshness(Enum):
    """How the picture on the screen stands to the scene."""

    NONE = "no picture yet"
    STALE = "updating"
    REFINING = "refining"
    CURRENT = "up to date"
    FAILED = "not up to date"


@dataclass(frozen=True)
class Shown:
    """What the status bar tells of a picture: seconds from the request to the picture."""

    picture: Picture
    view: View
    final: bool
    seconds: float
    moving: bool = False


class PictureFeed:
    """`shown`, `freshness`, `measured`, `failed` and `progress` are emitted on the window's thread.

    `measured` gives the error of the picture that is shown, and None as soon as another one is.
    """

    def __init__(
        self,
        document: Document,
        session: Session,
        shading: Shading,
        executor: Executor,
        post: Callable[[Callable[[], None]], None],
        later: Callable[[int, Callable[[], None]], object],
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self.shown: Signal[[Shown]] = Signal()
        self.freshness: Signal[[Freshness]] = Signal()
        self.measured: Signal[[MeasuredError | None]] = Signal()
        self.failed: Signal[[Exception]] = Signal()
        self.progress: Signal[[Job]] = Signal()
        self.state = Freshness.NONE
        self.last: Shown | None = None
        self.size = (session.view.width, session.view.height)
        self._document, self._session, self._shading = document, session, shading
        self._executor, self._post, self._later, self._clock = executor, post, later, clock
        self.pace = Pace()
        self.rest_pixels = REST_PIXELS
        self._moving = 0  # gestures under way
        self._until = 0.0  # single steps (wheel, keys) count as moving until then
        self._changes = Changes()
        self._queued = self._closed = self._rests = False
        self._answered = self._finer_only = True
        self._revision = 0
        self._outdated = 0  # pictures of revisions before this one are stale
        self._asked: dict[int, float] = {}
        self._asked_view: View | None = None
        self._glance = self._hurried = False  # one quick picture first; whether the last asked for was
        self._backend = session.backend
        self._scheduler = self._schedule()
        self._off = [document.changed.connect(self._edited), session.changed.connect(self._looked)]

    @property
    def busy(self) -> bool:
        """Whether a picture is being made or waits to be asked for."""
        return self._scheduler.busy or self._queued or (bool(self._changes) and self.last is not None)

    @property
    def job(self) -> Job | None:
        """What runs now."""
        return self._scheduler.job

    @property
    def moving(self) -> bool:
        """Whether somebody drags or looks around."""
        return self._moving > 0 or self._clock() < self._until

    def resized(self, width: int, height: int) -> None:
        """The canvas has other pixels."""
        if (width, height) != self.size and width > 0 and height > 0:
            self.size = (width, height)
            self._session.view = self._session.view.sized(width, height)
            self.step()
            self.want(view_changed())

    def show_pixels(self, count: int) -> None:
        """How many pixels a picture has at most while nothing moves."""
        if count != self.rest_pixels:
            self.rest_pixels = count
            self.step()
            self.want(view_changed())

    def hold(self) -> None:
        """A drag starts; `release` ends it."""
        self._moving += 1

    def release(self) -> None:
        """A drag has ended: a full picture follows."""
        self._moving = max(0, self._moving - 1)
        self._later(REST_MS, self._rest)

    def step(self) -> None:
        """A single step of looking around (wheel, key, resize)."""
        self._until = self._clock() + REST_MS / 1000
        self._later(REST_MS + 20, self._rest)

    def forget(self) -> None:
        """Another project: the first picture of it should come quickly."""
        self.last = None
        self._tell(Freshness.NONE)
        self.restart()

    def restart(self) -> None:
        """Ask for everything again."""
        self.want(everything(self._document.scene))

    def ask(
        self, name: str, scene: Scene, work: Answering, done: Callable[[Any, Exception | None], None]
    ) -> Job:
        """Do `work(pipeline, job)` on the compute thread between pictures; then `done(result, error)` here.

        The newest of a name wins; the others are told Cancelled. A picture at rest makes way as soon as it
        has what solvers of strokes on `scene` need.
        """

        def ready(pipeline: Any) -> bool:
            return pipeline.lit(scene) is not None

        return self._scheduler.ask(name, work, done, ready)

    def another(self) -> LazyPipeline:
        """A pipeline beside the picture's, with the session's backend; for the compute thread."""
        return LazyPipeline(self._shading, self._backend)

    def frame(self, scene: Scene, view: View, *, moving: bool = False) -> Frame:
        """What the session asks for, of any scene and view."""
        session = self._session
        by_name = session.indirect_params.get(session.indirect, {})
        choice = IndirectChoice(session.indirect, by_name) if session.bouncing else None
        return Frame(scene, view, session.params, 0, moving, indirect=choice, light=session.light)

    @property
    def at_rest(self) -> bool:
        """Whether what is shown is the scene as it is now, lit as at rest, be it refined yet."""
        refining = self.state is Freshness.REFINING and self.last is not None and not self.last.moving
        return self.state is Freshness.CURRENT or refining

    def cancel(self) -> None:
        """Stop and keep what is shown."""
        self._changes = Changes()
        self._scheduler.cancel()
        self._tell(Freshness.FAILED if self.state is Freshness.STALE else self.state)

    def want(self, changes: Changes, *, finer: bool = False) -> None:
        """Something changed (or the same picture is wanted `finer`): ask soon, once for all until then."""
        if self._closed:
            return
        self._changes |= changes
        self._finer_only = finer and self._finer_only
        gentle = finer and self.state in (Freshness.CURRENT, Freshness.REFINING)
        self._tell(Freshness.REFINING if gentle else Freshness.STALE)
        if not self._queued:
            self._queued = True
            self._later(0, self._flush)

    def frame_view(self, moving: bool) -> View:
        """The session's view in the pixels and samples that are right while moving, or at rest."""
        width, height = self.size
        limit = self.pace.pixels if moving else self.rest_pixels
        shrink = min(1.0, (limit / (width * height)) ** 0.5)
        view = self._session.view.sized(round(width * shrink), round(height * shrink))
        smooth = not moving and view.width * view.height * 4 <= REST_SAMPLES
        return dataclasses.replace(view, antialias=2 if smooth else 1, fine_edges=not moving)

    def close(self) -> None:
        """Stop listening, cancel, show nothing more."""
        self._closed = True
        for off in self._off:
            off()
        self._scheduler.close()

    def _schedule(self) -> Scheduler:
        pipeline: Any = LazyPipeline(self._shading, self._backend)
        given = (pipeline, self._executor, self._post)
        scheduler = Scheduler(*given, spare=self._spare, completes=True, again=_unsure)
        scheduler.shown.connect(self._show)
        scheduler.failed.connect(self._fail)
        scheduler.progress.connect(self.progress.emit)
        scheduler.idle.connect(self._idle)
        scheduler.measured.connect(self._measured)
        return scheduler

    def _spare(self, pipeline: Any, frame: Frame, job: Job) -> MeasuredError | None:
        """On the compute thread: nothing is measured while somebody drags or looks around."""
        found: MeasuredError | None = None if self.moving else pipeline.measure(frame, job)
        return found

    def _measured(self, frame: Frame, error: MeasuredError | None) -> None:
        if self.last is not None and self.last.view == frame.view:
            self.measured.emit(error)

    def _edited(self, before: Scene, after: Scene, changes: Changes) -> None:
        if changes.aspects & ~Aspect.NAME:
            self._glance |= bool(changes.aspects & _SLOW) and self.last is not None
            self.want(changes)

    def _looked(self, aspect: Aspect) -> None:
        if self._session.backend != self._backend:
            self._scheduler.close()
            self._backend = self._session.backend
            self._answered, self._asked, self._outdated = True, {}, 0
            self._revision = 0
            self._scheduler = self._schedule()
            self.restart()
        self.want(view_changed(aspect))

    def _flush(self) -> None:
        self._queued = False
        if self._closed or not self._changes:
            return
        if self.last is None and not self._document.scene.nodes:
            return  # there is nothing to see; the changes are kept
        moving = self.moving or self._glance
        if moving and self._hurried and self._scheduler.busy and not self._answered:
            return  # let one quick picture be seen before asking for the next
        changes, self._changes = self._changes, Changes()
        self._answered = False
        self._glance, self._hurried = False, moving
        quick = moving or self.last is None
        if quick and self._keeps(changes):
            quick = False
        view = self.frame_view(quick)
        if view != self._asked_view:  # other pixels concern stages as another eye does
            changes, self._asked_view = changes | view_changed(), view
        frame = self.frame(self._document.scene, view, moving=moving)
        asked, finer_only, self._finer_only = self._clock(), self._finer_only, True
        revision = self._revision = self._revision + 1  # as the scheduler counts
        self._asked[revision] = asked
        self._outdated = self._outdated if finer_only else revision
        self._scheduler.request(frame, changes)

    def _keeps(self, changes: Changes) -> bool:
        """Whether a moving picture has the pixels and samples of rest, which were traced already."""
        scene = self._document.scene
        lamps = all(isinstance(scene.nodes.get(node), Light) for node in changes.of(Aspect.TRANSFORM))
        still = not changes.aspects & ~(_LOOKS | (Aspect.TRANSFORM if lamps else Aspect.NONE))
        traced = self.last is not None and self._asked_view == self.frame_view(False)
        return still and traced and self.pace.keeps

    def _rest(self) -> None:
        if self._closed or self.moving:
            return
        if self._scheduler.busy and not self._answered:
            self._rests = True  # first let the quick picture be seen
            return
        self._rests = False
        if self.last is None or self._coarse(self.last) or self._changes:
            self.want(view_changed(), finer=True)

    def _coarse(self, shown: Shown | Frame) -> bool:
        """Whether a picture at rest is more exact, or has other pixels or samples."""
        rest, view = self.frame_view(False), shown.view
        asked = (rest.width, rest.height, rest.antialias, rest.fine_edges)
        return shown.moving or (view.width, view.height, view.antialias, view.fine_edges) != asked

    def _show(self, frame: Frame, picture: Picture, final: bool) -> None:
        self._answered = True
        asked = self._asked.get(frame.revision, self._clock())
        self._asked = {r: t for r, t in self._asked.items() if r >= frame.revision}
        self.last = Shown(picture, frame.view, final, self._clock() - asked, frame.moving)
        if frame.moving and final:
            self.pace.took(self.last.seconds, kept=frame.view.fine_edges)
        elif not frame.moving:
            self.pace.rest()
        self.shown.emit(self.last)
        self.measured.emit(None)
        if frame.revision < self._outdated or (self._changes and not self._finer_only):
            self._tell(Freshness.STALE)
        else:
            waits = bool(self._changes) or any(r > frame.revision for r in self._asked)
            finer = waits or not final or self._coarse(frame)
            self._tell(Freshness.REFINING if finer else Freshness.CURRENT)
        if self._coarse(frame) and not self.moving and not self._changes:
            self._later(0, self._rest)
        self._again()

    def _fail(self, frame: Frame, error: Exception) -> None:
        self._answered = True
        self._tell(Freshness.FAILED)
        self.failed.emit(error)
        self._again()

    def _idle(self) -> None:
        self._answered = True
        self._again()

    def _again(self) -> None:
        if self._rests and self._answered:
            self._later(0, self._rest)
        if self._changes and not self._queued and not self._closed:
            self._queued = True
            self._later(0, self._flush)

    def _tell(self, state: Freshness) -> None:
        if state is Freshness.STALE and self.last is None:
            state = Freshness.NONE
        if state is not self.state:
            self.state = state
            self.freshness.emit(state)


def _unsure(error: MeasuredError | None) -> bool:
    return error is not None and not error.sure
