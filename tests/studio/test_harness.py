"""Rows of benchmarks: spreads, the JSON that others read, the table that people read."""

from __future__ import annotations

import argparse
import json
import re
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import studio.bench.harness as harness
from studio.bench.harness import (
    PowerLaw,
    Report,
    Row,
    Timing,
    commit,
    machine,
    relative_p99,
    relative_rmse,
    timed,
    unbiased_rmse,
)
from studio.bench.run import SUITES, run
from studio.cli import main
from studio.headless import Headless
from studio_core import __version__
from studio_core.errors import InputError

positive = st.floats(1e-3, 1e3)


def report() -> Report:
    made = Report("little", quick=True)
    made.add("sample", "error", np.float32(0.25), "1", 0.5)
    made.add("start", "window_s", 1, "s")
    made.notes.append("Something was left out.")
    made.details["sample"] = {"stages": [1, 2]}
    return made


# --- figures ------------------------------------------------------------------------------------------


def test_a_row_holds_plain_numbers() -> None:
    first, second = report().rows
    assert first == Row("sample", "error", 0.25, "1", 0.5)
    assert second == Row("start", "window_s", 1.0, "s", 0.0)
    assert type(first.value) is float
    assert type(second.spread) is float


def test_timing_is_the_median_and_half_the_interquartile_range(monkeypatch: pytest.MonkeyPatch) -> None:
    durations = [100.0, 5.0, 1.0, 2.0, 50.0]
    clock: Iterator[float] = iter(
        instant for index, seconds in enumerate(durations) for instant in (index * 1e3, index * 1e3 + seconds)
    )
    monkeypatch.setattr(harness.time, "perf_counter", lambda: next(clock))
    calls: list[None] = []
    assert timed(lambda: calls.append(None), 5, warm_up=3) == Timing(5.0, (50.0 - 2.0) / 2)
    assert len(calls) == 8
    assert next(clock, None) is None  # warm-up is not on the clock


def test_relative_rmse_is_the_house_error() -> None:
    assert relative_rmse([1, 1, 1, 1], [1, 1, 1, 1]) == 0
    assert relative_rmse([2, 0], [1, 1]) == 1
    assert relative_rmse([4, 0], [3, 1]) == pytest.approx(1 / 2)


@given(st.lists(st.tuples(positive, positive), min_size=1, max_size=30), positive)
def test_relative_rmse_does_not_depend_on_the_unit(pairs: list[tuple[float, float]], scale: float) -> None:
    made, truth = np.array(pairs).T
    error = relative_rmse(made, truth)
    assert error >= 0
    assert relative_rmse(made * scale, truth * scale) == pytest.approx(error)
    assert relative_rmse(truth * (1 + scale), truth) == pytest.approx(
        scale * np.sqrt((truth**2).mean()) / truth.mean()
    )


def test_nothing_measured_has_no_median() -> None:
    found = Timing.of([])
    assert np.isnan([found.median, found.spread]).all()


def test_the_99th_percentile_is_over_places_not_channels() -> None:
    truth = np.full((101, 3), 2.0)
    made = truth.copy()
    made[:, 0] += 3 * np.arange(101)  # place k is off by k on average over its channels
    assert relative_p99(made, truth) == pytest.approx(99 / 2)
    assert relative_p99(truth.reshape(1, 101, 3), truth.reshape(1, 101, 3)) == 0


def test_independent_noise_of_the_truth_drops_out() -> None:
    rng = np.random.default_rng(1)
    truth = rng.uniform(0.5, 1.5, (200_000, 3))
    first, second = (truth + rng.normal(0, 0.1, truth.shape) for _ in range(2))
    made = truth + rng.normal(0, 0.03, truth.shape)
    assert unbiased_rmse(made, first, second) == pytest.approx(0.03 / truth.mean(), rel=0.03)
    assert relative_rmse(made, (first + second) / 2) > 0.07  # what the noise would have made of it
    assert unbiased_rmse(truth, first, second) < 0.005


def test_without_noise_it_is_the_house_error() -> None:
    assert unbiased_rmse([2, 0], [1, 1], [1, 1]) == relative_rmse([2, 0], [1, 1])


@given(st.floats(1e-3, 1e3), st.floats(-3, 3).filter(lambda p: abs(p) > 0.01))
def test_a_power_law_is_found_again(scale: float, exponent: float) -> None:
    x = [0.5, 1.0, 3.0, 20.0]
    found = PowerLaw.fit(x, [scale * place**exponent for place in x])
    assert found.scale == pytest.approx(scale)
    assert found.exponent == pytest.approx(exponent)
    assert found.misfit < 1e-6
    assert found.where(found.at(7.0)) == pytest.approx(7.0)


def test_a_power_law_needs_two_places_and_a_slope() -> None:
    with pytest.raises(ValueError, match="two different"):
        PowerLaw.fit([1, 1, 2], [3, 4, 0])
    with pytest.raises(ValueError, match="never"):
        PowerLaw(2.0, 0.0).where(3.0)
    with pytest.raises(ValueError, match="never"):
        PowerLaw(2.0, -0.5).where(0.0)


# --- what is written ----------------------------------------------------------------------------------


