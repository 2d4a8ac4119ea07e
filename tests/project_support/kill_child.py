"""Forks workers that save without pause, kills each with SIGKILL at a random time, and checks what is left.

Arguments: a folder, the way ("in place", "whole", "recovery"), the number of trials, a seed. A worker tells
the number of every save that has returned through a pipe. Prints one JSON object.
"""

from __future__ import annotations

import itertools
import json
import os
import random
import signal
import sys
import time
from collections import Counter
from pathlib import Path
from typing import Any

from project_support.samples import renamed, small_scene
from studio_core.document import Step
from studio_core.project import lock, recovery, store
from studio_core.project.codec import scene_digest
from studio_core.project.records import History
from studio_core.scene.nodes import Scene

BASES = [small_scene(seed, faces=40 * 4**seed) for seed in range(5)]
RESET_EVERY = 25


def scene(number: int) -> Scene:
    """The scene of the save of that number."""
    return renamed(BASES[number % len(BASES)], f"Save {number}")


def work(path: Path, way: Any, first: int, pipe: int) -> None:
    """Save until killed."""
    held = lock.acquire(path)
    file = recovery.RecoveryFile(recovery.recovery_path(path), path)
    for number in itertools.count(first):
        now = scene(number)
        history = History((Step("Open", scene(number - 1)), Step("Edit", now)), 1)
        if way == "recovery":
            file.write(now, history=history)
        else:
            store.save(path, now, history=history, way=way)
        os.write(pipe, number.to_bytes(8, "big"))
    held.release()


def acknowledged(pipe: int) -> int | None:
    """The last number that came through."""
    data = b""
    while chunk := os.read(pipe, 1 << 16):
        data += chunk
    whole = len(data) // 8 * 8
    return int.from_bytes(data[whole - 8 : whole], "big") if whole else None


def main() -> None:
    """All trials."""
    folder, way, trials = Path(sys.argv[1]), sys.argv[2], int(sys.argv[3])
    rng = random.Random(int(sys.argv[4]))
    path = folder / "p.lucarne"
    target = recovery.recovery_path(path) if way == "recovery" else path
    number = 1
    outcomes: Counter[str] = Counter()
    for trial in range(trials):
        if trial % RESET_EVERY == 0:
            recovery.discard(recovery.recovery_path(path))
            store.save(path, scene(number), fresh=True)
            last = number if way != "recovery" else None
        reader, writer = os.pipe()
        worker = os.fork()
        if worker == 0:
            os.close(reader)
            try:
                work(path, way, number + 1, writer)
            finally:
                os._exit(1)
        os.close(writer)
        time.sleep(rng.expovariate(1 / 0.05))
        os.kill(worker, signal.SIGKILL)
        status = os.waitpid(worker, 0)[1]
        assert os.WIFSIGNALED(status), f"trial {trial}: the worker ended by itself"
        told = acknowledged(reader)
        os.close(reader)
        last = told if told is not None else last
        journal = target.with_name(f"{target.name}-journal")
        outcomes["cut in the middle" if journal.exists() else "cut between"] += 1
        if last is None and not target.exists():
            outcomes["nothing kept yet"] += 1
        else:
            found = store.load(target)
            kept = int(found.scene["a"].name.split()[1])
            assert scene_digest(found.scene) == scene_digest(scene(kept))
            assert last is None or kept in (last, last + 1), f"trial {trial}: {kept} after {last}"
            if kept != number and found.history is not None:
                assert found.history.steps[0].scene["a"].name == f"Save {kept - 1}"
            outcomes["last acknowledged" if kept == last else "newer"] += 1
            number = last = kept
        if way == "recovery":
            offered = recovery.find_recovery(path)
            assert target.exists() is (offered is not None), f"trial {trial}"
            assert offered is None or offered.saved is not None, f"trial {trial}"
        lock.acquire(path).release()  # the dead hold no lock
    print(json.dumps({"outcomes": outcomes, "saves": number}))


if __name__ == "__main__":
    main()
