"""The scheduler: what is cancelled, what finishes, what is shown, and that nothing a stage does is fatal.

A manual executor runs jobs when it is told to; requests in the middle of a stage are made from inside it.
"""

from __future__ import annotations

import dataclasses
import logging
import queue
import threading
from collections import deque
from collections.abc import Callable
from random import Random
from typing import Any

import pytest
from counting_stages import (
    DetailStage,
    Picture,
    Places,
    Stage,
    counting_stages,
    from_scratch,
    refining_stages,
)
from hypothesis import given, settings
from hypothesis import strategies as st
from random_edits import random_edit
from scenes import little_scene

from studio_core import edits
from studio_core.errors import Cancelled, EditError
from studio_core.scene.diff import Changes, diff, everything, view_changed
from studio_core.scene.nodes import Scene
from studio_core.scene.transform import Transform
from studio_core.session import View
from studio_core.shading.frame import Frame
from studio_core.shading.job import Job
from studio_core.shading.pipeline import Pipeline
from studio_core.shading.scheduler import ComputeThread, InlineExecutor, Scheduler

PLACES, LOOKS, GAINS, COUNT, SUMMARY, PICTURE = range(6)


class ManualExecutor:
    """Keeps what was submitted until `step`."""

    def __init__(self) -> None:
        self.waiting: deque[Callable[[], None]] = deque()

    def submit(self, work: Callable[[], None]) -> None:
        self.waiting.append(work)

    def step(self) -> None:
        self.waiting.popleft()()

    def drain(self) -> None:
        while self.waiting:
            self.step()

    def close(self) -> None:
        self.waiting.clear()


class Bench:
    """A scheduler over a scene that is edited; remembers everything that it says."""

    def __init__(
        self, executor: Any = None, post: Any = lambda call: call(), stages: list[Stage] | None = None
    ) -> None:
        self.executor = executor or ManualExecutor()
        self.stages = stages or counting_stages()
        self.scene, self.view = little_scene(), View()
        self.scheduler = Scheduler(Pipeline(self.stages), self.executor, post)
        self.shown: list[tuple[int, Any, bool]] = []
        self.failures: list[tuple[int, Exception]] = []
        self.idle = 0
        self.scheduler.shown.connect(lambda f, a, final: self.shown.append((f.revision, a, final)))
        self.scheduler.failed.connect(lambda f, error: self.failures.append((f.revision, error)))
        self.scheduler.idle.connect(self.count_idle)

    def count_idle(self) -> None:
        self.idle += 1

    def request(self, changes: Changes) -> int:
        return self.scheduler.request(Frame(self.scene, self.view, None), changes)

    def edit(self, edit: edits.Edit) -> int:
        before, self.scene = self.scene, edit(self.scene)
        return self.request(diff(before, self.scene))

    def turn(self, fov: float) -> int:
        self.view = dataclasses.replace(self.view, fov=fov)
        return self.request(view_changed())

    def truth(self) -> Picture:
        return from_scratch(self.scene, self.view)

    def once(self, stage: int, action: Callable[[], object]) -> None:
        """Do `action` the next time that stage is in the middle of its work."""

        def act(running: Stage) -> None:
            running.interrupt = lambda _: None
            action()

        self.stages[stage].interrupt = act

    def runs(self) -> list[int]:
        return [stage.runs for stage in self.stages]


@pytest.fixture
def bench() -> Bench:
    """With a first picture."""
    made = Bench()
    made.request(Changes())
    made.executor.drain()
    assert made.shown == [(1, made.truth(), True)]
    for stage in made.stages:
        stage.runs = 0
    return made


def move(x: float) -> edits.Move:
    return edits.Move({"cube": Transform((x, 0.5, 0.0))})


def tint(red: float) -> edits.SetMaterial:
    return edits.SetMaterial("paint", {"base_color": (red, 0.0, 0.0)})


# ---------------------------------------------------------------- cancel or finish


