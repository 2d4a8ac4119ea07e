"""Folders as strangers leave them, through the command line: what is told of the lights withheld."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from studio.bench import materials_sources as bench
from studio.bench.harness import Report
from studio.bench.lab import dome, shoot
from studio.bench.lab_surfaces import library
from studio_plugins.residual.samples import Ball


def test_brackets_counted_to_the_wrong_side_foretell_what_was_withheld(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(bench, "RIG", replace(bench.RIG, size=(90, 88), ball=Ball(45.4, 43.7, 38.0, 9.0)))
    lights = dome((-30.0, 0.0, 30.0)).some(np.arange(0, 38, 3))
    found = bench.fitted(shoot(library()["textured"], lights, bench.RIG, 3), "brackets", 16)
    assert found["holdout"]["refined"]["holdout_nmse"] < 1e-2
    assert found["holdout"]["refined"]["parametric_nmse"] > 0.03
    assert any("mirrored" in note for note in found["notes"])
    assert bench._off(found["ball"]) < 0.3


def test_rows_of_what_is_asked_for(monkeypatch: pytest.MonkeyPatch) -> None:
    told = {"holdout_nmse": 0.1, "holdout_nmse_outside": 0.1, "parametric_nmse": 0.2}
    ball = {"x": 118.4, "y": 114.8, "radius": 104.7}
    found: dict[str, Any] = {"holdout": {"refined": told, "as_given": told}, "ball": ball, "seconds": 1.0}
    monkeypatch.setattr(bench, "shoot", lambda *_: None)
    monkeypatch.setattr(bench, "fitted", lambda *_: found)
    report = Report("materials", False, "sources/*/jpeg")
    bench.run(report)
    assert {row.case for row in report.rows} == {"sources/textured/jpeg", "sources/glossy/jpeg"}
    rows = {row.metric: row.value for row in report.rows}
    assert rows["ball_off"] == pytest.approx(0.5)
    assert {"holdout_nmse", "as_told_holdout_nmse", "parametric_nmse", "s"} <= rows.keys()
