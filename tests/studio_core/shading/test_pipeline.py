"""The pipeline: what reruns, what does not, and that cancelled or failed work is never forgotten."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from contextlib import suppress
from random import Random
from typing import Any

import pytest
from counting_stages import (
    Count,
    CountStage,
    Detail,
    DetailStage,
    GainsStage,
    LooksStage,
    Picture,
    PictureStage,
    Places,
    PlacesStage,
    Stage,
    StoppingJob,
    Summary,
    SummaryStage,
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
from studio_core.scene.diff import Aspect, Changes, diff, view_changed
from studio_core.scene.nodes import Group, Scene
from studio_core.scene.transform import Transform
from studio_core.session import View
from studio_core.shading.frame import Frame
from studio_core.shading.job import Job
from studio_core.shading.pipeline import MOST_ROUNDS, Inputs, Pipeline

NOTHING = Changes()


class Bench:
    """A pipeline over a scene that is edited."""

    def __init__(self, stages: list[Stage] | None = None) -> None:
        self.stages = stages or counting_stages()
        self.pipeline = Pipeline(self.stages)
        self.scene, self.view = little_scene(), View()

    def update(self, changes: Changes, job: Job | None = None) -> Any:
        return self.pipeline.update(Frame(self.scene, self.view, None), changes, job or Job("test"))

    def edit(self, edit: edits.Edit) -> Changes:
        before, self.scene = self.scene, edit(self.scene)
        return diff(before, self.scene)

    def runs(self, action: Callable[[], object]) -> list[str]:
        """Which stages ran during `action`."""
        before = [stage.runs for stage in self.stages]
        action()
        return [type(stage).__name__ for stage, n in zip(self.stages, before, strict=True) if stage.runs > n]


ALL = [type(stage).__name__ for stage in counting_stages()]
MOVE = edits.Move({"cube": Transform((1.0, 0.5, 0.0))})


def test_everything_runs_once_and_then_nothing() -> None:
    bench = Bench()
    assert bench.runs(lambda: bench.update(NOTHING)) == ALL
    first = bench.pipeline.artifact(Picture)
    assert bench.runs(lambda: bench.update(NOTHING)) == []
    assert bench.pipeline.artifact(Picture) is first
    assert [(run.ran, run.rebuilt) for run in bench.pipeline.report] == [(False, False)] * 6


@pytest.mark.parametrize(
    ("edit", "ran"),
    [
        (MOVE, ["PlacesStage", "PictureStage"]),
        (edits.SetMaterial("paint", {"base_color": (0.0, 0.0, 1.0)}), ["LooksStage", "PictureStage"]),
        (edits.SetFields("sky", {"intensity": 2.0}), ["GainsStage", "PictureStage"]),
        (edits.SetFields("sky", {"azimuth": 2.0}), ["GainsStage"]),  # cut off: same gains
        (edits.SetFields("cube", {"name": "x"}), []),
        (
            edits.Remove(("cube",)),
            ["PlacesStage", "GainsStage", "CountStage", "SummaryStage", "PictureStage"],
        ),
        (edits.Remove(("camera",)), []),  # no light meets it
        (edits.Add((Group(id="g"),)), ["PlacesStage", "GainsStage", "CountStage", "PictureStage"]),
    ],
)
def test_what_an_edit_reruns(edit: edits.Edit, ran: list[str]) -> None:
    bench = Bench()
    bench.update(NOTHING)
    changes = bench.edit(edit)
    assert bench.runs(lambda: bench.update(changes)) == ran
    assert bench.pipeline.artifact(Picture) == from_scratch(bench.scene, bench.view)


def test_a_cut_off_is_reported() -> None:
    bench = Bench()
    bench.update(NOTHING)
    bench.update(bench.edit(edits.SetFields("sky", {"azimuth": 2.0})))
    runs = {run.name: (run.ran, run.rebuilt) for run in bench.pipeline.report}
    assert runs["GainsStage"] == (True, False)
    assert runs["PictureStage"] == (False, False)


def test_changes_add_up_over_cancelled_and_failed_runs() -> None:
    bench = Bench()
    bench.update(NOTHING)
    with pytest.raises(Cancelled):
        bench.update(bench.edit(MOVE), StoppingJob(3))
    with pytest.raises(ZeroDivisionError):
        bench.update(bench.edit(edits.SetMaterial("matt", opacity=0.7)), StoppingJob(3, ZeroDivisionError))
    changes = bench.edit(edits.Move({"floor": Transform((0.0, -1.0, 0.0))}))
    assert bench.runs(lambda: bench.update(changes)) == ["PlacesStage", "LooksStage", "PictureStage"]
    assert bench.pipeline.artifact(Picture) == from_scratch(bench.scene, bench.view)


def test_finished_stages_of_a_cancelled_run_are_kept() -> None:
    bench = Bench()
    bench.update(NOTHING)
    last = bench.stages[-1]

    def cancel(stage: Stage) -> None:
        raise Cancelled

    last.interrupt = cancel
    changes = bench.edit(MOVE)
    with pytest.raises(Cancelled):
        bench.update(changes)
    last.interrupt = lambda stage: None
    assert bench.runs(lambda: bench.update(NOTHING)) == ["PictureStage"]
    assert bench.pipeline.artifact(Picture) == from_scratch(bench.scene, bench.view)


def test_the_current_stage_decides_what_a_change_disturbs() -> None:
    pipeline = Pipeline(counting_stages())
    for aspect, first in [
        (Aspect.TRANSFORM, 0),
        (Aspect.MATERIAL, 1),
        (Aspect.GAIN, 2),
        (Aspect.VIEW, 5),
        (Aspect.NAME, 6),
    ]:
        disturbed = [pipeline.dirties(view_changed(aspect), index) for index in range(6)]
        assert disturbed == [index >= first for index in range(6)]


@pytest.mark.parametrize(
    ("stages", "why"),
    [
        ([SummaryStage], "SummaryStage needs Count before it"),
        ([SummaryStage, CountStage], "SummaryStage needs Count before it"),
        ([CountStage, CountStage], "two stages give Count"),
        ([PlacesStage, PictureStage], "PictureStage needs Looks, Gains, Summary before it"),
    ],
)
def test_stages_must_fit_together(stages: list[type[Stage]], why: str) -> None:
    with pytest.raises(ValueError, match=why):
        Pipeline([stage() for stage in stages])


def test_artifacts_are_found_by_type() -> None:
    bench = Bench()
    assert bench.pipeline.artifact(Count) is None
    bench.update(NOTHING)
    assert bench.pipeline.artifact(Count) == Count(1)
    assert bench.pipeline.artifact(Places).keys() == bench.scene.nodes.keys() - {"camera"}  # type: ignore[union-attr]
    assert bench.pipeline.artifact(str) is None


# ---------------------------------------------------------------- partial results


class PublishingCount(CountStage):
    """Hands out two guesses before it is done."""

    def run(self, frame: Frame, inputs: Inputs, job: Job) -> Any:
        job.publish(Count(100))
        job.publish(Count(200))
        return super().run(frame, inputs, job)


class PublishingSummary(SummaryStage):
    """Hands out one guess."""

    def run(self, frame: Frame, inputs: Inputs, job: Job) -> Any:
        job.publish(Summary([-inputs[Count]]))
        return super().run(frame, inputs, job)


def published(stages: list[Stage]) -> tuple[list[Any], Bench]:
    heard: list[Any] = []
    bench = Bench(stages)
    bench.update(NOTHING, Job("test", on_publish=heard.append))
    return heard, bench


def test_a_partial_artifact_flows_to_the_end_and_is_not_kept() -> None:
    stages = [PlacesStage(), LooksStage(), GainsStage(), PublishingCount(), SummaryStage(), PictureStage()]
    heard, bench = published(stages)
    truth = from_scratch(bench.scene, bench.view)
    assert all(type(picture) is Picture for picture in heard)
    assert [picture[3] for picture in heard] == [Summary([100]), Summary([200])]
    assert [(*p[:3], p[4]) for p in heard] == [(*truth[:3], truth[4])] * 2
    assert bench.pipeline.artifact(Picture) == truth
    assert bench.pipeline.artifact(Summary) == Summary([1])
    assert bench.runs(lambda: bench.update(NOTHING)) == []


def test_two_publishing_stages_do_not_mix_their_artifacts() -> None:
    stages = [
        PlacesStage(),
        LooksStage(),
        GainsStage(),
        PublishingCount(),
        PublishingSummary(),
        PictureStage(),
    ]
    heard, bench = published(stages)
    assert all(type(picture) is Picture for picture in heard)
    summaries = [picture[3] for picture in heard]
    assert all(type(summary) is Summary for summary in summaries)
    assert summaries[-1] == Summary([-1])
    assert {(100,), (200,)} <= set(summaries)
    assert bench.pipeline.artifact(Picture) == from_scratch(bench.scene, bench.view)


def test_nothing_flows_where_nobody_listens() -> None:
    stages = [PlacesStage(), LooksStage(), GainsStage(), PublishingCount(), SummaryStage(), PictureStage()]
    bench = Bench(stages)
    bench.update(NOTHING)
    assert stages[-1].runs == 1


# ---------------------------------------------------------------- any sequence


class Model:
    """What must run: each stage's unseen aspects, and which inputs it last saw."""

    def __init__(self, stages: list[Stage]) -> None:
        self.unseen = dict.fromkeys(stages, Aspect.NONE)
        self.saw: dict[Stage, list[object]] = {}

    def must_run(self, stage: Stage, inputs: list[object]) -> bool:
        if stage not in self.saw or stage.dirtied_by & self.unseen[stage]:
            return True
        return any(a is not b for a, b in zip(inputs, self.saw[stage], strict=True))