@pytest.mark.parametrize(
    ("during", "change", "cancelled"),
    [
        (PLACES, lambda b: b.edit(move(2.0)), True),
        (PLACES, lambda b: b.edit(tint(0.5)), False),
        (PLACES, lambda b: b.turn(30.0), False),
        (LOOKS, lambda b: b.edit(move(2.0)), True),
        (LOOKS, lambda b: b.edit(tint(0.5)), True),
        (LOOKS, lambda b: b.edit(edits.SetFields("sky", {"intensity": 2.0})), False),
        (LOOKS, lambda b: b.edit(edits.SetFields("cube", {"name": "Box"})), False),
        (PICTURE, lambda b: b.turn(30.0), True),
        (PICTURE, lambda b: b.edit(edits.SetFields("cube", {"name": "Box"})), False),
    ],
)
def test_a_change_cancels_only_what_it_disturbs(
    bench: Bench, during: int, change: Callable[[Bench], object], cancelled: bool
) -> None:
    bench.once(during, lambda: change(bench))
    bench.edit(edits.Compound("Both", (move(1.0), tint(0.1))))
    before = bench.truth()
    bench.executor.step()
    assert bench.scheduler.cancelled_jobs == int(cancelled)
    assert [(r, f) for r, _, f in bench.shown[1:]] == ([] if cancelled else [(2, True)])
    if not cancelled:
        assert bench.shown[-1][1] == before
    assert bench.scheduler.busy
    bench.executor.drain()
    assert bench.shown[-1] == (3, bench.truth(), True)
    assert not bench.scheduler.busy
    assert bench.failures == []


def test_what_was_finished_before_the_cancel_is_not_done_again(bench: Bench) -> None:
    bench.once(PICTURE, lambda: bench.turn(30.0))
    bench.edit(move(1.0))
    bench.executor.drain()
    assert bench.runs() == [1, 0, 0, 0, 0, 2]


def test_requests_that_wait_become_one(bench: Bench) -> None:
    bench.once(PLACES, lambda: (bench.turn(30.0), bench.edit(tint(0.3)), bench.turn(40.0)))
    bench.edit(move(1.0))
    bench.executor.drain()
    assert [revision for revision, _, _ in bench.shown] == [1, 2, 5]
    assert bench.shown[-1][1] == bench.truth()
    assert bench.runs() == [1, 1, 0, 0, 0, 2]


def test_requests_before_the_job_began_are_not_lost(bench: Bench) -> None:
    bench.edit(move(1.0))
    bench.edit(tint(0.3))
    bench.edit(move(2.0))
    bench.executor.drain()
    assert bench.shown[-1] == (4, bench.truth(), True)
    assert bench.runs()[:3] == [1, 1, 0]


def test_cancelling_keeps_the_changes_for_later(bench: Bench) -> None:
    def cancel_with_one_waiting() -> None:
        bench.edit(tint(0.3))
        bench.scheduler.cancel()

    bench.once(PLACES, cancel_with_one_waiting)
    bench.edit(move(1.0))
    bench.executor.drain()
    assert len(bench.shown) == 1
    assert not bench.scheduler.busy
    assert bench.idle == 2
    bench.turn(33.0)
    bench.executor.drain()
    assert bench.shown[-1][1] == bench.truth()


def test_a_job_that_was_cancelled_before_it_began_forgets_nothing(bench: Bench) -> None:
    bench.edit(move(1.0))
    bench.scheduler.cancel()
    bench.executor.drain()
    assert len(bench.shown) == 1
    bench.turn(33.0)
    bench.executor.drain()
    assert bench.shown[-1][1] == bench.truth()


# ---------------------------------------------------------------- failures


@pytest.mark.parametrize("error", [ZeroDivisionError("bug"), SystemExit(3), MemoryError(), RecursionError()])
def test_a_failing_stage_is_reported_and_the_next_request_runs(bench: Bench, error: BaseException) -> None:
    def fail() -> None:
        raise error

    bench.once(LOOKS, fail)
    bench.edit(edits.Compound("Both", (move(1.0), tint(0.2))))
    bench.executor.drain()
    ((revision, told),) = bench.failures
    assert revision == 2
    assert told is error or (isinstance(error, SystemExit) and "leave the program: 3" in str(told))
    assert not bench.scheduler.busy
    assert len(bench.shown) == 1
    bench.turn(30.0)
    bench.executor.drain()
    assert bench.shown[-1][1:] == (bench.truth(), True)
    assert bench.runs() == [1, 2, 0, 0, 0, 1]


def test_a_failure_does_not_stop_what_waits(bench: Bench) -> None:
    def change_and_fail() -> None:
        bench.turn(30.0)
        raise ZeroDivisionError("bug")

    bench.once(PLACES, change_and_fail)
    bench.edit(move(1.0))
    bench.executor.drain()
    assert len(bench.failures) == 1
    assert bench.shown[-1] == (3, bench.truth(), True)


