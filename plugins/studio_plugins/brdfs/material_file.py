"""Importer of the library's own files: a `.lucmat` becomes a material of the scene."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from studio_core.contract import ImportedModel
from studio_core.library import lucmat
from studio_core.scene.nodes import new_id


class MaterialFile:
    """A material in a file of its own; satisfies `studio_core.contract.Importer`."""

    label = "Material"
    extensions: tuple[str, ...] = (lucmat.SUFFIX,)

    def load(self, path: Path, unit: float = 1.0) -> ImportedModel:
        """One material under a new id; ProjectError where it cannot be read."""
        found = lucmat.read(path).material
        return ImportedModel((), (replace(found, id=new_id("material")),))


MATERIAL = MaterialFile()
