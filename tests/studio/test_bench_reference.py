"""The rows of `lucarne bench reference`: others compare by their names, so all must be there.

Real scene, shading and tracing, few directions; Mitsuba and the start of the window stand in by values.
"""

from __future__ import annotations

import json
import subprocess
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from studio.bench import reference
from studio.cli import main
from studio_plugins.export import mitsuba_run

PROMISED = {
    ("sample", "irradiance_rel_rmse_vs_mitsuba"),
    ("sample", "radiance_rel_rmse_vs_mitsuba"),
    ("sample", "mrays_per_s"),
    ("start", "window_s"),
    ("start", "first_picture_s"),
}


def estimate(scene: object, positions: Any, *_: object, **__: object) -> mitsuba_run.Estimate:
    """Mitsuba's answer, whatever it is."""
    return mitsuba_run.Estimate(np.ones((len(positions), 3)), np.full((len(positions), 3), 0.01))


@pytest.fixture
def small(monkeypatch: pytest.MonkeyPatch) -> pytest.MonkeyPatch:
    """The suite in seconds."""
    real = reference.direction_set
    monkeypatch.setattr(reference, "DIRECTIONS", 1 << 10)
    monkeypatch.setattr(reference, "direction_set", lambda level: real(10))
    monkeypatch.setattr(reference, "furniture", lambda *_: None)
    started = json.dumps({"window_s": 1.0, "first_picture_s": 2.0})
    done = subprocess.CompletedProcess([], 0, f"noise\n{started}\n", "")
    stand_in = SimpleNamespace(run=lambda *_, **__: done)
    monkeypatch.setattr(reference, "subprocess", stand_in)
    monkeypatch.setattr(mitsuba_run, "vertex_irradiance", estimate)
    monkeypatch.setattr(mitsuba_run, "vertex_radiance", estimate)
    return monkeypatch


def rows(folder: Path) -> dict[tuple[str, str], dict[str, Any]]:
    assert main(["bench", "reference", "--quick", "--json", str(folder / "rows.json")]) == 0
    found = json.loads((folder / "rows.json").read_text())
    named = {(row["case"], row["metric"]): row for row in found["rows"]}
    assert len(named) == len(found["rows"])
    assert all(np.isfinite([row["value"], row["spread"]]).all() for row in found["rows"])
    return named


@pytest.mark.slow
@pytest.mark.parametrize("installed", [True, False])
def test_every_promised_row_is_there(installed: bool, small: pytest.MonkeyPatch, tmp_path: Path) -> None:
    finder = SimpleNamespace(find_spec=lambda name: object() if installed else None)
    small.setattr(reference, "importlib", SimpleNamespace(util=finder))
    found = rows(tmp_path)
    against = {row for row in found if "mitsuba" in row[1]}
    assert (against != set()) == installed
    assert {row for row in PROMISED if "mitsuba" not in row[1] or installed} <= set(found)
    assert found["sample", "mrays_per_s"]["value"] > 0
    assert found["start", "window_s"]["value"] == 1.0


def test_a_window_that_does_not_start_is_said(
    small: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    small.setattr(reference, "_truth", lambda *_: None)
    small.setattr(reference, "_speed", lambda *_: None)
    failed = subprocess.CompletedProcess([], 1, "", "Traceback\nRuntimeError: no window\n")
    small.setattr(reference, "subprocess", SimpleNamespace(run=lambda *_, **__: failed))
    assert main(["bench", "reference", "--quick"]) == 2
    said = capsys.readouterr()
    assert said.out == ""
    assert len(said.err.splitlines()) == 1
    assert "RuntimeError: no window" in said.err
