"""The measures of captured materials: their rows are there, and say what the fit said."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from studio.bench import materials_captured as bench
from studio.bench.harness import Report
from studio_plugins.residual.samples import Ball


def test_rows_of_a_material(monkeypatch: pytest.MonkeyPatch) -> None:
    small = replace(bench.EXACT, size=(84, 84), ball=Ball(42.3, 41.6, 38.0))
    monkeypatch.setattr(bench, "_QUICK_MAP", 16)
    monkeypatch.setattr(bench, "CHOSEN", replace(bench.CHOSEN, models=("lambert",), refine=0))
    report = Report("materials", True, "captured/textured/*")
    bench.measure(report, ("textured", "glossy"), small)
    rows = {row.metric: row.value for row in report.rows}
    assert {row.case for row in report.rows} == {"captured/textured/checkerboard"}
    assert rows["holdout_nmse"] < 1e-3 < rows["parametric_nmse"]
    assert rows["holdout_nmse"] < rows["paper_nmse"] < rows["parametric_nmse"]
    assert rows["lights_off"] == pytest.approx(0, abs=1e-4)
    assert rows["rank"] <= rows["bytes_per_texel"] / 6
    details = report.details["captured/textured/checkerboard"]
    assert details["fit"]["bytes_per_texel"] == rows["bytes_per_texel"]
    assert np.isfinite(details["by_light"]).all()
