"""`lucarne bench strokes`: whether painted light finds the material that was meant, how truly, how quickly.

Each part is a function of a module of its own, called with (report, program), and leaves out cases that
`--only` does not want. What the metrics are stands in benchmarks/README.md.
"""

from __future__ import annotations

import importlib

from studio.bench.harness import Report
from studio.headless import Headless

IN_PARTS = True
PARTS = (
    ("studio.bench.strokes_recovery", "run"),
    ("studio.bench.strokes_mitsuba", "run"),
    ("studio.bench.strokes_equations", "run"),
    ("studio.bench.strokes_indirect", "run"),
    ("studio.bench.strokes_size", "run"),
    ("studio.bench.strokes_spread", "upsampling"),
    ("studio.bench.strokes_direct", "direct"),
    ("studio.bench.strokes_figures", "run"),
)


def run(report: Report, program: Headless) -> None:
    """Every part, one after the other."""
    for module, name in PARTS:
        getattr(importlib.import_module(module), name)(report, program)
        report.keep()
