"""`lucarne doctor`: what it looks at, and its exit status."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import pytest

import studio.display
import studio.doctor
import studio.samples
from studio.cli import main
from studio_core.errors import InputError
from studio_core.registry import Failure, PluginHost


def doctor(capsys: pytest.CaptureFixture[str], status: int) -> dict[str, dict[str, str]]:
    """The checks by name."""
    capsys.readouterr()
    assert main(["doctor", "--json"]) == status
    rows = json.loads(capsys.readouterr().out)
    assert all(set(row) == {"check", "state", "detail"} for row in rows)
    return {row["check"]: row for row in rows}


@pytest.fixture(autouse=True)
def no_display(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(studio.doctor, "why_no_window", lambda: "there is no display")


def test_a_good_installation(capsys: pytest.CaptureFixture[str]) -> None:
    checks = doctor(capsys, 0)
    needed = [
        "lucarne",
        "python",
        "numpy",
        "kernels",
        "ray tracer",
        "sample room",
        "brdfs",
        "backends",
        "plugins",
    ]
    assert {name: checks[name]["state"] for name in needed} == dict.fromkeys(needed, "ok")
    assert "reference" in checks["backends"]["detail"]
    assert "lambert" in checks["brdfs"]["detail"]
    assert checks["window"] == {"check": "window", "state": "absent", "detail": "there is no display"}


def test_for_people_there_is_one_line_a_check(capsys: pytest.CaptureFixture[str]) -> None:
    checks = doctor(capsys, 0)
    assert main(["doctor"]) == 0
    said = capsys.readouterr()
    lines = said.out.splitlines()
    assert [line.partition("  ")[0] for line in lines] == list(checks)
    assert (
        len({line.index(checks[name]["state"], len(name)) for name, line in zip(checks, lines, strict=True)})
        == 1
    )
    assert said.err == ""


def test_what_is_missing_is_said_and_fails(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    real = studio.doctor._version
    monkeypatch.setattr(
        studio.doctor, "_version", lambda name: "" if name in ("trimesh", "mitsuba") else real(name)
    )
    checks = doctor(capsys, 1)
    assert checks["trimesh"]["state"] == "missing"
    assert checks["mitsuba"]["state"] == "absent"
    assert "Mitsuba" in checks["mitsuba"]["detail"]


def test_without_what_is_optional_all_is_well(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    real = studio.doctor._version
    monkeypatch.setattr(studio.doctor, "_version", lambda name: "" if name == "mitsuba" else real(name))
    assert doctor(capsys, 0)["mitsuba"]["state"] == "absent"


def test_what_breaks_is_said_and_fails(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def broken(*_: object) -> Any:
        raise InputError("the sample projects are missing from this installation")

    monkeypatch.setattr(studio.samples, "sample", broken)
    check = doctor(capsys, 1)["sample room"]
    assert check["state"] == "failed"
    assert "missing from this installation" in check["detail"]


def test_a_failed_plugin_is_named_and_fails(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    real = PluginHost.discover

    def discover() -> PluginHost:
        host = real()
        host.failures.append(Failure("velvet", "could not be loaded: ImportError: no", "Traceback"))
        return host

    monkeypatch.setattr(PluginHost, "discover", discover)
    checks = doctor(capsys, 1)
    assert checks["plugins"]["state"] == "failed"
    assert checks["plugin velvet"]["detail"] == "could not be loaded: ImportError: no"


def test_a_missing_sample_is_refused_with_those_that_exist() -> None:
    with pytest.raises(InputError, match=r"'attic'.*living-room"):
        studio.samples.sample("attic")


def test_an_installation_without_samples_says_so(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(studio.samples, "__file__", str(tmp_path / "studio" / "samples.py"))
    with pytest.raises(InputError, match="missing from this installation"):
        studio.samples.sample()


# --- whether a window can be opened: asked in a child process ----------------------------------------

linux = pytest.mark.skipif(sys.platform != "linux", reason="displays are asked for by variables here")


@linux
def test_without_a_display_nothing_is_tried(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("QT_QPA_PLATFORM", "DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    assert studio.display.why_no_window() == "there is no display"


@linux
def test_a_display_that_is_not_there_is_found_out_in_a_child(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("QT_QPA_PLATFORM", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("DISPLAY", ":4711")
    reason = studio.display.why_no_window()
    assert ":4711" in reason or "xcb" in reason
    assert "\n" not in reason


@linux
def test_a_platform_that_qt_does_not_know_is_a_reason(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("QT_QPA_PLATFORM", "teletype")
    assert "teletype" in studio.display.why_no_window()


def test_a_display_that_answers_is_no_reason(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("QT_QPA_PLATFORM", "offscreen:size=10x10")
    monkeypatch.setattr(studio.display, "OFFSCREEN", ())
    assert studio.display.why_no_window() == ""