def test_the_json_has_the_promised_shape(tmp_path: Path) -> None:
    made = report()
    made.write(tmp_path / "rows.json")
    found = json.loads((tmp_path / "rows.json").read_text())
    assert list(found) == ["suite", "version", "commit", "machine", "quick", "rows", "notes", "details"]
    assert (found["suite"], found["version"], found["quick"]) == ("little", __version__, True)
    assert found["rows"] == [
        {"case": "sample", "metric": "error", "value": 0.25, "unit": "1", "spread": 0.5},
        {"case": "start", "metric": "window_s", "value": 1.0, "unit": "s", "spread": 0.0},
    ]
    assert found["machine"]["cores"] >= 1
    assert found["notes"] == ["Something was left out."]
    assert found["details"] == {"sample": {"stages": [1, 2]}}


def test_the_machine_is_described_in_plain_values() -> None:
    found = machine()
    assert {"processor", "cores", "system", "python", "numpy", "numba"} <= set(found)
    assert json.loads(json.dumps(found)) == found


def test_the_commit_is_a_hash_or_nothing() -> None:
    assert re.fullmatch(r"([0-9a-f]{7,40}|\S+-g[0-9a-f]+)?(-dirty)?", commit())


def test_the_commit_is_empty_without_git(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", "")
    assert commit() == ""


def test_the_table_has_a_line_a_row() -> None:
    lines = report().markdown().splitlines()
    assert lines[0] == "# little"
    table = [[cell.strip() for cell in line.strip("|").split("|")] for line in lines if line.startswith("|")]
    assert table[0] == ["case", "metric", "value", "unit", "spread"]
    assert table[2:] == [["sample", "error", "0.25", "1", "0.5"], ["start", "window_s", "1", "s", "0"]]
    assert lines[-1] == "Something was left out."


# --- the verbs ----------------------------------------------------------------------------------------


def test_bench_runs_a_suite_prints_its_table_and_writes_its_rows(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    module = tmp_path / "little_suite.py"
    module.write_text("def run(report, program):\n    report.add('a', 'b_s', 2, 's', report.quick)\n")
    monkeypatch.syspath_prepend(tmp_path)
    for verb in ("bench", "stress"):
        monkeypatch.setitem(SUITES, verb, {"little": "little_suite"})
        assert main([verb, "little", "--quick", "--json", str(tmp_path / f"{verb}.json")]) == 0
        assert "| a | b_s | 2 | s | 1 |" in capsys.readouterr().out
        assert json.loads((tmp_path / f"{verb}.json").read_text())["rows"][0]["value"] == 2


def test_every_suite_of_bench_is_there() -> None:
    for where in SUITES["bench"].values():
        assert Path(harness.__file__).with_name(f"{where.rpartition('.')[2]}.py").is_file()


# --- runs in parts ------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("only", "case", "wanted"),
    [
        ("*", "sun/brdf", True),
        ("brdf", "brdf", True),
        ("brdf", "brdf-one", False),
        ("sun/*, settle*", "settle-own", True),
        ("sun/*, settle*", "sun/camera", True),
        ("sun/*, settle*", "paper/sun/camera", False),
    ],
)
def test_cases_are_chosen_by_patterns(only: str, case: str, wanted: bool) -> None:
    assert Report("little", False, only=only).wants(case) is wanted


def test_what_there_is_so_far_replaces_what_was_written(tmp_path: Path) -> None:
    target = tmp_path / "rows.json"
    target.write_text("of yesterday")
    made = Report("little", False, target=target)
    made.keep()
    assert target.read_text() == "of yesterday"  # nothing is there to take its place
    made.add("sample", "error", 1, "1")
    made.keep()
    made.add("sample", "seconds", 2, "s")
    assert len(json.loads(target.read_text())["rows"]) == 1
    made.keep()
    assert len(json.loads(target.read_text())["rows"]) == 2
    assert [path.name for path in tmp_path.iterdir()] == ["rows.json"]


class Suite:
    """Stands in for a module; is interrupted after one row."""

    IN_PARTS = False

    @staticmethod
    def run(report: Report, program: object) -> None:
        report.add("sample", "error", 1, "1")
        raise KeyboardInterrupt


def asked(tmp_path: Path, **other: str) -> argparse.Namespace:
    values = {"only": "*", "growth": "full", **other}
    return argparse.Namespace(verb="bench", name="little", quick=True, json=tmp_path / "rows.json", **values)


@pytest.fixture
def little(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(SUITES["bench"], "little", "little_suite")
    monkeypatch.setitem(sys.modules, "little_suite", Suite)


@pytest.mark.usefixtures("little")
def test_an_interrupted_run_keeps_and_shows_its_rows(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(KeyboardInterrupt):
        run(asked(tmp_path), Headless(quiet=True))
    assert "| sample | error | 1 |" in capsys.readouterr().out
    assert json.loads((tmp_path / "rows.json").read_text())["rows"][0]["case"] == "sample"


@pytest.mark.usefixtures("little")
@pytest.mark.parametrize("other", [{"only": "brdf"}, {"growth": "none"}])
def test_a_suite_without_parts_says_so(tmp_path: Path, other: dict[str, str]) -> None:
    with pytest.raises(InputError, match="bench little has no parts"):
        run(asked(tmp_path, **other), Headless(quiet=True))
    assert not (tmp_path / "rows.json").exists()
