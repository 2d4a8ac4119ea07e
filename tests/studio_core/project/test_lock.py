"""Who has a project open."""

from __future__ import annotations

import dataclasses
import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from project_support.disk import environment
from project_support.samples import small_scene

from studio_core.errors import ProjectError
from studio_core.project import lock
from studio_core.project.lock import Holder, LockedError, acquire, holder_of, lock_path, this_process
from studio_core.project.store import info, save

HOLD = """
import sys
from pathlib import Path
from studio_core.project.lock import acquire
held = acquire(Path(sys.argv[1]))
print("held", flush=True)
sys.stdin.read()
"""


@pytest.fixture
def project(tmp_path: Path) -> Path:
    path = tmp_path / "room.lucarne"
    save(path, small_scene())
    return path


def other_instance(project: Path) -> subprocess.Popen[str]:
    process = subprocess.Popen(
        [sys.executable, "-c", HOLD, str(project)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        env=environment(),
    )
    assert process.stdout is not None
    assert process.stdout.readline() == "held\n"
    return process


def end(process: subprocess.Popen[str], how: signal.Signals | None = None) -> None:
    assert process.stdin is not None
    assert process.stdout is not None
    if how is not None:
        process.send_signal(how)
    process.stdin.close()
    process.wait(20)
    process.stdout.close()


def test_a_second_instance_is_told_who_holds_it(project: Path) -> None:
    process = other_instance(project)
    try:
        with pytest.raises(LockedError, match=rf"room\.lucarne is open by .*process {process.pid}") as caught:
            acquire(project)
        assert caught.value.holder is not None
        assert caught.value.holder.pid == process.pid
        assert not caught.value.foreign
        assert "read-only" in str(caught.value)
        with pytest.raises(LockedError):
            acquire(project, take_over=True)
        assert str(process.pid) in str(info(project).opened_by)
    finally:
        end(process)


@pytest.mark.skipif(not hasattr(signal, "SIGKILL"), reason="needs signals")
def test_a_lock_does_not_survive_its_process(project: Path) -> None:
    process = other_instance(project)
    end(process, signal.SIGKILL)
    assert lock_path(project).exists()
    assert holder_of(project) is None
    assert info(project).opened_by is None
    with acquire(project):
        held = holder_of(project)
        assert held is not None
        assert held.pid == os.getpid()
    assert not lock_path(project).exists()


def test_one_process_cannot_lock_twice(project: Path) -> None:
    with acquire(project), pytest.raises(LockedError):
        acquire(project)
    acquire(project).release()


def test_release_twice_leaves_the_next_lock_alone(project: Path) -> None:
    first = acquire(project)
    first.release()
    with acquire(project):
        first.release()
        assert holder_of(project) is not None
        with pytest.raises(LockedError):
            acquire(project)


def foreign(project: Path, since: float) -> Holder:
    holder = Holder("studio-3", "anna", 4711, "", since)
    lock_path(project).write_text(json.dumps(dataclasses.asdict(holder)))
    return holder


def test_the_lock_of_another_machine_is_honoured_with_its_age(project: Path) -> None:
    me = this_process()
    holder = foreign(project, me.since - 7300)
    with pytest.raises(LockedError, match=r"anna on studio-3 \(process 4711\), for 2 hours") as caught:
        acquire(project, me=me)
    assert caught.value.foreign
    assert caught.value.holder == holder
    assert holder_of(project) == holder
    with acquire(project, take_over=True, me=me):
        assert holder_of(project) == me


def test_another_process_under_the_same_number_holds_nothing(project: Path) -> None:
    me = this_process()
    old = dataclasses.replace(me, started="another-boot:1")
    lock_path(project).write_text(json.dumps(dataclasses.asdict(old)))
    if sys.platform.startswith("linux"):
        assert holder_of(project) is None
        acquire(project).release()


def test_where_the_system_has_no_locks_the_words_count(
    project: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(lock, "_guard", lambda handle, shared=False: None)
    with acquire(project), pytest.raises(LockedError, match=f"process {os.getpid()}"):
        acquire(project)
    acquire(project).release()


@given(
    st.binary(max_size=200)
    | st.sampled_from([b"[" * 4000, b"{}", b'{"host":1}', b"null", b'{"pid":1e999}'])
    | st.builds(
        lambda **v: json.dumps(v).encode(),
        host=st.none() | st.text(),
        user=st.none() | st.text(),
        pid=st.none() | st.integers() | st.floats(),
        started=st.none() | st.text(),
        since=st.none() | st.floats() | st.text(),
    )
)
def test_any_lock_file_is_understood_or_empty(data: bytes) -> None:
    holder = lock._parse(data)
    if holder is not None:
        assert holder.host
        assert holder.described(0.0)


def test_a_damaged_lock_file_holds_nothing(project: Path) -> None:
    lock_path(project).write_bytes(b"\xff{nonsense")
    assert holder_of(project) is None
    acquire(project).release()


def test_a_folder_that_is_gone_is_said(tmp_path: Path) -> None:
    with pytest.raises(ProjectError, match=r"a\.lucarne could not be opened for saving: there is no such"):
        acquire(tmp_path / "gone" / "a.lucarne")


@pytest.mark.skipif(not hasattr(os, "symlink"), reason="needs symlinks")
def test_a_link_in_the_place_of_the_lock_is_not_followed(project: Path, tmp_path: Path) -> None:
    precious = tmp_path / "precious.txt"
    precious.write_text("do not lose")
    lock_path(project).symlink_to(precious)
    with pytest.raises(ProjectError, match=r"room\.lucarne could not be opened for saving"):
        acquire(project)
    assert precious.read_text() == "do not lose"


def test_ages_are_words() -> None:
    holder = Holder("h", "", 1, "", 1000.0)
    ages = {5: "less than a minute", 61: "1 minute", 7000: "1 hour", 200_000: "2 days", -50: "less than"}
    for age, words in ages.items():
        assert words in holder.described(1000.0 + age)
    assert holder.described(0).startswith("someone on h")
