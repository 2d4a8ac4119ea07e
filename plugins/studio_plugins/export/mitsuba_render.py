"""Render the scene.xml beside this file with Mitsuba 3 (pip install mitsuba).

python render.py [-o picture.exr] [--spp 256] [--size 960x540] [--max-depth 2] [--variant llvm_ad_rgb]
"""

from __future__ import annotations

import argparse
import importlib
import sys
from pathlib import Path
from typing import Any

FOLDER = Path(__file__).resolve().parent


def main() -> None:
    """The command line above."""
    parser = argparse.ArgumentParser(description="Render this folder's scene with Mitsuba 3.")
    parser.add_argument("-o", "--output", type=Path, default=FOLDER / "picture.exr")
    parser.add_argument("--spp", type=int, help="samples a pixel")
    parser.add_argument("--size", help="WIDTHxHEIGHT")
    parser.add_argument("--max-depth", type=int, help="2 is direct light alone; -1 everything")
    parser.add_argument("--sensor", type=int, default=0, help="number of the camera")
    parser.add_argument("--variant", help="scalar_rgb, llvm_ad_rgb or cuda_ad_rgb")
    given = parser.parse_args()

    mi: Any = importlib.import_module("mitsuba")
    mi.set_variant(*([given.variant] if given.variant else ["llvm_ad_rgb", "scalar_rgb"]))
    sys.path.insert(0, str(FOLDER))
    for name in ("bsdfs", "emitters"):
        importlib.import_module(name).register()
    changed = {"spp": given.spp, "max_depth": given.max_depth}
    if given.size:
        changed["width"], changed["height"] = (int(n) for n in given.size.lower().split("x"))
    values = {name: str(value) for name, value in changed.items() if value is not None}
    scene = mi.load_file(str(FOLDER / "scene.xml"), **values)
    mi.Bitmap(mi.render(scene, sensor=given.sensor)).write(str(given.output))


if __name__ == "__main__":
    main()
