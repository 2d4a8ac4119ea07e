"""Find a suite by name, run it, print its table."""

from __future__ import annotations

import argparse
import importlib

from studio.bench.harness import Report
from studio.headless import Headless
from studio_core.errors import InputError

SUITES = {
    "bench": {"reference": "studio.bench.reference", "cuts": "studio.bench.cuts"},
    "stress": {"ui": "studio.bench.stress_ui"},
}


def run(options: argparse.Namespace, program: Headless) -> int:
    """`lucarne bench NAME` and `lucarne stress NAME`."""
    known = SUITES[options.verb]
    if options.name not in known:
        raise InputError(f"there is no {options.verb} {options.name!r}; known: {', '.join(known)}")
    report = Report(options.name, options.quick)
    importlib.import_module(known[options.name]).run(report, program)
    if options.json is not None:
        report.write(options.json)
    print(report.markdown())
    return 0
