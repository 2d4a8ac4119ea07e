"""`lucarne bench photograph`: rows for every case, and a floor that shows the photograph as it was."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from scenes import little_scene, sky

from studio.bench import photograph
from studio.cli import main
from studio_core.project.store import save


def test_rows_of_every_case(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    scene = little_scene(environment=sky(64))
    save(tmp_path / "room.lucarne", scene, label="Room")
    monkeypatch.setattr("studio.samples.sample", lambda: tmp_path / "room.lucarne")
    monkeypatch.setattr(photograph, "SIZE", (48, 32))
    monkeypatch.setattr(photograph, "PLACES", 32)
    assert main(["bench", "photograph", "--quick", "--json", str(tmp_path / "rows.json")]) == 0
    rows = json.loads((tmp_path / "rows.json").read_text())["rows"]
    found = {(row["case"], row["metric"]): row["value"] for row in rows}
    assert found["plain", "caught_share"] == 0
    assert found["far", "caught_share"] == found["ground", "caught_share"] > 0.1
    assert found["alone", "caught_share"] > found["ground", "caught_share"]
    assert found["alone", "open_ratio_off"] < 0.02
    assert {case for case, metric in found if metric == "error"} == {"plain", "far", "ground", "alone"}
