"""Photographs from files into a new capture, or more of them into one that is there."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from studio_core.capturing.edits import add_capture, set_photographs
from studio_core.errors import InputError
from studio_core.imaging.photograph import Photograph
from studio_core.scene.capture import Capture, KeptPhotograph
from studio_core.scene.nodes import NodeId, Scene
from studio_core.shading.job import Job
from studio_ui.ask import Ask, Filter
from studio_ui.capture.desk import CaptureDesk
from studio_ui.context import Context


@dataclass(frozen=True, eq=False)
class _Found:
    kept: tuple[KeptPhotograph, ...]
    photographs: tuple[Photograph, ...]
    notes: tuple[str, ...]


class Reading:
    """`added(node)` once a new capture is in the document."""

    def __init__(self, context: Context, ask: Ask) -> None:
        self.added: Callable[[NodeId], object] = lambda node: None
        self.desk: CaptureDesk | None = None
        self._context, self._ask = context, ask

    def choose(self, node: NodeId | None = None) -> None:
        """Ask for files."""
        from studio_core.imaging.photograph_read import PHOTOGRAPHS

        known = Filter("Photographs", PHOTOGRAPHS)
        self.take(self._ask.open_files("Photographs of a room", [known], many=True), node)

    def take(self, paths: Sequence[Path], node: NodeId | None = None) -> None:
        """Read files and put them into the capture `node`, or into a new one."""
        if not paths:
            return
        what = paths[0].name if len(paths) == 1 else f"{len(paths)} photographs"

        def done(found: _Found) -> None:
            for text in found.notes:
                self._context.journal.write(text, "warning")
            self._add(found, node)

        self._context.tasks.run(f"Reading {what}", lambda job: _read(paths, job), done)

    def _add(self, found: _Found, node: NodeId | None) -> None:
        scene = self._context.document.scene
        old = scene.nodes.get(node) if node is not None else None
        if self.desk is not None:
            self.desk.give({photograph.digest: photograph for photograph in found.photographs})
        if isinstance(old, Capture):
            known = {kept.digest for kept in old.photographs}
            new = tuple(kept for kept in found.kept if kept.digest not in known)
            if new:
                self._context.editing.apply(set_photographs(scene, old.id, (*old.photographs, *new)))
            return
        edit = add_capture(found.kept, name=_name(scene))
        if self._context.editing.apply(edit):
            made = edit.nodes[0].id
            self._context.session.select([made])
            self.added(made)


def _read(paths: Sequence[Path], job: Job) -> _Found:
    """All that can be read, each once; InputError where that is none."""
    from studio_core.capturing.keeping import take_all

    taken, notes = take_all(paths, job=job)
    if not taken:
        raise InputError(notes[0] if len(notes) == 1 else f"No photograph can be used; {notes[0]}")
    kept: dict[str, KeptPhotograph] = {}
    photographs: list[Photograph] = []
    for photograph, one in taken:
        if photograph.digest in kept:
            notes.append(f"{photograph.facts.name} is the same as {kept[photograph.digest].facts.name}.")
            continue
        # where the file was is nobody's business once the project holds it
        kept[photograph.digest] = one if one.data is None else replace(one, path="")
        photographs.append(photograph)
        notes += photograph.notes
    return _Found(tuple(kept.values()), tuple(photographs), tuple(dict.fromkeys(notes)))


def _name(scene: Scene) -> str:
    """Capture, Capture 2, …"""
    names = {capture.name for capture in scene.of(Capture)}
    number, name = 2, "Capture"
    while name in names:
        name, number = f"Capture {number}", number + 1
    return name
