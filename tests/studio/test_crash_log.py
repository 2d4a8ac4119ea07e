"""Reports of processes that died."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from project_support.disk import environment

CHILD = """
import sys
from pathlib import Path
from studio.crash_log import crash_log
with crash_log(Path(sys.argv[1])) as found:
    print(repr(found), flush=True)
    sys.stdin.readline()
"""
posix = pytest.mark.skipif(os.name == "nt", reason="kills with POSIX signals")


def start(folder: Path) -> tuple[subprocess.Popen[str], str]:
    command = [sys.executable, "-c", CHILD, str(folder)]
    child = subprocess.Popen(
        command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, env=environment()
    )
    return child, child.stdout.readline()


def end(child: subprocess.Popen[str], deadly: int | None) -> None:
    if deadly is not None:
        child.send_signal(deadly)
    child.communicate("\n", timeout=60)


@posix
def test_a_crash_is_told_once_and_living_windows_are_let_be(tmp_path: Path) -> None:
    first, found = start(tmp_path)
    assert found == "''\n"
    second, found = start(tmp_path)
    assert found == "''\n", "the first one lives"
    end(first, signal.SIGSEGV)
    third, found = start(tmp_path)
    assert "Segmentation fault" in found
    assert "File" in found
    end(second, signal.SIGKILL)
    fourth, found = start(tmp_path)
    assert found == "''\n", "a kill leaves no report"
    for child in (third, fourth):
        end(child, None)
        assert child.returncode == 0
    assert list(tmp_path.iterdir()) == []


def test_a_folder_that_cannot_be_written_is_no_reason_not_to_start(tmp_path: Path) -> None:
    file = tmp_path / "file"
    file.write_text("in the way")
    child, found = start(file / "folder")
    end(child, None)
    assert found == "''\n"
    assert child.returncode == 0
