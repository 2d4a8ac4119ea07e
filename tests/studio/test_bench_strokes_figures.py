"""The paper's figures 14–22 as sessions: what each claims holds on small pictures, and is drawn as it was."""

from __future__ import annotations

import functools

import numpy as np
import pytest

from studio.bench import strokes_figures
from studio.bench.harness import Report
from studio.bench.strokes_figure_pictures import GAP, beside, painted, sheet
from studio.bench.strokes_figure_sessions import FIGURES
from studio.bench.strokes_figures import QUICK_SIZE, broken, play
from studio.headless import Headless
from studio_core.contract import Services


@pytest.fixture(scope="module")
def program(host, workers):
    made = Headless(quiet=True)
    made.__dict__.update(registry=host, services=Services(workers, host))
    return made


@pytest.fixture(scope="module")
def played(program):
    return functools.cache(lambda number: play(FIGURES[number], program, quick=True))


@pytest.mark.parametrize("number", FIGURES)
def test_what_a_figure_claims_holds(number, played):
    session = FIGURES[number]
    metrics = session.judge(played(number))
    assert set(session.limits) == set(metrics)
    assert broken(session, metrics) == {}


def test_the_bench_plays_those_that_are_asked_for(program, monkeypatch):
    monkeypatch.setattr(strokes_figures, "QUICK_SIZE", (48, 36))
    report = Report("strokes", True, "figure-20")
    strokes_figures.run(report, program)
    assert {row.case for row in report.rows} == {"figure-20"}
    assert {row.metric for row in report.rows} == {*FIGURES[20].limits, "holds"}


def test_a_figure_shows_what_was_painted_between_before_and_after(played):
    width, height = QUICK_SIZE
    made = sheet(FIGURES[20], played(20))
    assert made.shape == (height, 3 * width + 2 * GAP, 3)
    under = played(20).masks[0] > 0.9
    first, second, third = (
        made[:, x : x + width][under].mean() for x in (i * (width + GAP) for i in range(3))
    )
    assert second > third > first


def test_what_stays_has_stripes_and_what_is_wanted_has_none():
    shown = np.full((40, 40, 3), 0.2, np.float32)
    mask = np.zeros((40, 40), np.float32)
    mask[10:30, 10:30] = 1
    assert len(np.unique(painted(shown, shown, mask)[12:28, 12:28, 2])) == 2
    other = np.where(mask[..., None] > 0, np.float32(0.6), shown)
    assert (painted(shown, other, mask)[12:28, 12:28] == np.float32(0.6)).all()
    assert (painted(shown, other, mask)[:8] == shown[:8]).all()


def test_parts_stand_beside_each_other_with_white_between():
    made = beside([np.zeros((3, 4, 3), np.uint8)] * 3)
    assert made.shape == (3, 12 + 2 * GAP, 3)
    assert (made[:, 4 : 4 + GAP] == 255).all()
    assert beside([np.zeros((3, 4, 3), np.uint8)] * 2, axis=0).shape == (6 + GAP, 4, 3)
