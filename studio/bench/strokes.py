"""`lucarne bench strokes`: whether painted light finds the material that was meant, how truly, how quickly.

Each part is a module of its own with `run(report, program)`, and leaves out cases that `--only` does not
want. What the metrics are stands in benchmarks/README.md.
"""

from __future__ import annotations

import importlib

from studio.bench.harness import Report
from studio.headless import Headless

IN_PARTS = True
PARTS = ("studio.bench.strokes_recovery",)


def run(report: Report, program: Headless) -> None:
    """Every part, one after the other."""
    for name in PARTS:
        importlib.import_module(name).run(report, program)
        report.keep()
