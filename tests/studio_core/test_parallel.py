"""Chunks on threads: same bits for any number of threads, errors and cancelling without leftovers."""

from __future__ import annotations

import gc
import threading
import weakref

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from studio_core.errors import Cancelled
from studio_core.parallel import Workers


class Job:
    """Counts checkpoints and cancels at the `cancel_at`-th."""

    def __init__(self, cancel_at: int | None = None):
        self.seen: list[tuple[int, int]] = []
        self.threads: set[int] = set()
        self.cancel_at = cancel_at

    def checkpoint(self, done: int, total: int, /) -> None:
        self.seen.append((done, total))
        self.threads.add(threading.get_ident())
        if self.cancel_at is not None and len(self.seen) > self.cancel_at:
            raise Cancelled


@settings(max_examples=60, deadline=None)
@given(count=st.integers(0, 200), chunk=st.integers(1, 70), threads=st.integers(1, 4))
def test_every_item_is_done_once_in_fixed_chunks(count: int, chunk: int, threads: int) -> None:
    visits = np.zeros(count, np.int64)
    bounds: list[tuple[int, int]] = []

    def body(start: int, stop: int) -> None:
        visits[start:stop] += 1
        bounds.append((start, stop))

    job = Job()
    with Workers(threads) as workers:
        workers.run(count, chunk, body, job)
    assert (visits == 1).all()
    assert sorted(bounds) == [(i, min(i + chunk, count)) for i in range(0, count, chunk)]
    assert job.threads <= {threading.get_ident()}
    if count:
        assert job.seen[0] == (0, count)
        assert job.seen[-1] == (count, count)
        assert [done for done, _ in job.seen] == sorted(done for done, _ in job.seen)


def test_helpers_take_part() -> None:
    meeting = threading.Barrier(2, timeout=60)
    names = []

    def body(start: int, stop: int) -> None:
        names.append(threading.current_thread().name)
        meeting.wait()  # passes only when two threads are inside at once

    with Workers(2) as workers:
        workers.run(2, 1, body)
    assert len(set(names)) == 2


def test_cancelling_starts_no_further_chunk_and_waits() -> None:
    inside = 0
    started: list[int] = []
    lock = threading.Lock()

    def body(start: int, stop: int) -> None:
        nonlocal inside
        with lock:
            inside += 1
            started.append(start)
        threading.Event().wait(0.002)
        with lock:
            inside -= 1

    with Workers(2) as workers:
        with pytest.raises(Cancelled):
            workers.run(1000, 1, body, Job(cancel_at=3))
        assert inside == 0
        after = len(started)
        assert after < 1000
        workers.run(2, 1, body)
        assert len(started) == after + 2


def test_cancelled_before_the_start_does_nothing_on_one_thread() -> None:
    with Workers(1) as workers, pytest.raises(Cancelled):
        workers.run(10, 1, lambda start, stop: pytest.fail("started"), Job(cancel_at=0))


@pytest.mark.parametrize("threads", [1, 2, 3])
def test_the_first_chunks_error_is_raised(threads: int) -> None:
    def body(start: int, stop: int) -> None:
        if start >= 5:
            raise ValueError(f"chunk {start}")

    with Workers(threads) as workers:
        for _ in range(20):
            with pytest.raises(ValueError, match="chunk 5"):
                workers.run(8 if threads == 1 else 6, 1, body)
        workers.run(5, 1, body)  # usable afterwards


def test_runs_inside_runs_work_on_the_spot() -> None:
    table = np.zeros((6, 10), np.int64)

    with Workers(2) as workers:

        def outer(start: int, stop: int) -> None:
            def inner(first: int, last: int) -> None:
                table[start, first:last] += 1

            workers.run(10, 3, inner)

        workers.run(6, 1, outer)
    assert (table == 1).all()


def test_two_threads_may_run_at_once() -> None:
    totals = [0, 0]
    lock = threading.Lock()

    with Workers(2) as workers:

        def use(which: int) -> None:
            def body(start: int, stop: int) -> None:
                with lock:
                    totals[which] += stop - start

            for _ in range(50):
                workers.run(40, 3, body)

        other = threading.Thread(target=use, args=(1,))
        other.start()
        use(0)
        other.join()
    assert totals == [2000, 2000]


def test_closed_workers_say_so_and_leave_no_thread() -> None:
    before = threading.active_count()
    workers = Workers(4)
    assert threading.active_count() == before + 3
    workers.close()
    workers.close()
    assert threading.active_count() == before
    with pytest.raises(RuntimeError, match="closed"):
        workers.run(1, 1, lambda start, stop: None)


def test_forgotten_workers_end_their_threads() -> None:
    workers = Workers(3)
    helpers = workers._helpers
    gone = weakref.ref(workers)
    del workers
    gc.collect()
    assert gone() is None
    for helper in helpers:
        helper.join(timeout=60)
        assert not helper.is_alive()


def test_what_a_body_holds_is_released() -> None:
    class Held:
        pass

    with Workers(2) as workers:
        held = Held()
        gone = weakref.ref(held)
        workers.run(4, 1, lambda start, stop, held=held: None)  # type: ignore[misc]
        del held
        gc.collect()
        assert gone() is None


@pytest.mark.parametrize("arguments", [(0,), (-1,)])
def test_senseless_numbers_are_refused(arguments: tuple[int]) -> None:
    with pytest.raises(ValueError, match="at least one"):
        Workers(*arguments)
    with Workers(1) as workers, pytest.raises(ValueError, match="at least one"):
        workers.run(1, arguments[0], lambda start, stop: None)