# ---------------------------------------------------------------- order of results


@pytest.mark.parametrize("error", [ValueError("bad"), SystemExit(3)])
def test_whatever_the_spare_work_does_the_next_request_runs(error: BaseException) -> None:
    bench = Bench()
    failing = [error]

    def spare(pipeline: Pipeline, frame: Frame, job: Job) -> str:
        if failing:
            raise failing.pop()
        return "measured"

    scheduler = Scheduler(Pipeline(bench.stages), bench.executor, spare=spare)
    failures: list[Exception] = []
    measured: list[object] = []
    scheduler.failed.connect(lambda _, error: failures.append(error))
    scheduler.measured.connect(lambda _, result: measured.append(result))
    for _ in range(2):
        scheduler.request(Frame(bench.scene, bench.view, None), Changes())
        bench.executor.drain()
    assert len(failures) == 1
    assert measured == ["measured"]
    assert not scheduler.busy


def test_spare_work_goes_on_after_everything_else_until_its_result_is_enough() -> None:
    bench = Bench()
    done: list[str] = []

    class Completing(Pipeline):
        def complete(self, frame: Frame, job: Job) -> None:
            done.append("hidden")

    def spare(pipeline: Pipeline, frame: Frame, job: Job) -> int:
        done.append("measured")
        return done.count("measured")

    given = (Completing(bench.stages), bench.executor)
    scheduler = Scheduler(*given, spare=spare, completes=True, again=lambda result: result < 3)
    measured: list[object] = []
    scheduler.measured.connect(lambda _, result: measured.append(result))
    scheduler.request(Frame(bench.scene, bench.view, None), Changes())
    bench.executor.drain()
    assert done == ["measured", "hidden", "measured", "measured"]
    assert measured == [1, 2, 3]
    assert not scheduler.busy


def test_a_receiver_that_fails_does_not_stop_what_waits(bench: Bench) -> None:
    def fails(*_: object) -> None:
        raise ZeroDivisionError("a bug in a panel")

    off = bench.scheduler.shown.connect(fails)
    bench.once(PICTURE, lambda: bench.edit(tint(0.7)))
    bench.edit(tint(0.5))
    with pytest.raises(ZeroDivisionError):
        bench.executor.drain()
    off()
    bench.executor.drain()
    assert not bench.scheduler.busy
    assert bench.shown[-1][1:] == (bench.truth(), True)


def test_stale_results_are_dropped() -> None:
    posted: deque[Callable[[], None]] = deque()
    bench = Bench(post=posted.append)
    publish = lambda stage: bench.scheduler.job.publish(Picture(["partial"]))  # noqa: E731
    bench.stages[PICTURE].interrupt = publish

    def deliver() -> None:
        while posted:
            posted.popleft()()

    bench.request(Changes())
    bench.executor.drain()
    late = [posted.popleft() for _ in range(len(posted) - 1)]  # all but the end of the first job
    deliver()
    bench.turn(30.0)
    bench.executor.drain()
    deliver()
    assert [(r, final) for r, _, final in bench.shown] == [(1, True), (2, False), (2, True)]
    for call in late:
        call()
    assert [(r, final) for r, _, final in bench.shown] == [(1, True), (2, False), (2, True)]


def test_partial_results_are_shown_before_the_final_one(bench: Bench) -> None:
    half = Picture(["half"])
    bench.once(PICTURE, lambda: bench.scheduler.job.publish(half))  # type: ignore[union-attr]
    bench.turn(30.0)
    bench.executor.drain()
    assert bench.shown[1:] == [(2, half, False), (2, bench.truth(), True)]


def test_progress_is_told_with_the_job(bench: Bench) -> None:
    heard: list[tuple[str, int, int]] = []
    bench.scheduler.progress.connect(lambda job: heard.append((job.label, job.done, job.total)))
    bench.turn(30.0)
    bench.executor.drain()
    assert ("Shading", 1, 2) in heard


def test_nothing_is_shown_after_closing(bench: Bench) -> None:
    bench.once(PICTURE, bench.scheduler.close)
    bench.turn(30.0)
    bench.executor.drain()
    assert bench.turn(40.0) == 2
    bench.executor.drain()
    assert len(bench.shown) == 1
    assert bench.failures == []


