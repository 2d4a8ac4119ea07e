"""Measuring: warm-up, repeats, medians and spreads, rows that stay comparable.

Machines are shared and noisy: compare ratios of figures from one run, never seconds of two.
"""

from __future__ import annotations

import json
import os
import platform
import subprocess
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from studio_core import __version__


@dataclass(frozen=True)
class Row:
    """One figure: what was measured in which case, its unit, and the spread of its repeats."""

    case: str
    metric: str
    value: float
    unit: str
    spread: float = 0.0


@dataclass
class Report:
    """The rows of one run of a suite."""

    suite: str
    quick: bool
    rows: list[Row] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)

    def add(self, case: str, metric: str, value: float, unit: str, spread: float = 0.0) -> None:
        """One more figure."""
        self.rows.append(Row(case, metric, float(value), unit, float(spread)))

    def as_dict(self) -> dict[str, Any]:
        """What is written as JSON."""
        return {
            "suite": self.suite,
            "version": __version__,
            "commit": commit(),
            "machine": machine(),
            "quick": self.quick,
            "rows": [asdict(row) for row in self.rows],
            "notes": self.notes,
        }

    def write(self, path: Path) -> None:
        """JSON, stable in order."""
        path.write_text(json.dumps(self.as_dict(), indent=1) + "\n", encoding="utf-8")

    def markdown(self) -> str:
        """A table to read."""
        lines = ["| case | metric | value | unit | spread |", "|---|---|---:|---|---:|"]
        for row in self.rows:
            lines.append(f"| {row.case} | {row.metric} | {row.value:.4g} | {row.unit} | {row.spread:.2g} |")
        return "\n".join([f"# {self.suite}", "", *lines, "", *self.notes])


@dataclass(frozen=True)
class Timing:
    """Median and half the interquartile range of repeats, seconds."""

    median: float
    spread: float


def timed(call: Callable[[], object], repeats: int, warm_up: int = 1) -> Timing:
    """Time a call after `warm_up` unmeasured ones."""
    for _ in range(warm_up):
        call()
    taken = []
    for _ in range(repeats):
        started = time.perf_counter()
        call()
        taken.append(time.perf_counter() - started)
    low, middle, high = np.percentile(taken, [25, 50, 75])
    return Timing(float(middle), float(high - low) / 2)


def relative_rmse(made: Any, truth: Any) -> float:
    """sqrt(mean((made − truth)²)) / mean(truth): the house's error, over all given values."""
    a, b = np.asarray(made, np.float64), np.asarray(truth, np.float64)
    return float(np.sqrt(np.mean((a - b) ** 2)) / np.mean(b))


def commit() -> str:
    """The checkout's commit, marked when there are changes; empty outside one."""
    here = Path(__file__).resolve().parent
    try:
        made = subprocess.run(
            ["git", "-C", str(here), "describe", "--always", "--dirty", "--abbrev=12"],
            capture_output=True,
            text=True,
            check=True,
            timeout=10,
        )
    except (OSError, subprocess.SubprocessError):
        return ""
    return made.stdout.strip()


def machine() -> dict[str, object]:
    """Processor, cores and versions that explain a figure."""
    import numba

    model = platform.processor()
    info = Path("/proc/cpuinfo")
    if info.is_file():
        names = [
            line.split(":", 1)[1].strip() for line in info.read_text().splitlines() if "model name" in line
        ]
        model = names[0] if names else model
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    return {
        "processor": model,
        "cores": cores,
        "system": platform.system(),
        "python": platform.python_version(),
        "numpy": np.__version__,
        "numba": numba.__version__,
    }
