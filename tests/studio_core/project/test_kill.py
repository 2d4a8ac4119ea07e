"""Programs killed at any time: the file opens and holds the last acknowledged save or the one after it.

`LUCARNE_KILL_TRIALS` sets the number of trials (100; a release run takes 1,000).
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from project_support.disk import environment

TRIALS = int(os.environ.get("LUCARNE_KILL_TRIALS", "100"))


@pytest.mark.skipif(not hasattr(os, "fork"), reason="needs fork")
@pytest.mark.parametrize("way", ["in place", "whole", "recovery"])
def test_killed_while_saving(tmp_path: Path, way: str) -> None:
    trials = TRIALS // 2 if way == "whole" else TRIALS
    command = [sys.executable, "-W", "error", "-m", "project_support.kill_child"]
    done = subprocess.run(
        [*command, str(tmp_path), way, str(trials), "11"],
        env=environment(),
        capture_output=True,
        text=True,
        timeout=60 + 5 * trials,
        check=False,
    )
    assert done.returncode == 0, done.stderr[-3000:]
    found = json.loads(done.stdout)
    print(way, found)
    assert found["saves"] > trials // 20
    assert found["outcomes"]["last acknowledged"] > 0
