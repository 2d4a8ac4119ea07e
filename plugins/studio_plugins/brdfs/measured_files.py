"""Importers of measured reflectance: a file becomes a material."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from studio_core.arrays import frozen_map
from studio_core.brdfs import merl, tabulated
from studio_core.brdfs.scattered import table_of
from studio_core.contract import ImportedModel
from studio_core.scene.geometry import Table
from studio_core.scene.nodes import Material, new_id
from studio_plugins.brdfs.measured import CURVE, MODEL, SLOT


class Merl:
    """The MERL database's `.binary`; satisfies `studio_core.contract.Importer`. Reflectance has no unit."""

    label = "Measured material (MERL)"
    extensions: tuple[str, ...] = (".binary",)

    def load(self, path: Path, unit: float = 1.0) -> ImportedModel:
        """One material, and what was filled in and what returns too much light."""
        found = merl.read(path)
        notes = []
        if found.invalid > 0:
            notes.append(
                f"{found.invalid:.1%} of its directions could not be measured and were taken from the "
                "nearest smaller angle."
            )
        return measured_model(found.table, notes)


class Tabulated:
    """Text by directions and wavelengths; satisfies `studio_core.contract.Importer`."""

    label = "Measured material (table)"
    extensions: tuple[str, ...] = (".astm", ".csv")

    def load(self, path: Path, unit: float = 1.0) -> ImportedModel:
        """One material, and what was left out, cut or guessed."""
        found = tabulated.read(path)
        return measured_model(table_of(found.samples, found.name), list(found.notes))


def measured_model(table: Table, notes: list[str]) -> ImportedModel:
    """A material of the table, which is named as the table is."""
    most = MODEL.albedo(table).max(axis=1)
    if most.max() > 1:
        angles = 90 * np.flatnonzero(most > 1) / (CURVE - 1)
        notes.append(
            f"It returns up to {most.max():.2f} times the light that arrives (seen from {angles[0]:.0f}° to "
            f"{angles[-1]:.0f}°); it is scaled down there unless Keep energy is switched off."
        )
    material = Material(
        id=new_id("material"), name=table.name, model=MODEL.id, tables=frozen_map({SLOT: table})
    )
    return ImportedModel((), (material,), tuple(notes))


MERL, TABULATED = Merl(), Tabulated()
