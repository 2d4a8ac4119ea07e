"""`lucarne bench materials`: what reflectance models and captured materials promise, and what they cost.

Each part is a module of its own with `run(report, program)`, whose cases are named by model or by material
and are left out where `--only` does not want them. What the metrics are stands in benchmarks/README.md.
"""

from __future__ import annotations

import importlib

from studio.bench.harness import Report
from studio.headless import Headless

IN_PARTS = True
PARTS = (
    "studio.bench.materials_energy",
    "studio.bench.materials_exchange",
    "studio.bench.materials_normals",
    "studio.bench.materials_scene",
    "studio.bench.materials_captured",
    "studio.bench.materials_btf",
    "studio.bench.materials_sources",
)


def run(report: Report, program: Headless) -> None:
    """Every part, one after the other."""
    for name in PARTS:
        importlib.import_module(name).run(report, program)
