"""Who computes when: the newest request, on one compute thread, without losing what is still good.

A running job is cancelled only when a new change dirties a stage at or before the one it is in; otherwise
it finishes and the newest request runs next. Everything here but `_run` happens on the thread that made
the scheduler; results come back through the injected `post`.
"""

from __future__ import annotations

import logging
import queue
import threading
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any, Protocol

from studio_core.errors import Cancelled
from studio_core.scene.diff import Changes
from studio_core.shading.frame import Frame
from studio_core.shading.job import Job
from studio_core.shading.pipeline import Pipeline
from studio_core.signal import Signal

log = logging.getLogger(__name__)
_LONGEST_WAIT = 30.0  # seconds that a program's end waits for work that was asked to stop


class Executor(Protocol):
    """Runs callables one after the other."""

    def submit(self, work: Callable[[], None]) -> None:
        """Run `work` later, or now."""
        ...

    def close(self) -> None:
        """Wait for what runs, refuse what comes."""
        ...


class InlineExecutor:
    """Runs at once on the calling thread: scripts, the command line, tests."""

    def submit(self, work: Callable[[], None]) -> None:
        """Run `work` now."""
        work()

    def close(self) -> None:
        """Nothing to wait for."""


class ComputeThread:
    """The one thread that owns pipelines and kernels."""

    def __init__(self) -> None:
        self._queue: queue.SimpleQueue[Callable[[], None] | None] = queue.SimpleQueue()
        self._thread = self._start()

    def submit(self, work: Callable[[], None]) -> None:
        """Run `work` after what is already waiting."""
        self._queue.put(work)

    def close(self) -> None:
        """Wait for what runs, but not for ever: the process ends without a thread that never does."""
        self._queue.put(None)
        self._thread.join(_LONGEST_WAIT)

    def renew(self) -> None:
        """Do what waits, and what comes, on another thread: this one does not come back."""
        stuck, self._queue = self._queue, queue.SimpleQueue()
        with suppress(queue.Empty):
            while True:
                self._queue.put(stuck.get_nowait())
        stuck.put(None)
        self._thread = self._start()

    def _start(self) -> threading.Thread:
        thread = threading.Thread(target=self._loop, args=(self._queue,), name="compute", daemon=True)
        thread.start()
        return thread

    def _loop(self, waiting: queue.SimpleQueue[Callable[[], None] | None]) -> None:
        while (work := waiting.get()) is not None:
            try:
                work()
            except BaseException:  # whoever submitted it should have caught it; others still need the thread
                log.exception("work on the compute thread failed")


def _attempt(job: Job, work: Callable[[], Any]) -> tuple[Any, Exception | None]:
    """What `work` gives, or its error; the job is over then."""
    try:
        return work(), None
    except Exception as error:
        return None, error
    except SystemExit as error:  # a plugin must not take the program down
        return None, RuntimeError(f"a stage tried to leave the program: {error}")
    finally:
        job.ended = True


def _tell_cancelled(question: _Question) -> None:
    question.job.cancel()
    question.done(None, Cancelled(question.job.label))


@dataclass(frozen=True)
class _Question:
    """Work on what the pipeline has made, who is told of its result or its error, and when it can begin."""

    work: Callable[[Pipeline, Job], Any]
    done: Callable[[Any, Exception | None], None]
    ready: Callable[[Pipeline], bool]
    job: Job


@dataclass(frozen=True)
class _Spare:
    """Work for when nothing waits, and who is told of its result."""

    label: str
    work: Callable[[Frame, Job], Any]
    done: Callable[[Frame, Any], None] | None
    again: Callable[[Any], bool] = lambda result: False


