"""The command line as a process of its own: what it costs cannot freeze or end the window."""

from __future__ import annotations

import contextlib
import json
import os
import subprocess
import sys
import threading
from collections.abc import Callable, Sequence
from typing import Any

from studio_core.errors import Cancelled, InputError, LucarneError
from studio_core.shading.job import Job

PROGRAM = (sys.executable, "-m", "studio.cli")
LOW = 10  # priority: the window comes first
PATIENCE = 5.0  # seconds between asking a process to stop and ending it
_LOOK_EVERY = 0.1
_BAD_INPUT, _INTERRUPTED = 2, 130

Heard = Callable[[dict[str, Any]], object]
Runner = Callable[[Sequence[str], Job, Heard], dict[str, Any]]
"""Runs a verb with `arguments`, reports to a job, gives every line of progress; the verb's result."""


def run_program(arguments: Sequence[str], job: Job, heard: Heard) -> dict[str, Any]:
    """`lucarne` with these arguments, which ask for JSON; the result as it prints it.

    Raises Cancelled when the job was cancelled, InputError with what it complained of.
    """
    label = job.label
    paths = os.pathsep.join(path for path in sys.path if path)
    more: dict[str, Any] = {"start_new_session": True}
    if sys.platform == "win32":
        more = {"creationflags": subprocess.BELOW_NORMAL_PRIORITY_CLASS | subprocess.CREATE_NO_WINDOW}
    child = subprocess.Popen(
        [*PROGRAM, *arguments],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        env={**os.environ, "PYTHONPATH": paths},
        text=True,
        encoding="utf-8",
        errors="replace",
        **more,
    )
    if sys.platform != "win32":
        with contextlib.suppress(OSError):
            os.setpriority(os.PRIO_PROCESS, child.pid, LOW)
    over = threading.Event()
    watch = threading.Thread(target=_watch, args=(child, job, over), daemon=True)
    watch.start()
    result: list[str] = []
    assert child.stdout is not None
    assert child.stderr is not None
    reader = threading.Thread(target=lambda out: result.append(out.read()), args=(child.stdout,), daemon=True)
    reader.start()
    said = ""
    try:
        for line in child.stderr:
            told = _parsed(line)
            if told is None:
                said = line.strip() or said
                continue
            if "done" in told:
                job.label = _labelled(label, str(told.get("label", "")))
                with contextlib.suppress(Cancelled):  # the watcher stops the child
                    job.checkpoint(int(told["done"]), int(told["total"]))
            heard(told)
        status = child.wait()
    finally:
        over.set()
        child.kill()
        child.wait()
        reader.join()
        watch.join()
        child.stdout.close()
        child.stderr.close()
    if job.cancelled or status == _INTERRUPTED:
        raise Cancelled(job.label)
    if status:
        raise _failed(status, said)
    made: dict[str, Any] = json.loads(result[0])
    return made


def _watch(child: subprocess.Popen[str], job: Job, over: threading.Event) -> None:
    """Stop the child when the job is cancelled: first politely."""
    while not over.wait(_LOOK_EVERY):
        if job.cancelled:
            child.terminate()
            if not over.wait(PATIENCE):
                child.kill()
            return


def _labelled(label: str, step: str) -> str:
    """What is done, and which of several pictures it is at."""
    return f"{label}: {step[0].lower()}{step[1:]}" if " of " in step else label


def _parsed(line: str) -> dict[str, Any] | None:
    if not line.startswith("{"):
        return None
    with contextlib.suppress(ValueError, RecursionError):
        found = json.loads(line)
        return found if isinstance(found, dict) else None
    return None


def _failed(status: int, said: str) -> LucarneError:
    said = said.removeprefix("lucarne: ")
    if status == _BAD_INPUT and said:
        return InputError(said)
    if status < 0:
        return LucarneError("The program that made the picture was ended; there may not be enough memory")
    return LucarneError(said or f"The program that made the picture ended with status {status}")
