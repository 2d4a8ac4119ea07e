"""A measured material in a scene looks as measured, in every backend, also from a project file."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from oracles.brdf import ggx
from scenes import little_scene

from studio_core.arrays import frozen_map
from studio_core.brdfs.half_difference import filled, grid
from studio_core.contract import Services
from studio_core.edits import SetTable
from studio_core.project.store import load, save
from studio_core.scene.geometry import Table
from studio_core.scene.nodes import Material, Scene
from studio_core.shading.offline import backend_params, picture, scene_view

SHAPE = (90, 30, 24)
VALUES = {"base_color": (0.7, 0.3, 0.1), "metallic": 0.0, "roughness": 0.5, "specular": 0.5}


@pytest.fixture(scope="module")
def services(host, workers):
    return Services(workers, host)


@pytest.fixture(scope="module")
def table() -> Table:
    wi, wo = grid(SHAPE)
    known = (wi[..., 2] > 0) & (wo[..., 2] > 0)
    made = np.zeros((*SHAPE, 3))
    made[known] = ggx(VALUES, wo[known], wi[known])
    return Table(filled(made, known), "Lacquer")


def seen(services: Services, host: Any, backend: str, scene: Scene) -> np.ndarray:
    chosen = host.get("backend", backend)
    params = backend_params(chosen, {"directions": "1024", "vertices": 1500})
    return np.asarray(picture(scene, scene_view(scene, None, 48, 27), chosen, params, services).linear)


@pytest.mark.parametrize("backend", ["reference", "cuts"])
def test_a_table_of_a_model_looks_like_the_model(
    services: Services, host: Any, table: Table, backend: str, tmp_path: Path
) -> None:
    scene = little_scene(cube_model="ggx", cube_values=VALUES)
    model = seen(services, host, backend, scene)
    measured = scene.with_materials(
        Material(id="paint", name="Paint", model="measured", tables=frozen_map({"measurement": table}))
    )
    found = seen(services, host, backend, measured)
    assert np.linalg.norm(found - model) < 0.003 * np.linalg.norm(model)
    np.testing.assert_allclose(found, model, atol=0.01)
    assert not np.allclose(found, model, rtol=1e-7)  # it is the table that is seen
    save(tmp_path / "room.lucarne", measured)
    again = load(tmp_path / "room.lucarne").scene
    np.testing.assert_allclose(seen(services, host, backend, again), found, rtol=1e-5)
    bare = SetTable("paint", "measurement", None)(measured)
    assert "no measurement" in _problem(bare, host)


def _problem(scene: Scene, host: Any) -> str:
    from studio_core.shading.materials import shapes

    return shapes(scene, ("paint",), host).problems[0]
