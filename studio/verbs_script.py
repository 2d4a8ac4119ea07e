"""`lucarne script`: a Python file with the console's names, on a project or on an empty scene."""

from __future__ import annotations

import argparse
import sys
import tokenize
import traceback
import types
from collections.abc import Callable
from pathlib import Path
from typing import Any

from studio.headless import Headless
from studio_core.document import Document
from studio_core.errors import InputError
from studio_core.project.records import LoadedProject
from studio_core.scripting import Names
from studio_core.session import Session
from studio_core.shading.job import Job


def script(options: argparse.Namespace, program: Headless) -> int:
    """Run the file as `__main__`; 1 when it raises. Nothing is saved unless the script says so."""
    file: Path = options.file
    if not file.is_file():
        raise InputError(f"{file}: there is no such file")
    document, project = open_project(options.project)
    session = _session(document)
    main = types.ModuleType("__main__")
    main.__file__ = str(file)
    names = Names(
        document,
        session,
        program.registry,
        lambda: program.services,
        namespace=main.__dict__,
        run=_shown(program),
        save=lambda path: _save(document, project, path),
    )
    argv, path, before = sys.argv, list(sys.path), sys.modules["__main__"]
    sys.argv = [str(file), *options.args]
    sys.path.insert(0, str(file.resolve().parent))
    sys.modules["__main__"] = main
    try:
        with tokenize.open(file) as opened:
            source = opened.read()
        exec(compile(source, str(file), "exec", dont_inherit=True), main.__dict__)
    except Exception as error:  # the user's own code: a traceback is what helps
        trace = error.__traceback__
        while trace is not None and trace.tb_frame.f_code.co_filename != str(file):
            trace = trace.tb_next
        traceback.print_exception(type(error), error, trace)
        return 1
    finally:
        names.close()
        sys.argv, sys.path[:], sys.modules["__main__"] = argv, path, before
    return 0


def open_project(path: Path | None) -> tuple[Document, LoadedProject | None]:
    """The project with its undo history, as the window opens it; an empty document without one."""
    from studio_core.project.store import load

    if path is None:
        return Document(), None
    loaded = load(path)
    document = Document(loaded.scene)
    if loaded.history is not None:
        document.restore(*loaded.history.opened())
    return document, loaded


def _session(document: Document) -> Session:
    """Looking through the first camera, or at everything."""
    from studio_core.shading.offline import scene_view

    return Session(scene_view(document.scene, None, 960, 540)) if document.scene.nodes else Session()


def _save(document: Document, project: LoadedProject | None, path: Path | None) -> None:
    """A new revision of the project, unless somebody has it open; with a path a copy without history."""
    from studio_core.project.lock import acquire
    from studio_core.project.records import History
    from studio_core.project.store import save

    if path is not None:
        save(path, document.scene, label="Copy", fresh=True)
        return
    if project is None:
        raise InputError("there is no project to save: give save() a path, or run lucarne script --project")
    with acquire(project.path):
        history = History(document.history, document.position)
        save(project.path, document.scene, label="Script", history=history, session=project.session)


def _shown(program: Headless) -> Callable[[str, Callable[[Job], Any]], Any]:
    """Heavy work with its progress on stderr."""

    def run(label: str, work: Callable[[Job], Any]) -> Any:
        with program.job(label) as job:
            return work(job)

    return run