def test_a_receiver_may_ask_again_at_once() -> None:
    bench = Bench(InlineExecutor())
    bench.scheduler.shown.connect(lambda f, a, final: bench.turn(30.0) if f.revision < 4 else None)
    bench.request(Changes())
    assert [revision for revision, _, _ in bench.shown] == [1, 2, 3, 4]
    assert bench.shown[-1][1] == bench.truth()
    assert not bench.scheduler.busy


# ---------------------------------------------------------------- any sequence


@settings(max_examples=150)
@given(
    seed=st.integers(0, 2**32),
    plan=st.lists(
        st.one_of(
            st.sampled_from(["edit", "turn", "step", "cancel"]),
            st.tuples(st.integers(PLACES, PICTURE), st.sampled_from(["edit", "turn", "fail", "cancel"])),
        ),
        max_size=25,
    ),
)
def test_any_sequence_ends_with_the_newest_picture(seed: int, plan: list[Any]) -> None:
    rng, bench, serial = Random(seed), Bench(), 0

    def act(what: str) -> None:
        nonlocal serial
        serial += 1
        match what:
            case "edit":
                try:
                    bench.edit(random_edit(rng, bench.scene, serial))
                except EditError:
                    bench.turn(rng.uniform(10, 90))
            case "turn":
                bench.turn(rng.uniform(10, 90))
            case "step" if bench.executor.waiting:
                bench.executor.step()
            case "cancel":
                bench.scheduler.cancel()
            case "fail":
                raise ZeroDivisionError("bug")

    for step in plan:
        if isinstance(step, str):
            act(step)
        else:
            bench.once(step[0], lambda what=step[1]: act(what))
    for stage in bench.stages:
        stage.interrupt = lambda _: None
    bench.executor.drain()
    last = bench.turn(91.0)
    bench.executor.drain()
    assert bench.shown[-1] == (last, bench.truth(), True)
    revisions = [revision for revision, _, _ in bench.shown]
    assert revisions == sorted(revisions)
    assert all(str(error) == "bug" for _, error in bench.failures)
    assert not bench.scheduler.busy


# ---------------------------------------------------------------- real threads


class MainLoop:
    """Calls what other threads post, on the thread that runs it."""

    def __init__(self) -> None:
        self.calls: queue.Queue[Callable[[], None]] = queue.Queue()

    def run_until(self, done: Callable[[], bool]) -> None:
        while not done():
            self.calls.get(timeout=60)()


def test_jobs_run_on_the_compute_thread_and_results_come_back_on_ours() -> None:
    thread, loop = ComputeThread(), MainLoop()
    bench = Bench(thread, loop.calls.put)
    where: set[str] = set()
    ours: set[int] = set()
    entered, go_on = threading.Event(), threading.Event()

    def wait(stage: Stage) -> None:
        where.add(threading.current_thread().name)
        entered.set()
        assert go_on.wait(60)

    bench.stages[PLACES].interrupt = wait
    bench.scheduler.shown.connect(lambda *_: ours.add(threading.get_ident()))
    bench.request(Changes())
    assert entered.wait(60)
    bench.edit(move(1.0))  # disturbs the stage that runs
    last = bench.edit(tint(0.4))
    go_on.set()
    loop.run_until(lambda: bool(bench.shown) and bench.shown[-1][0] == last)
    assert bench.shown == [(last, bench.truth(), True)]
    assert bench.scheduler.cancelled_jobs == 1
    assert where == {"compute"}
    assert ours == {threading.get_ident()}
    bench.scheduler.close()
    thread.close()


def test_closing_waits_for_what_runs_and_ends_the_thread() -> None:
    thread = ComputeThread()
    done: list[int] = []
    for i in range(5):
        thread.submit(lambda i=i: done.append(i))  # type: ignore[misc]
    thread.close()
    assert done == [0, 1, 2, 3, 4]
    assert not any(t.name == "compute" for t in threading.enumerate())


def test_the_compute_thread_outlives_whatever_is_thrown_at_it(caplog: pytest.LogCaptureFixture) -> None:
    thread = ComputeThread()
    alive = threading.Event()

    def throw(error: BaseException) -> None:
        raise error

    with caplog.at_level(logging.ERROR):
        for error in (ZeroDivisionError("bug"), SystemExit(1), KeyboardInterrupt()):
            thread.submit(lambda error=error: throw(error))  # type: ignore[misc]
        thread.submit(alive.set)
        assert alive.wait(60)
        thread.close()
    assert len(caplog.records) == 3
    assert "bug" in caplog.text


