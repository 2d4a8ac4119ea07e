"""Set-up: what is done when, what is asked of apt, and what is said where nothing may be installed."""

from __future__ import annotations

import importlib.util
import sys
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

SCRIPT = Path(__file__).parents[2] / "tools" / "set_up.py"
Apt = Callable[..., None]


@pytest.fixture
def script(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    """The script over a checkout of its own, whose environment and packages only pretend."""
    spec = importlib.util.spec_from_file_location("set_up_under_test", SCRIPT)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    (tmp_path / "pyproject.toml").write_text("[project]\n")
    module.ROOT, module.VENV = tmp_path, tmp_path / ".venv"  # type: ignore[attr-defined]
    module.STAMP = module.VENV / "set-up.json"  # type: ignore[attr-defined]
    return module


@pytest.fixture
def done(script: ModuleType, monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """What the script had to do."""
    did: list[str] = []

    def make_environment() -> None:
        did.append("make")
        interpreter = script.python()
        interpreter.parent.mkdir(parents=True, exist_ok=True)
        interpreter.touch()

    monkeypatch.setattr(script, "make_environment", make_environment)
    monkeypatch.setattr(script, "install", lambda extras: did.append(f"install {extras}".strip()))
    monkeypatch.setattr(script, "missing_packages", lambda packages: [])
    return did


def called(script: ModuleType, done: list[str], purpose: str) -> list[str]:
    done.clear()
    script.main(purpose)
    return list(done)


def test_everything_is_done_once(script: ModuleType, done: list[str]) -> None:
    assert called(script, done, "run") == ["make", "install"]
    assert called(script, done, "run") == []
    assert called(script, done, "test") == ["install test"]
    assert called(script, done, "test") == []
    assert called(script, done, "run") == []


def test_other_dependencies_are_installed_into_the_same_environment(
    script: ModuleType, done: list[str]
) -> None:
    called(script, done, "test")
    (script.ROOT / "pyproject.toml").write_text("[project]\ndependencies = []\n")
    assert called(script, done, "run") == ["install test"]


def test_another_python_or_place_needs_another_environment(
    script: ModuleType, done: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    called(script, done, "test")
    monkeypatch.setattr(sys, "version", "3.13.0 (another)")
    assert called(script, done, "test") == ["make", "install test"]


@pytest.mark.parametrize("text", ["", "{", "[]", "null", '{"python": 3}'])
def test_a_damaged_stamp_means_start_again(script: ModuleType, done: list[str], text: str) -> None:
    called(script, done, "run")
    script.STAMP.write_text(text)
    assert called(script, done, "run") == ["make", "install"]
    assert called(script, done, "run") == []


def test_an_interrupted_installation_is_not_taken_for_a_finished_one(
    script: ModuleType, done: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupted(extras: str) -> None:
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(script, "install", interrupted)
        with pytest.raises(KeyboardInterrupt):
            script.main("run")
    assert called(script, done, "run") == ["make", "install"]


@pytest.mark.parametrize(
    ("version", "fits"), [((3, 10), False), ((3, 11), True), ((3, 13), True), ((3, 14), False)]
)
def test_the_wrong_python_is_told_in_one_line(
    script: ModuleType,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    version: tuple[int, int],
    fits: bool,
) -> None:
    monkeypatch.setattr(sys, "version_info", (*version, 0, "final", 0))
    if fits:
        script.check_python()
        return
    with pytest.raises(SystemExit):
        script.check_python()
    (line,) = capsys.readouterr().err.splitlines()
    assert "needs Python 3.11 to 3.13" in line
    assert f"{version[0]}.{version[1]}" in line


class System:
    """Debian with some packages missing; apt may be allowed, may know a package, may fail."""

    def __init__(self, script: ModuleType, monkeypatch: pytest.MonkeyPatch, missing: set[str]) -> None:
        self.missing, self.unknown = missing, set[str]()
        self.works = True
        self.asked: list[list[str]] = []
        monkeypatch.setattr(
            script, "missing_packages", lambda p: [name for name in p if name in self.missing]
        )
        monkeypatch.setattr(script, "output", self.output)
        monkeypatch.setattr(script.subprocess, "run", self.run)
        monkeypatch.setattr(script.shutil, "which", lambda name, **_: f"/usr/bin/{name}")
        monkeypatch.setattr(script, "privilege", lambda: [])

    def output(self, command: list[str]) -> str:
        assert command[0] == "apt-cache"
        return "" if command[-1] in self.unknown else "Package: …"

    def run(self, command: list[str], **_: Any) -> Any:
        self.asked.append(command)
        if self.works and "install" in command:
            self.missing -= set(command[command.index("--no-install-recommends") + 1 :])
        return type("Done", (), {"returncode": 0 if self.works else 100})


@pytest.fixture
def system(script: ModuleType, monkeypatch: pytest.MonkeyPatch) -> System:
    return System(script, monkeypatch, {"libegl1", "xvfb"})


WANTED = ["libgl1", "libegl1", "xvfb"]


def test_missing_packages_are_installed(script: ModuleType, system: System) -> None:
    assert script.ensure_packages(WANTED, []) == []
    assert [command[-1] for command in system.asked] == ["update", "xvfb"]
    assert system.asked[1][-3:] == ["--no-install-recommends", "libegl1", "xvfb"]
    assert script.ensure_packages(WANTED, []) == []
    assert len(system.asked) == 2


def test_a_package_that_apt_does_not_know_leaves_out_itself_only(
    script: ModuleType, system: System, capsys: pytest.CaptureFixture[str]
) -> None:
    system.unknown = {"xvfb"}
    assert script.ensure_packages(WANTED, []) == ["xvfb"]
    assert system.missing == {"xvfb"}
    assert capsys.readouterr().err.splitlines()[-1].endswith("apt-get install xvfb")


def test_what_cannot_be_had_is_named_each_time_and_tried_once(
    script: ModuleType, system: System, capsys: pytest.CaptureFixture[str]
) -> None:
    system.works = False
    tried = script.ensure_packages(WANTED, [])
    asked = len(system.asked)
    assert tried == ["libegl1", "xvfb"]
    capsys.readouterr()
    assert script.ensure_packages(WANTED, tried) == tried
    (line,) = capsys.readouterr().err.splitlines()
    assert line.endswith("apt-get install libegl1 xvfb")
    assert len(system.asked) == asked
    system.missing.add("libgl1")
    script.ensure_packages(WANTED, tried)
    assert len(system.asked) > asked


def test_without_root_and_sudo_one_line_names_them(
    script: ModuleType, system: System, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(script, "privilege", lambda: None)
    assert script.ensure_packages(WANTED, []) == ["libegl1", "xvfb"]
    assert len(capsys.readouterr().err.splitlines()) == 1
    assert system.asked == []


def test_a_python_that_cannot_make_environments_is_told_with_the_package(
    script: ModuleType, system: System, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(script, "privilege", lambda: None)
    monkeypatch.setattr(script, "can_make_environment", lambda: False)
    with pytest.raises(SystemExit):
        script.make_environment()
    (line,) = capsys.readouterr().err.splitlines()
    assert "apt-get install python3-venv" in line


def test_privilege_is_root_or_sudo_without_a_password(
    script: ModuleType, monkeypatch: pytest.MonkeyPatch
) -> None:
    answers = {"root": 0, "sudo": 0}
    monkeypatch.setattr(script.os, "geteuid", lambda: 0)
    assert script.privilege() == []
    monkeypatch.setattr(script.os, "geteuid", lambda: 1000)
    monkeypatch.setattr(script.shutil, "which", lambda name: "/usr/bin/sudo")
    for status, wanted in ((0, ["/usr/bin/sudo", "-n"]), (1, None)):
        answers["sudo"] = status
        monkeypatch.setattr(
            script.subprocess, "run", lambda *_, **__: type("Done", (), {"returncode": answers["sudo"]})
        )
        assert script.privilege() == wanted
    monkeypatch.setattr(script.shutil, "which", lambda name: None)
    assert script.privilege() is None
