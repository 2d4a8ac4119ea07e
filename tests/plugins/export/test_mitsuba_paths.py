"""Path traced light against Mitsuba's `path` integrator: the same scene and places, independent noise."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from path_rooms import Stand, furnished, globe, stand
from scenes import sky

from studio.bench.harness import unbiased_rmse
from studio_core.contract import Services
from studio_core.parallel import Workers
from studio_core.scene.geometry import Image, Texture
from studio_core.scene.nodes import AreaLamp, Environment, Material, MeshObject, PointLamp, Scene
from studio_core.scene.transform import Transform, looking
from studio_core.shading.coefficients import CoefficientTable
from studio_core.shading.job import Job
from studio_core.shading.path_tracing import PathSettings, indirect_halves
from studio_core.shading.surface_points import some_hits, surface_points
from studio_plugins.export.mitsuba import EXPORTER
from studio_plugins.export.mitsuba_paths import indirect_irradiance, indirect_radiance

pytest.importorskip("mitsuba", reason="the extra `peers` (Mitsuba 3) is not installed")

LAMP = PointLamp(id="lamp", intensity=5.0, transform=Transform((1.0, 2.0, 1.0)))
PANEL = AreaLamp(
    id="panel", intensity=6.0, width=1.0, height=0.6, transform=looking((0.8, 2.4, 0.9), (-0.5, 0, -0.5))
)
SKY = Environment(id="sky", image=sky(), intensity=0.8)
SUN = np.array(sky(64).pixels)
SUN[9, 20] = [3e3, 2.5e3, 2e3]
CHECKS = np.kron(np.indices((6, 6)).sum(axis=0) % 2, np.ones((4, 4)))[..., None] * np.array([0.8, 0.5, 0.2])
METAL = {"roughness": 0.5, "metallic": 1.0, "base_color": (0.9, 0.6, 0.3)}
PAINTS = {
    "matte": (Material(id="paint", name="P", values={"base_color": (0.2, 0.5, 0.7)}), PANEL),
    "phong": (Material(id="paint", name="P", model="phong", values={"exponent": 16.0}), SKY),
    "metal": (Material(id="paint", name="P", model="ggx", values=METAL), LAMP),
    "plastic": (
        Material(
            id="paint", name="P", model="ggx", values={"roughness": 0.4},
            textures={"base_color": Texture(Image(CHECKS.astype(np.float32)), (3.0, 2.0))},
        ),
        Environment(id="sky", image=Image(SUN)),
    ),
}  # fmt: skip


@pytest.fixture
def services(host: Any) -> Any:
    with Workers(2) as workers:
        yield Services(workers, host)


def ours(found: Stand, services: Services, bounces: int, samples: int, count: int) -> Any:
    """Radiance in two halves (P, 3), the eye, and the places, of random pixels without pictures on them."""
    scene, surfaces, hits = found.scene, found.surfaces, found.hits
    plain = np.array([not scene.material(name).textures for name in surfaces.materials])
    there = np.flatnonzero(hits.face >= 0)
    there = there[plain[surfaces.mesh.face_material[hits.face[there]]]]
    seen = some_hits(hits, np.sort(np.random.default_rng(0).choice(there, count, replace=False)))
    eye = np.asarray(found.frame.view.transform.translation)
    points = surface_points(surfaces, seen, eye)
    shapes = dataclasses.replace(found.shapes, row=None)
    table = CoefficientTable(services.registry)(scene, surfaces)
    looks = table.plain[points.material].reshape(count, -1, 3)
    halves = indirect_halves(
        points, shapes, eye, found.world, PathSettings(bounces, samples), services.workers, Job("trace")
    )
    return [(half.terms * looks).sum(axis=1).astype(float) for half in halves], eye, points


@pytest.mark.parametrize("paint", sorted(PAINTS))
def test_the_two_path_tracers_agree(host: Any, services: Any, tmp_path: Path, paint: str) -> None:
    material, light = PAINTS[paint]
    scene = furnished((light,), material)
    found = stand(scene, services, 1500)
    halves, eye, points = ours(found, services, 3, 4096, 150)
    EXPORTER.save(scene, tmp_path, host)
    place = points.positions + points.origin
    direction = place - eye
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    rays = place - 1e-3 * direction, direction
    theirs = [indirect_radiance(tmp_path, *rays, 3, 1024, seed=seed) for seed in (1, 2)]
    truth = (theirs[0].value + theirs[1].value) / 2
    made = (halves[0] + halves[1]) / 2
    noise = np.sqrt((theirs[0].error ** 2 + theirs[1].error ** 2).sum()) / 2 / truth.sum()
    assert made.sum() == pytest.approx(truth.sum(), rel=0.01 + 4 * noise)
    assert unbiased_rmse(made, theirs[0].value, theirs[1].value) < 0.05
    assert np.sqrt(np.mean((made - truth) ** 2)) < 0.12 * truth.mean()


def test_their_irradiance_in_a_globe_is_known(host: Any, tmp_path: Path) -> None:
    material = Material(id="m", name="m", values={"base_color": (0.8, 0.4, 0.0)})
    scene = (
        Scene()
        .with_materials(material)
        .with_nodes(
            MeshObject(id="globe", geometry=globe(4), materials=("m",)),
            PointLamp(id="lamp", intensity=2.0),
        )
    )
    EXPORTER.save(scene, tmp_path, host)
    out = np.random.default_rng(1).normal(size=(30, 3))
    out /= np.linalg.norm(out, axis=1, keepdims=True)
    made = indirect_irradiance(tmp_path, 0.99 * out, -out, 2, 256)
    np.testing.assert_allclose(made.value.mean(axis=0), [2 * 1.44, 2 * 0.56, 0], rtol=0.02)
    assert made.relative_error < 0.02


def test_light_that_comes_straight_is_none(host: Any, tmp_path: Path) -> None:
    alone = Scene().with_materials(Material(id="wall")).with_nodes(
        dataclasses.replace(furnished(())["floor"], materials=("wall",)), PANEL, SKY
    )  # fmt: skip
    EXPORTER.save(alone, tmp_path, host)
    up = np.array([[0.0, 1.0, 0.0]])
    assert not indirect_irradiance(tmp_path, np.zeros((1, 3)), up, 3, 64).value.any()
    assert not indirect_radiance(tmp_path, up, -up, 3, 64).value.any()
