"""The bench of BTFs on a cloth of few texels."""

from __future__ import annotations

import json
import subprocess
import sys

import pytest

from studio.bench import materials_btf
from studio.bench.harness import Report


def test_a_process_of_its_own_tells_what_a_fit_took() -> None:
    made = subprocess.run(
        [sys.executable, "-c", materials_btf._CHILD, "16", "0"], capture_output=True, text=True, check=True
    )
    found = json.loads(made.stdout.splitlines()[-1])
    assert 0 < found["holdout_nmse"] < 0.3 * found["parametric_nmse"]
    assert 0 < found["making"] < found["seconds"]
    assert 5e7 < found["peak_bytes"] < 2e9


def test_rows_of_what_is_asked_for(monkeypatch: pytest.MonkeyPatch) -> None:
    figures = ("holdout_nmse", "holdout_nmse_outside", "parametric_nmse", "rank", "bytes_per_texel")
    found = dict.fromkeys((*figures, "seconds", "cpu_seconds", "making", "peak_bytes"), 1.0)
    asked: list[tuple[int, bool]] = []

    def instead(texels: int, parallax: bool) -> dict[str, float]:
        asked.append((texels, parallax))
        return found

    monkeypatch.setattr(materials_btf, "_in_child", instead)
    report = Report("materials", True, "btf/still,btf/zip")
    materials_btf.run(report)
    assert asked == [(64, False)]
    assert {row.case for row in report.rows} == {"btf/still"}
    assert {row.metric for row in report.rows} >= {*figures, "s", "peak_bytes"}