def test_two_schedulers_share_a_thread_without_meeting() -> None:
    thread, loop = ComputeThread(), MainLoop()
    one, two = Bench(thread, loop.calls.put), Bench(thread, loop.calls.put)
    two.scene = move(3.0)(two.scene)
    one.request(Changes())
    two.request(Changes())
    loop.run_until(lambda: bool(one.shown and two.shown))
    assert one.shown == [(1, one.truth(), True)]
    assert two.shown == [(1, two.truth(), True)]
    thread.close()


def test_an_empty_scene_is_a_scene() -> None:
    bench = Bench()
    bench.scene = Scene()
    bench.request(Changes())
    bench.executor.drain()
    assert bench.shown == [(1, bench.truth(), True)]


# ---------------------------------------------------------------- rounds of refinement


def detail(bench: Bench) -> DetailStage:
    return next(stage for stage in bench.stages if isinstance(stage, DetailStage))


def test_of_all_rounds_only_the_last_is_final() -> None:
    bench = Bench(stages=refining_stages())
    bench.request(Changes())
    bench.executor.drain()
    assert [(picture[-1], final) for _, picture, final in bench.shown] == [
        (0, False),
        (1, False),
        (2, False),
        (3, True),
    ]
    assert bench.scheduler.finished_jobs == 1


def test_who_looks_around_does_not_wait_for_rounds() -> None:
    bench = Bench(stages=refining_stages())
    stage = detail(bench)

    def turn(running: Stage) -> None:
        if bench.scheduler.pipeline.rounds == 2:
            running.interrupt = lambda later: None
            bench.view = dataclasses.replace(bench.view, fov=30.0)
            bench.request(view_changed())

    stage.interrupt = turn
    bench.request(Changes())
    bench.executor.drain()
    assert bench.scheduler.cancelled_jobs == 1
    assert [(revision, picture[-1], final) for revision, picture, final in bench.shown] == [
        (1, 0, False),
        (1, 1, False),
        (2, 1, False),
        (2, 2, False),
        (2, 3, True),
    ]
    assert bench.shown[-1][1][:-1] == from_scratch(bench.scene, bench.view)


def test_names_disturb_no_round() -> None:
    bench = Bench(stages=refining_stages())
    stage = detail(bench)

    def rename(running: Stage) -> None:
        if bench.scheduler.pipeline.rounds == 1:
            running.interrupt = lambda later: None
            bench.edit(edits.SetFields("cube", {"name": "Chest"}))

    stage.interrupt = rename
    bench.request(Changes())
    bench.executor.drain()
    assert bench.scheduler.cancelled_jobs == 0
    assert [revision for revision, _, final in bench.shown if final] == [1, 2]


# ---------------------------------------------------------------- questions


class Told:
    """What was asked, and what came of it."""

    def __init__(self) -> None:
        self.results: list[Any] = []

    def __call__(self, result: Any, error: Exception | None) -> None:
        self.results.append(result if error is None else type(error))


def picture_of(pipeline: Pipeline, job: Job) -> Any:
    return pipeline.artifact(Picture)


def test_a_question_is_answered_with_what_was_last_made(bench: Bench) -> None:
    told = Told()
    bench.scheduler.ask("why", picture_of, told)
    bench.executor.drain()
    assert told.results == [bench.truth()]
    assert bench.runs() == [0] * 6
    assert bench.idle == 2


def test_questions_and_frames_take_turns(bench: Bench) -> None:
    order: list[str] = []
    bench.scheduler.shown.connect(lambda frame, artifact, final: order.append(f"frame {frame.revision}"))

    def ask(*_: object) -> None:
        if order.count("answer") < 3:
            bench.scheduler.ask("why", lambda pipeline, job: None, lambda *_: (order.append("answer"), ask()))

    bench.edit(move(1.0))
    ask()
    bench.executor.step()
    bench.edit(tint(0.2))
    bench.edit(tint(0.4))
    bench.executor.drain()
    assert order == ["frame 2", "answer", "frame 4", "answer", "answer"]
    assert bench.shown[-1] == (4, bench.truth(), True)