class Scheduler:
    """Feeds one pipeline with frames.

    `shown(frame, artifact, final)` gives partial and final results, never one older than the last shown;
    `failed(frame, error)`; `progress(job)`; `idle()` when nothing is left to do. All on the owner's thread.

    `spare(pipeline, frame, job)` is run when a frame is finished and nothing waits, such as the error
    meter; its result comes as `measured(frame, result)`. If it `completes`, the pipeline then does what no
    picture needs yet; after that the spare runs `again` while its result asks for it. Any request cancels
    either.

    Questions (`ask`) are answered between frames, in turn with them. Spare work and further rounds of a frame
    at rest make way for them, and go on afterwards; so does its first round for a question that is `ready`.
    """

    def __init__(
        self,
        pipeline: Pipeline,
        executor: Executor,
        post: Callable[[Callable[[], None]], None] = lambda call: call(),
        label: str = "Shading",
        spare: Callable[[Pipeline, Frame, Job], Any] | None = None,
        completes: bool = False,
        again: Callable[[Any], bool] = lambda result: False,
    ) -> None:
        self.shown: Signal[[Frame, Any, bool]] = Signal()
        self.failed: Signal[[Frame, Exception]] = Signal()
        self.progress: Signal[[Job]] = Signal()
        self.measured: Signal[[Frame, Any]] = Signal()
        self.idle: Signal[[]] = Signal()
        self.pipeline = pipeline
        self.label = label
        self.cancelled_jobs = 0
        self.finished_jobs = 0
        self._executor = executor
        self._post = post
        self._revision = 0
        self._last_shown = 0
        self._job: Job | None = None
        self._waiting: tuple[Frame, Changes] | None = None
        self._closed = False
        self._spare = spare
        self._completes = completes
        self._again = again
        self._spare_job: Job | None = None
        self._left: tuple[Frame, tuple[_Spare, ...]] | None = None  # what made way for a question
        self._questions: dict[str, _Question] = {}
        self._asked: tuple[str, _Question] | None = None  # is being answered
        self._frames_turn = False
        self._makes_way = False

    @property
    def busy(self) -> bool:
        """Whether a job runs or waits."""
        return self._job is not None or self._waiting is not None

    @property
    def job(self) -> Job | None:
        """What runs now."""
        return self._job

    def request(self, frame: Frame, changes: Changes) -> int:
        """Ask for a picture of `frame`, in which `changes` happened since the last request; its revision."""
        if self._closed:
            return self._revision
        self._revision += 1
        frame = replace(frame, revision=self._revision)
        if self._waiting is not None:
            changes = self._waiting[1] | changes
        self._waiting = (frame, changes)
        self._left = None
        if self._asked is not None:
            return self._revision
        if self._job is None:
            self._start()
        elif self._job is self._spare_job or self.pipeline.dirties(changes, self.pipeline.current):
            self._job.cancel()
        return self._revision

    def ask(
        self,
        name: str,
        work: Callable[[Pipeline, Job], Any],
        done: Callable[[Any, Exception | None], None],
        ready: Callable[[Pipeline], bool] = lambda pipeline: False,
    ) -> Job:
        """Do `work(pipeline, job)` on the executor between frames; then `done(result, error)` here.

        A newer question of the same name cancels an older one, which is then told Cancelled. `ready`, asked
        on the executor, tells of a frame under way whether enough of it is made.
        """
        job = Job(name, on_progress=lambda j: self._post(lambda: self.progress.emit(j)))
        asked = self._questions.pop(name, None)
        if asked is not None:
            _tell_cancelled(asked)
        elif self._asked is not None and self._asked[0] == name:
            self._asked[1].job.cancel()
        question = self._questions[name] = _Question(work, done, ready, job)
        if self._closed:
            del self._questions[name]
            _tell_cancelled(question)
        elif self._job is None and self._asked is None:
            self._go_on()
        else:
            self._make_way()
        return job

    def _make_way(self) -> None:
        """What is not urgent stops where a question waits; it goes on after the answer."""
        refines = self._job is not self._spare_job and self.pipeline.rounds > 0
        if self._questions and self._job is not None and (self._job is self._spare_job or refines):
            self._makes_way = True
            self._job.cancel()

    def _answer(self) -> None:
        name = next(iter(self._questions))
        question = self._questions.pop(name)
        self._asked, self._frames_turn = (name, question), True

        def run() -> None:
            def work() -> Any:
                question.job.checkpoint()
                return question.work(self.pipeline, question.job)

            result, error = _attempt(question.job, work)
            self._post(lambda: finish(result, error))

        def finish(result: Any, error: Exception | None) -> None:
            self._asked = None
            try:
                question.done(result, error)
            finally:
                if self._asked is None and self._job is None:
                    self._go_on()

        self._executor.submit(run)

    def cancel(self) -> None:
        """Stop what runs and forget what waits; its changes are kept for the next request."""
        self._left = None
        if self._waiting is not None:
            frame, changes = self._waiting
            self._waiting = None
            self._executor.submit(lambda: self.pipeline.mark(frame, changes))
        if self._job is not None:
            self._job.cancel()

    def close(self) -> None:
        """Cancel and take no more requests."""
        self._closed = True
        self.cancel()
        asked, self._questions = self._questions, {}
        for question in asked.values():
            _tell_cancelled(question)
        if self._asked is not None:
            self._asked[1].job.cancel()

    def _checkpoint(self, frame: Frame, job: Job) -> None:
        """On the executor: the first round of a frame at rest makes way as soon as a question is ready."""
        asked = () if frame.moving or self.pipeline.rounds else tuple(self._questions.values())
        if any(question.ready(self.pipeline) for question in asked):
            self._makes_way = True
            job.cancel()
        self._post(lambda: self._progressed(job))

    def _progressed(self, job: Job) -> None:
        self.progress.emit(job)
        if job is self._job:
            self._make_way()

    def _start(self) -> None:
        assert self._waiting is not None
        (frame, changes), self._waiting = self._waiting, None
        self._frames_turn = False
        job = Job(
            self.label,
            on_progress=lambda j: self._checkpoint(frame, j),
            on_publish=lambda artifact: self._post(lambda: self._show(frame, artifact, False)),
        )
        self._job = job
        self._executor.submit(lambda: self._run(frame, changes, job))

    def _run(self, frame: Frame, changes: Changes, job: Job) -> None:
        result, error = _attempt(job, lambda: self.pipeline.update(frame, changes, job))
        self._post(lambda: self._finish(frame, job, result, error))

    def _finish(self, frame: Frame, job: Job, result: Any, error: Exception | None) -> None:
        self._job = None
        made_way, self._makes_way = self._makes_way, False
        try:
            if isinstance(error, Cancelled):
                self.cancelled_jobs += 1
                if made_way and self._waiting is None and not self._closed:
                    self._waiting = (frame, Changes())
            elif error is not None:
                self.failed.emit(frame, error)
            else:
                self.finished_jobs += 1
                self._show(frame, result, True)
        finally:  # a receiver that fails stops nothing
            if error is None and self._waiting is None and self._job is None and not self._closed:
                self._spare_time(frame, self._spare_steps())
            else:
                self._go_on()

    def _go_on(self) -> None:
        if self._asked is not None or self._job is not None:
            return
        if self._questions and not (self._frames_turn and self._waiting is not None):
            self._answer()
        elif self._waiting is not None and not self._closed:
            self._start()
        elif self._left is not None:
            (frame, steps), self._left = self._left, None
            self._spare_time(frame, steps)
        else:
            self.idle.emit()

    def _spare_time(self, frame: Frame, steps: tuple[_Spare, ...]) -> None:
        """Runs the first of the steps, then the others, while nobody asks for anything."""
        if not steps or self._questions or self._asked is not None:
            self._left = (frame, steps) if steps else None
            self._go_on()
            return
        step, rest = steps[0], steps[1:]
        job = Job(step.label, on_progress=lambda j: self._post(lambda: self.progress.emit(j)))
        self._job = self._spare_job = job

        def run() -> None:
            result, error = _attempt(job, lambda: step.work(frame, job))
            self._post(lambda: finish(result, error))

        def finish(result: Any, error: Exception | None) -> None:
            self._job = self._spare_job = None
            made_way, self._makes_way = self._makes_way, False
            idle = error is None and self._waiting is None and not self._closed
            try:
                if error is not None and not isinstance(error, Cancelled):
                    self.failed.emit(frame, error)
                elif idle and step.done is not None:
                    step.done(frame, result)
            finally:  # a receiver may have asked for something
                if idle and self._waiting is None and self._job is None:
                    more = (step,) if step.again(result) else ()
                    self._spare_time(frame, (*rest, *more))
                else:
                    if made_way and isinstance(error, Cancelled) and self._waiting is None:
                        self._left = (frame, steps)
                    self._go_on()

        self._executor.submit(run)

    def _spare_steps(self) -> tuple[_Spare, ...]:
        steps, spare = [], self._spare
        if spare is not None:

            def measure(frame: Frame, job: Job) -> Any:
                return spare(self.pipeline, frame, job)

            steps.append(_Spare("Measuring the error", measure, self.measured.emit, self._again))
        if self._completes:
            steps.append(_Spare("Looking at hidden places", self.pipeline.complete, None))
        return tuple(steps)

    def _show(self, frame: Frame, artifact: Any, final: bool) -> None:
        if frame.revision >= self._last_shown and not self._closed:
            self._last_shown = frame.revision
            self.shown.emit(frame, artifact, final)
