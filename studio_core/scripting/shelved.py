"""What scripts do with the library of materials: take one of it, keep one in it."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import replace
from pathlib import Path
from typing import Any

from studio_core.document import Document
from studio_core.edits import AddMaterial
from studio_core.errors import EditError
from studio_core.library.lucmat import Kept, alike
from studio_core.library.shelf import Shelf, folded
from studio_core.scene.nodes import Material, Scene, new_id


class Shelved(ABC):
    """Part of the names that scripts have."""

    _document: Document

    @property
    @abstractmethod
    def scene(self) -> Scene:
        """The scene as it is now."""

    @abstractmethod
    def material(self, name: Any) -> Material:
        """A material as it is now."""

    def add_material(self, name: str) -> Material:
        """A material of the library, by its name or by words that only one has, in the scene.

        Where the scene has it already, unchanged, that one.
        """
        shelf = _shelf()
        found = shelf.find(name)
        same = [entry for entry in found if folded(entry.name) == folded(name)]
        chosen = [entry for entry in same or found if entry.kept is not None]
        if len(chosen) != 1:
            some = ", ".join(repr(entry.name) for entry in chosen[:5])
            raise EditError(
                f"{name!r} is not the name of one material of the library" + (f": {some}" if some else "")
            )
        kept = shelf.fetch(chosen[0])
        there = next((m for m in self.scene.materials.values() if alike(m, kept.material)), None)
        if there is not None:
            return there
        made = replace(kept.material, id=new_id("material"))
        self._document.apply(AddMaterial(made, f"Add {made.name}"))
        return self.scene.material(made.id)

    def keep_material(self, material: Any, *tags: str) -> Path:
        """Keep a material for all projects, to be found by tags; its file."""
        return _shelf().put(Kept(self.material(material), tags))


def _shelf() -> Shelf:
    from studio_core.folders import user_materials
    from studio_core.library.presets import PRESETS

    return Shelf(user_materials(), PRESETS)
