"""The bench of how changes reach surface: all figures are there, and paint is what is wanted."""

from __future__ import annotations

import pytest

from studio.bench import strokes_spread
from studio.bench.harness import Report
from studio.headless import Headless

pytestmark = pytest.mark.slow


def test_all_figures_are_there(monkeypatch):
    for name, value in (("VERTICES", 4000), ("ELEMENTS", 800), ("MARKS", 60)):
        monkeypatch.setattr(strokes_spread, name, value)
    report = Report("strokes", True)
    program = Headless(quiet=True, threads=2)
    strokes_spread.upsampling(report, program)
    found = {row.metric: row.value for row in report.rows}
    assert {row.case for row in report.rows} == {strokes_spread.CASE}
    assert found["marks"] == 60
    assert found["error"] < 0.01
    assert found["points"] > 0
    assert {"ms", "ms_likeness", "ms_upsampling", "ms_shares", "ms_paint", "ms_lay"} <= set(found)


def test_a_case_that_is_not_asked_for_is_left_out():
    report = Report("strokes", True, only="size/else")
    strokes_spread.upsampling(report, Headless(quiet=True, threads=2))
    assert not report.rows
