"""Progress over stages, and stages that are not run again."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from studio_core.errors import Cancelled
from studio_core.shading.job import Job
from studio_plugins.capture.progress import Kept, StageJob


@given(st.lists(st.tuples(st.integers(0, 3), st.integers(0, 20), st.integers(0, 10)), max_size=30))
def test_progress_never_goes_back_and_ends_within(steps: list[tuple[int, int, int]]) -> None:
    seen: list[float] = []
    whole = Job("Capture", lambda job: seen.append(job.done / job.total))
    for stage, done, total in steps:
        StageJob(whole, stage / 4, 1 / 4).checkpoint(done, total)
    assert seen == sorted(seen)
    assert all(0 <= part <= 1 for part in seen)


def test_a_cancelled_job_stops_in_its_stage() -> None:
    whole = Job("Capture")
    stage = StageJob(whole, 0.5, 0.5)
    stage.checkpoint(1, 2)
    stage.cancel()
    assert whole.cancelled
    with pytest.raises(Cancelled):
        stage.checkpoint(2, 2)


def test_a_stage_is_run_again_only_where_its_inputs_differ() -> None:
    kept, picture = Kept(), object()
    for _ in range(2):
        kept.get("merge", (picture, 1.0), lambda: "a")
    assert kept.made == ["merge"]
    assert kept.get("merge", (picture, 2.0), lambda: "b") == "b"
    assert kept.get("merge", (object(), 2.0), lambda: "c") == "c"
    assert kept.made == ["merge"] * 3


def test_a_stage_that_fails_keeps_nothing() -> None:
    kept = Kept()

    def fail() -> np.ndarray:
        raise Cancelled("x")

    kept.get("merge", (1,), lambda: np.ones(3))
    with pytest.raises(Cancelled):
        kept.get("merge", (2,), fail)
    kept.get("merge", (2,), lambda: np.ones(3))
    assert kept.made == ["merge"] * 3
