"""`lucarne bench materials`: rows and the furnace's table of every model that is asked for."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from studio.cli import main


def test_rows_of_models(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    target = tmp_path / "rows.json"
    assert main(["bench", "materials", "--quick", "--only", "lambert,phong", "--json", str(target)]) == 0
    written = json.loads(target.read_text())
    found = {(row["case"], row["metric"]): row["value"] for row in written["rows"]}
    assert {case for case, _ in found} == {"lambert", "phong"}
    for model in ("lambert", "phong"):
        assert 0.99 < found[model, "furnace_max"] <= 1.001
        assert found[model, "furnace_error"] < 5e-3
        assert found[model, "albedo_error"] < 2e-3
        assert found[model, "reciprocity_max"] < 1e-4
        assert 1e-3 < found[model, "chi2_p_bonferroni"] <= 1
        assert 0.99 < found[model, "weight_max"] < 16
        assert found[model, "eval_ratio"] > 0
    assert written["details"]["phong"]["chi2_tests"] == 20
    table = capsys.readouterr().out
    assert "| lambert | 0 | 1.000 |" in table
    assert "| phong | 0.3 | 1.000 |" in table


def test_rows_of_exchange(tmp_path: Path) -> None:
    target = tmp_path / "rows.json"
    assert main(["bench", "materials", "--quick", "--only", "exchange/cloth", "--json", str(target)]) == 0
    found = {row["metric"]: row["value"] for row in json.loads(target.read_text())["rows"]}
    assert 0 < found["glb_error"] < 0.01
    assert found["glb_again_error"] < 1e-3
    assert found["mitsuba_error"] < 0.05
