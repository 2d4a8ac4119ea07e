"""Jobs: progress, cancelling from anywhere, partial results."""

from __future__ import annotations

import threading

import pytest

from studio_core.errors import Cancelled
from studio_core.shading.job import Job


def test_progress_is_reported_until_it_is_cancelled() -> None:
    heard: list[tuple[int, int]] = []
    job = Job("Shade", on_progress=lambda j: heard.append((j.done, j.total)))
    job.checkpoint(1, 4)
    job.checkpoint(2, 4)
    job.cancel()
    assert job.cancelled
    for _ in range(2):
        with pytest.raises(Cancelled, match="Shade"):
            job.checkpoint(3, 4)
    assert heard == [(1, 4), (2, 4)]
    assert (job.done, job.total, job.checkpoints) == (2, 4, 4)


def test_another_thread_may_cancel() -> None:
    job = Job("Shade")
    started = threading.Event()

    def work() -> None:
        while True:
            job.checkpoint()
            started.set()

    ended: list[str] = []

    def run() -> None:
        try:
            work()
        except Cancelled as signal:
            ended.append(str(signal))

    thread = threading.Thread(target=run)
    thread.start()
    assert started.wait(30)
    job.cancel()
    thread.join(30)
    assert ended == ["Shade"]


def test_partial_results_go_to_whoever_listens() -> None:
    heard: list[object] = []
    Job("Silent").publish("nobody hears")
    job = Job("Shade", on_publish=heard.append)
    job.publish("one")
    with job.publishing(lambda artifact: f"<{artifact}>"):
        job.publish("two")
        with job.publishing(str.upper):
            job.publish("three")
        job.publish("four")
    job.publish("five")
    assert heard == ["one", "<two>", "THREE", "<four>", "five"]


def test_jobs_are_numbered_apart() -> None:
    assert len({Job("a").number for _ in range(5)}) == 5
