"""Materials out of the library: into the scene, or onto things there, each time in one step."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

from studio_core.library.lucmat import Kept
from studio_core.library.shelf import Entry
from studio_core.scene.nodes import MaterialId, NodeId
from studio_ui.context import Context
from studio_ui.library.library import MaterialLibrary
from studio_ui.objects.choosing import meshes_below
from studio_ui.objects.material_drag import Probing, dropped_on
from studio_ui.objects.new_material import added, given


class Taking:
    """`taken(material)` tells which one of the scene's was added or given last."""

    def __init__(self, context: Context, library: MaterialLibrary) -> None:
        self.taken: Callable[[MaterialId], object] = lambda material: None
        self._context, self._library = context, library

    @property
    def whom(self) -> str:
        """The chosen objects in words; "" where none can have a material."""
        meshes = meshes_below(self._context.document.scene, self._context.session.selection)
        return "" if not meshes else meshes[0].name if len(meshes) == 1 else f"{len(meshes)} objects"

    def add(self, entries: Sequence[Entry]) -> None:
        """Add materials to the scene."""
        found = [entry for entry in entries if entry.kept is not None]
        if found:
            self._library.fetch(found, self.add_kept)

    def add_kept(self, found: Sequence[Kept]) -> None:
        """The same for whole ones."""
        made, edit = added(self._context.document.scene, [kept.material for kept in found])
        if self._context.editing.apply(edit):
            self.taken(made[-1])

    def give(self, entry: Entry, nodes: Sequence[NodeId], slot: int | None = None) -> None:
        """Give things a material, in one slot only or in all."""
        if entry.kept is not None:
            self._library.fetch([entry], lambda found: self.give_kept(found[0], nodes, slot))

    def give_kept(self, kept: Kept, nodes: Sequence[NodeId], slot: int | None = None) -> None:
        """The same for a whole one."""
        scene = self._context.document.scene
        made = given(scene, [node for node in nodes if node in scene.nodes], kept.material, slot)
        if made is not None and self._context.editing.apply(made[1]):
            self.taken(made[0])

    def use(self, entries: Sequence[Entry]) -> None:
        """What a double click does: the last of them for what is chosen, or all of them into the scene."""
        if entries and self.whom:
            self.give(entries[-1], self._context.session.selection)
        else:
            self.add(entries)

    # what is dropped

    def give_key(self, key: str, nodes: Sequence[NodeId], slot: int | None = None) -> None:
        """By an entry's key, as drags have it."""
        entry = self._library.entry(key)
        if entry is not None:
            self.give(entry, nodes, slot)

    def add_key(self, key: str) -> None:
        """The same, into the scene."""
        entry = self._library.entry(key)
        if entry is not None:
            self.add([entry])

    def drop(self, viewport: Probing, key: str, x: float, y: float) -> None:
        """Onto what is seen at a point of the canvas."""
        place = dropped_on(self._context, viewport, x, y)
        if place is not None:
            self.give_key(key, (place[0],), place[1])

    def take_files(self, paths: Sequence[Path], place: tuple[NodeId, int | None] | None = None) -> None:
        """Files of materials, into the scene; the last of them onto a thing, where there is one."""
        entries = [Entry(None, path) for path in paths]

        def done(found: list[Kept]) -> None:
            if place is None:
                self.add_kept(found)
            else:
                self.give_kept(found[-1], (place[0],), place[1])

        if entries:
            self._library.fetch(entries, done)


__all__ = ["Taking"]
