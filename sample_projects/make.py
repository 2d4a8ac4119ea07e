"""Writes the sample projects: `python -m sample_projects.make [FOLDER]`, beside this file by default."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path

from studio_core.project.store import save
from studio_core.scene.nodes import Scene

from .captured_room import build as captured_room
from .living_room import build as living_room
from .red_cabinet import build as red_cabinet
from .terrace import build as terrace

FITTED: dict[str, Callable[[], Scene]] = {"captured-room": captured_room.build}
"""Samples that take minutes: their materials are photographed in the lab and fitted."""
SAMPLES: dict[str, Callable[[], Scene]] = {"living-room": living_room.build, "terrace": terrace.build}
BOUNCING: dict[str, Callable[[], Scene]] = {"red-cabinet": red_cabinet.build}
"""Samples that live from light between surfaces: closed rooms, lit through a window."""
MADE = 1_767_225_600.0  # 2026-01-01: the time of the only revision, so that the same files come out


def main(folder: Path) -> None:
    """Makes every sample anew in `folder`."""
    for name, build in {**SAMPLES, **FITTED, **BOUNCING}.items():
        path = folder / f"{name}.lucarne"
        save(path, build(), label="Sample", fresh=True, time=MADE)
        print(f"{path} ({path.stat().st_size / 1e6:.2f} MB)")


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parent)
