"""Find a suite by name, run it, print its table: also what there is of one that was interrupted."""

from __future__ import annotations

import argparse
import importlib

from studio.bench.harness import Report
from studio.headless import Headless
from studio_core.errors import InputError

EVERYTHING, FULL = "*", "full"
SUITES = {
    "bench": {
        "reference": "studio.bench.reference",
        "cuts": "studio.bench.cuts",
        "window": "studio.bench.window",
        "photograph": "studio.bench.photograph",
        "capture": "studio.bench.capture",
        "materials": "studio.bench.materials",
        "interreflection": "studio.bench.interreflection",
        "strokes": "studio.bench.strokes",
    },
    "stress": {"ui": "studio.bench.stress_ui"},
}


def run(options: argparse.Namespace, program: Headless) -> int:
    """`lucarne bench NAME` and `lucarne stress NAME`."""
    known = SUITES[options.verb]
    if options.name not in known:
        raise InputError(f"there is no {options.verb} {options.name!r}; known: {', '.join(known)}")
    only, growth = getattr(options, "only", EVERYTHING), getattr(options, "growth", FULL)
    report = Report(options.name, options.quick, only, growth, options.json)
    suite = importlib.import_module(known[options.name])
    if (only, growth) != (EVERYTHING, FULL) and not getattr(suite, "IN_PARTS", False):
        raise InputError(f"{options.verb} {options.name} has no parts: --only and --growth say nothing to it")
    try:
        suite.run(report, program)
    finally:  # a crash or Ctrl-C loses nothing that is done
        report.keep()
        if report.rows:
            print(report.markdown())
    return 0