@settings(max_examples=150)
@given(
    seed=st.integers(0, 2**32),
    plan=st.lists(
        st.tuples(
            st.integers(0, 3),
            st.one_of(st.just(0), st.integers(1, 18)),
            st.sampled_from([Cancelled, ZeroDivisionError]),
            st.booleans(),
        ),
        max_size=12,
    ),
)
def test_any_sequence_ends_like_a_fresh_start_and_runs_only_what_it_must(
    seed: int, plan: list[tuple[int, int, type[BaseException], bool]]
) -> None:
    rng, serial = Random(seed), 0
    bench = Bench()
    model = Model(bench.stages)
    for count, stop, error, turned in [*plan, (0, 0, Cancelled, False)]:
        changes = NOTHING
        for _ in range(count):
            serial += 1
            try:
                changes |= bench.edit(random_edit(rng, bench.scene, serial))
            except EditError:
                continue
        if turned:
            bench.view = dataclasses.replace(bench.view, fov=rng.uniform(10, 90))
            changes |= view_changed()
        for stage in bench.stages:
            model.unseen[stage] |= changes.aspects
        before = {stage: stage.runs for stage in bench.stages}
        try:
            result = bench.update(changes, StoppingJob(stop, error))
        except (Cancelled, ZeroDivisionError):
            result = None
        passed = [stage for stage, _ in zip(bench.stages, bench.pipeline.report, strict=False)]
        for stage in passed:
            inputs: list[object] = [bench.pipeline.artifact(need) for need in stage.needs]
            assert stage.runs - before[stage] == int(model.must_run(stage, inputs)), type(stage).__name__
            model.unseen[stage] = Aspect.NONE
            model.saw[stage] = inputs
        if result is not None:
            assert result == from_scratch(bench.scene, bench.view)
    assert result == from_scratch(bench.scene, bench.view)