def test_the_newest_question_of_a_name_wins(bench: Bench) -> None:
    old, other, new = Told(), Told(), Told()
    bench.edit(move(1.0))
    bench.scheduler.ask("why", picture_of, old)
    bench.scheduler.ask("where", lambda pipeline, job: "here", other)
    bench.scheduler.ask("why", picture_of, new)
    bench.executor.drain()
    assert old.results == [Cancelled]
    assert (other.results, new.results) == (["here"], [bench.truth()])


def test_a_question_under_way_is_cancelled_by_a_newer_one(bench: Bench) -> None:
    old, new = Told(), Told()

    def work(pipeline: Pipeline, job: Job) -> None:
        bench.scheduler.ask("why", picture_of, new)
        job.checkpoint()

    bench.scheduler.ask("why", work, old)
    bench.executor.drain()
    assert old.results == [Cancelled]
    assert new.results == [bench.truth()]


def test_spare_work_and_refinement_make_way_for_questions_and_go_on() -> None:
    told: list[tuple[str, Any]] = []
    bench = Bench(stages=refining_stages())

    def spare(pipeline: Pipeline, frame: Frame, job: Job) -> str:
        if not any(what == "spare" for what, _ in told):
            told.append(("spare", None))
            scheduler.ask("why", picture_of, lambda result, error: told.append(("asked", result)))
            job.checkpoint()
        return "measured"

    scheduler = Scheduler(Pipeline(bench.stages), bench.executor, spare=spare)
    scheduler.shown.connect(lambda frame, artifact, final: told.append(("shown", final)))
    scheduler.measured.connect(lambda frame, result: told.append(("measured", result)))
    detail = next(stage for stage in bench.stages if isinstance(stage, DetailStage))

    def interrupt(stage: Stage) -> None:
        if detail.proposed is not None and not any(what == "early" for what, _ in told):
            told.append(("early", None))
            scheduler.ask("how", picture_of, lambda result, error: told.append(("early answer", error)))

    detail.interrupt = interrupt
    scheduler.request(Frame(bench.scene, bench.view, None), Changes())
    bench.executor.drain()
    names = [what for what, _ in told]
    assert names.index("early answer") == names.index("early") + 1, "it did not wait for the last round"
    assert told[-3][0] == "spare"
    assert told[-2][0] == "asked"
    assert told[-2][1][-1] == DetailStage.most
    assert told[-1] == ("measured", "measured")
    assert not scheduler.busy


@pytest.mark.parametrize("error", [ZeroDivisionError("bug"), SystemExit(3), MemoryError()])
def test_a_question_that_fails_disturbs_nothing(bench: Bench, error: BaseException) -> None:
    told = Told()

    def work(pipeline: Pipeline, job: Job) -> None:
        raise error

    bench.scheduler.ask("why", work, told)
    bench.edit(move(1.0))
    bench.executor.drain()
    assert len(told.results) == 1
    assert bench.shown[-1] == (2, bench.truth(), True)
    assert bench.failures == []


def test_who_asks_a_closed_scheduler_is_told_so(bench: Bench) -> None:
    waiting, late = Told(), Told()
    bench.edit(move(1.0))
    bench.scheduler.ask("why", picture_of, waiting)
    bench.scheduler.close()
    bench.scheduler.ask("where", picture_of, late)
    bench.executor.drain()
    assert waiting.results == late.results == [Cancelled]


@pytest.mark.parametrize(("moving", "waits"), [(False, False), (True, True)])
def test_the_first_round_at_rest_makes_way_as_soon_as_enough_is_made(
    bench: Bench, moving: bool, waits: bool
) -> None:
    order: list[str] = []
    bench.scheduler.shown.connect(lambda frame, artifact, final: order.append("frame"))

    def ready(pipeline: Pipeline) -> bool:
        return pipeline.settled(Places) is not None

    def ask() -> None:
        bench.scheduler.ask(
            "why", lambda p, job: p.settled(Places), lambda *told: order.append("answer"), ready
        )

    bench.once(PLACES, ask)
    bench.scene = edits.Compound("Both", (move(1.0), tint(0.2)))(bench.scene)
    changes = everything(bench.scene)
    bench.scheduler.request(Frame(bench.scene, bench.view, None, moving=moving), changes)
    bench.executor.drain()
    assert order == (["frame", "answer"] if waits else ["answer", "frame"])
    assert bench.shown[-1] == (2, bench.truth(), True)
    assert bench.runs()[PLACES] == 1, "what was made before the answer is not made again"
