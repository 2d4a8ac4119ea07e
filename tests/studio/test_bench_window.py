"""`lucarne bench window`: what the graphics canvas moves is what changed."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from gl_support import require_offscreen

from studio.bench import window
from studio.cli import main
from studio_ui.canvas.gl_buffers import GAP


@pytest.mark.gl
def test_bytes_are_those_of_what_changed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    require_offscreen()
    monkeypatch.setattr(window, "SIZES", {"small": 4000})
    monkeypatch.setattr(window, "PIXELS", (160, 90))
    assert main(["bench", "window", "--quick", "--json", str(tmp_path / "rows.json")]) == 0
    rows = json.loads((tmp_path / "rows.json").read_text())["rows"]
    found = {(row["case"], row["metric"]): row["value"] for row in rows}
    assert found["small/all", "changed"] >= 12 * found["small", "vertices"]
    for case in ("all", "one_object", "nothing", "moved", "turned"):
        assert found[f"small/{case}", "moved"] == found[f"small/{case}", "changed"]
    seen = found["small/seen", "changed"]
    assert 0 < seen <= found["small/seen", "moved"] <= (1 + GAP) * seen
    assert found["small/nothing", "uploads"] == 0
    assert found["small/turned", "draw_calls"] == found["small/all", "draw_calls"] > 10
