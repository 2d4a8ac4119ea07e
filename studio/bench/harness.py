"""Measuring: warm-up, repeats, medians and spreads, rows that stay comparable.

Machines are shared and noisy: compare ratios of figures from one run, never seconds of two.
"""

from __future__ import annotations

import json
import math
import os
import platform
import subprocess
import time
from collections.abc import Callable, Iterable
from dataclasses import asdict, dataclass, field
from fnmatch import fnmatchcase
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
    """The rows of one run of a suite, and which it shall have.

    only: patterns of case names (as in a shell, with commas between), growth: `full`, `quick` or `none`, both
    for suites that have such parts; target: where `keep` writes what there is so far.
    """

    suite: str
    quick: bool
    only: str = "*"
    growth: str = "full"
    target: Path | None = None
    rows: list[Row] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    details: dict[str, Any] = field(default_factory=dict)  # by case; in the JSON alone

    def add(self, case: str, metric: str, value: float, unit: str, spread: float = 0.0) -> None:
        """One more figure."""
        self.rows.append(Row(case, metric, float(value), unit, float(spread)))

    def wants(self, case: str) -> bool:
        """Whether a case is one of those that were asked for."""
        return any(fnmatchcase(case, pattern.strip()) for pattern in self.only.split(","))

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
            "details": self.details,
        }

    def keep(self) -> None:
        """Write what there is so far, if anything, in place of what was written before."""
        if self.target is not None and self.rows:
            beside = self.target.with_name(f".{self.target.name}.part")
            self.write(beside)
            beside.replace(self.target)

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

    @classmethod
    def of(cls, seconds: Iterable[float]) -> Timing:
        """Of what was measured; nan where nothing was."""
        taken = list(seconds)
        if not taken:
            return cls(math.nan, math.nan)
        low, middle, high = np.percentile(taken, [25, 50, 75])
        return cls(float(middle), float(high - low) / 2)


def timed(call: Callable[[], object], repeats: int, warm_up: int = 1) -> Timing:
    """Time a call after `warm_up` unmeasured ones."""
    for _ in range(warm_up):
        call()
    taken = []
    for _ in range(repeats):
        started = time.perf_counter()
        call()
        taken.append(time.perf_counter() - started)
    return Timing.of(taken)


def relative_rmse(made: Any, truth: Any) -> float:
    """sqrt(mean((made − truth)²)) / mean(truth): the house's error, over all given values."""
    a, b = np.asarray(made, np.float64), np.asarray(truth, np.float64)
    return float(np.sqrt(np.mean((a - b) ** 2)) / np.mean(b))


def relative_p99(made: Any, truth: Any) -> float:
    """99th percentile over places of |made − truth| (..., 3), channels averaged, over mean(truth)."""
    a, b = np.asarray(made, np.float64), np.asarray(truth, np.float64)
    return float(np.percentile(np.abs(a - b).mean(axis=-1), 99) / np.mean(b))


def unbiased_rmse(made: Any, first: Any, second: Any) -> float:
    """`relative_rmse` against what two independent noisy estimates of the truth have in common.

    mean((made − first) (made − second)) is the squared error alone: the estimates' noise has mean zero
    and is independent, so that it drops out. 0 where noise makes it negative.
    """
    a, b, c = (np.asarray(values, np.float64) for values in (made, first, second))
    squared = float(np.mean((a - b) * (a - c)))
    return math.sqrt(max(squared, 0.0)) / float(np.mean((b + c) / 2))


@dataclass(frozen=True)
class PowerLaw:
    """y = scale · x^exponent; `misfit` is the RMS of ln(y / fit)."""

    scale: float
    exponent: float
    misfit: float = 0.0

    @classmethod
    def fit(cls, x: Iterable[float], y: Iterable[float]) -> PowerLaw:
        """Least squares of logarithms over positive pairs; ValueError with fewer than two different x."""
        pairs = [(a, b) for a, b in zip(x, y, strict=True) if a > 0 and b > 0]
        if len({a for a, _ in pairs}) < 2:
            raise ValueError("a power law needs two different places")
        u, v = np.log(np.array(pairs, np.float64)).T
        exponent, level = np.polyfit(u, v, 1)
        misfit = float(np.sqrt(np.mean((v - exponent * u - level) ** 2)))
        return cls(float(np.exp(level)), float(exponent), misfit)

    def at(self, x: float) -> float:
        """y there."""
        return self.scale * float(x) ** self.exponent

    def where(self, y: float) -> float:
        """The x that gives `y` > 0; ValueError for a law that does not change."""
        if self.exponent == 0 or y <= 0:
            raise ValueError("this power law never gets there")
        return float((y / self.scale) ** (1 / self.exponent))


def peak_bytes() -> int:
    """Most memory that this process had. `getrusage` begins with what its parent had when it was started."""
    status = Path("/proc/self/status")
    if status.is_file():
        for line in status.read_text().splitlines():
            if line.startswith("VmHWM:"):
                return int(line.split()[1]) * 1024
    import resource

    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024


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
