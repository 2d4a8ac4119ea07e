"""Photographs the samples for the start page: `python -m sample_projects.pictures`, from a checkout."""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

from .make import BOUNCING

SIZE = "320x180"
QUALITY = 82


def main(folder: Path) -> int:
    """A small picture beside every sample, as its first camera sees it."""
    from PIL import Image

    from studio.cli import main as lucarne

    for project in sorted(folder.glob("*.lucarne")):
        with tempfile.TemporaryDirectory() as scratch:
            rendered = Path(scratch) / "picture.png"
            picture = ["-o", str(rendered), "--size", SIZE, "--antialias", "4"]
            light = ["--indirect", "gather", "--bounces", "6"] if project.stem in BOUNCING else []
            status = lucarne(["render", str(project), *picture, *light])
            if status:
                return status
            with Image.open(rendered) as made:
                made.save(project.with_suffix(".jpg"), quality=QUALITY, optimize=True)
    return 0


if __name__ == "__main__":
    sys.exit(main(Path(__file__).parent))