# ---------------------------------------------------------------- rounds of refinement


class Looked(Bench):
    """A bench whose stages refine, and what it published."""

    def __init__(self) -> None:
        super().__init__(refining_stages())
        self.heard: list[Any] = []
        self.detail = next(stage for stage in self.stages if isinstance(stage, DetailStage))

    def look(self, changes: Changes = NOTHING, moving: bool = False, job: Job | None = None) -> Any:
        frame = Frame(self.scene, self.view, None, moving=moving)
        self.heard = []
        return self.pipeline.update(frame, changes, job or Job("test", on_publish=self.heard.append))

    @property
    def truth(self) -> Picture:
        return Picture([*from_scratch(self.scene, self.view), DetailStage.most])


def test_rounds_go_on_until_the_stage_is_content_and_each_is_shown() -> None:
    bench = Looked()
    last = bench.look()
    assert last == bench.truth
    assert [picture[-1] for picture in bench.heard] == [0, 1, 2]
    assert bench.pipeline.rounds == 3
    assert {run.round for run in bench.pipeline.report} == {0, 1, 2, 3}
    assert bench.detail.asked == 4
    later = [(run.name, run.ran) for run in bench.pipeline.report if run.round == 2]
    assert [name for name, ran in later if ran] == ["DetailStage", "DetailedPicture"]
    assert bench.runs(bench.look) == []
    assert bench.heard == []


def test_the_first_picture_waits_for_no_question(monkeypatch: pytest.MonkeyPatch) -> None:
    bench = Looked()
    told: list[int] = []
    real = bench.detail.again

    def again(*given: Any) -> bool:
        told.append(len(bench.heard))
        return real(*given)

    monkeypatch.setattr(bench.detail, "again", again)
    assert bench.look() == bench.truth
    assert told == [1, 1, 2, 3]
    assert [picture[-1] for picture in bench.heard] == [0, 1, 2]


def test_who_moves_waits_for_no_round() -> None:
    bench = Looked()
    assert bench.look(moving=True)[-1] == 0
    assert bench.detail.asked == 0
    assert bench.look(view_changed()) == bench.truth
    assert bench.look(bench.edit(MOVE), moving=True) == bench.truth
    assert bench.heard == []


