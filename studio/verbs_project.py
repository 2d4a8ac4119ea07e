"""`lucarne copy` and `lucarne compact`: what a project file keeps besides its newest version."""

from __future__ import annotations

import argparse
import os

from studio.headless import Headless
from studio.verbs import check_target, result
from studio_core.errors import InputError


def copy(options: argparse.Namespace, program: Headless) -> None:
    """The newest version, or an earlier one, alone in a project of its own: no undo, no earlier versions."""
    from studio_core.project.lock import acquire
    from studio_core.project.store import load, save_copy_without_history

    source, out = options.project, options.out
    check_target(out, (".lucarne",), "projects")
    if os.path.lexists(out):
        raise InputError(f"{out} is there already: give the copy another name")
    loaded = load(source, revision=options.revision)
    with acquire(out):
        save_copy_without_history(loaded.scene, out)
    values = {
        "project": str(source),
        "copy": str(out),
        "revision": loaded.revision.id,
        "bytes": out.stat().st_size,
    }
    text = f"{out}: version {loaded.revision.id} of {source.name} alone, {values['bytes'] / 1e6:.2f} MB"
    result(options, program, values, text)


def compact(options: argparse.Namespace, program: Headless) -> None:
    """Drops earlier versions, if nobody has the project open."""
    from studio_core.project.lock import acquire
    from studio_core.project.outline import revisions
    from studio_core.project.store import compact as drop

    path = options.project
    dropped = len(revisions(path)) - 1  # refuses what is no project before it is locked
    with acquire(path):
        freed = max(drop(path), 0)
    values = {"project": str(path), "dropped": dropped, "freed_bytes": freed, "bytes": path.stat().st_size}
    count = f"{dropped} earlier version{'' if dropped == 1 else 's'} dropped"
    result(options, program, values, f"{path}: {count}, {freed / 1e6:.2f} MB freed")
