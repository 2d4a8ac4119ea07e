"""Files of measured reflectance become materials."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from studio_core.brdfs import merl
from studio_core.registry import PluginHost
from studio_core.scene.nodes import Scene
from studio_core.shading.materials import resolve
from studio_plugins.brdfs import plugin
from studio_plugins.brdfs.measured import SLOT
from studio_plugins.brdfs.measured_files import MERL


def test_a_merl_file_becomes_a_material_that_can_be_shown(tmp_path: Path) -> None:
    path = tmp_path / "blue felt.binary"
    merl.write(path, np.broadcast_to([0.01, 0.02, 0.1], (*merl.SHAPE, 3)))
    model = MERL.load(path)
    (material,) = model.materials
    assert (material.name, material.model, model.nodes, model.notes) == ("blue felt", "measured", (), ())
    host = PluginHost([plugin])
    assert host.get("importer", "merl") is MERL
    found = resolve(Scene().with_materials(material).material(material.id), host)
    assert found.problem == ""
    assert found.tables == (material.tables[SLOT],)


def test_what_was_filled_and_what_is_too_bright_is_said(tmp_path: Path) -> None:
    path = tmp_path / "odd.binary"
    known = np.ones(merl.SHAPE, np.bool_)
    known[:, 45:] = False
    merl.write(path, np.full((*merl.SHAPE, 3), 0.4), known)
    filled, bright = MERL.load(path).notes
    assert "could not be measured" in filled
    assert bright.startswith("It returns up to 1.26 times the light that arrives (seen from 0° to 90°)")