def test_a_stage_that_is_never_content_is_stopped(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(DetailStage, "most", 1000)
    bench = Looked()
    made = bench.look()
    assert made[-1] == bench.pipeline.rounds == MOST_ROUNDS
    assert bench.look(view_changed(), moving=True)[-1] == MOST_ROUNDS


def test_rounds_show_nothing_coarser_than_what_is_shown() -> None:
    class Guessing(DetailStage):
        def run(self, frame: Frame, inputs: Inputs, job: Job) -> Any:
            job.publish(Detail(-1))
            return super().run(frame, inputs, job)

    bench = Looked()
    stages = [*(stage for stage in bench.stages if not isinstance(stage, DetailStage))]
    stages.insert(-1, Guessing())
    bench.pipeline = Pipeline(stages)
    assert bench.look() == bench.truth
    assert [picture[-1] for picture in bench.heard] == [-1, 0, 1, 2]


def test_any_change_that_concerns_a_stage_disturbs_a_round() -> None:
    bench = Looked()
    disturbed: list[tuple[int, bool, bool]] = []

    def look(stage: Stage) -> None:
        where = bench.pipeline.current
        by = [bench.pipeline.dirties(view_changed(a), where) for a in (Aspect.VIEW, Aspect.NAME)]
        disturbed.append((bench.pipeline.rounds, by[0], by[1]))

    bench.detail.interrupt = look
    bench.look()
    assert disturbed == [(0, False, False), (1, True, False), (2, True, False), (3, True, False)]


@settings(max_examples=150)
@given(
    seed=st.integers(0, 2**32),
    plan=st.lists(
        st.tuples(
            st.integers(0, 2),
            st.one_of(st.just(0), st.integers(1, 50)),
            st.sampled_from([Cancelled, ZeroDivisionError]),
            st.booleans(),
        ),
        max_size=10,
    ),
)
def test_rounds_that_are_stopped_anywhere_leave_what_came_through(
    seed: int, plan: list[tuple[int, int, type[BaseException], bool]]
) -> None:
    rng, serial = Random(seed), 0
    bench = Looked()
    for count, stop, error, moving in plan:
        changes = NOTHING
        for _ in range(count):
            serial += 1
            try:
                changes |= bench.edit(random_edit(rng, bench.scene, serial))
            except EditError:
                continue
        proven = bench.detail.proven
        try:
            made = bench.look(changes, moving, StoppingJob(stop, error))
        except (Cancelled, ZeroDivisionError):
            assert bench.detail.proven >= proven
        else:
            assert made == Picture([*bench.truth[:-1], proven if moving else DetailStage.most])
        assert bench.detail.proposed is None
    proven = bench.detail.proven
    assert bench.look(moving=True) == Picture([*bench.truth[:-1], proven])
    assert bench.look() == bench.truth


def test_scenes_of_these_tests_differ_where_pictures_do() -> None:
    scene: Scene = little_scene()
    pictures = [
        from_scratch(scene, View()),
        from_scratch(MOVE(scene), View()),
        from_scratch(scene, View(fov=30.0)),
        from_scratch(edits.SetMaterial("paint", opacity=0.7)(scene), View()),
        from_scratch(edits.SetFields("sky", {"intensity": 3.0})(scene), View()),
    ]
    assert all(a != b for i, a in enumerate(pictures) for b in pictures[:i])


@settings(max_examples=60)
@given(st.integers(0, 2**32), st.lists(st.integers(1, 14), max_size=4))
def test_what_is_settled_is_what_another_pipeline_would_make(seed: int, stops: list[int]) -> None:
    bench, random = Bench(), Random(seed)
    bench.update(NOTHING)
    for serial, stop in enumerate(stops):
        try:
            changes = bench.edit(random_edit(random, bench.scene, serial))
        except EditError:
            continue
        with suppress(Cancelled):
            bench.update(changes, StoppingJob(stop))
    fresh = Bench()
    fresh.scene = bench.scene
    fresh.update(NOTHING)
    assert bench.pipeline.frame is not None
    assert bench.pipeline.frame.scene is bench.scene or not stops
    for stage in bench.stages:
        found = bench.pipeline.settled(stage.gives)
        assert found is None or found == fresh.pipeline.artifact(stage.gives), stage.gives
    bench.update(NOTHING)
    assert all(bench.pipeline.settled(stage.gives) is not None for stage in bench.stages)


def test_nothing_is_settled_before_it_was_made() -> None:
    assert Bench().pipeline.settled(Picture) is None
    assert Bench().pipeline.settled(Scene) is None
