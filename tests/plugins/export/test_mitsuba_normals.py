"""Normal maps in exported scenes, seen by Mitsuba: bumps are where the studio has them, turned alike."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from scenes import floor

from studio_core.contract import Services
from studio_core.parallel import Workers
from studio_core.raster import PictureStage
from studio_core.registry import PluginHost
from studio_core.scene.diff import everything
from studio_core.scene.geometry import Image, Texture
from studio_core.scene.nodes import Camera, DirectionalLamp, Material, MeshObject, Scene
from studio_core.scene.transform import looking
from studio_core.shading.artifacts import Picture
from studio_core.shading.frame import Frame
from studio_core.shading.job import Job
from studio_core.shading.normal_maps import of_heights
from studio_core.shading.offline import backend_params, scene_view
from studio_core.shading.pipeline import Pipeline
from studio_plugins.cuts.backend import BACKEND
from studio_plugins.export import mitsuba_run
from studio_plugins.export.mitsuba import EXPORTER

pytest.importorskip("mitsuba", reason="the extra `peers` (Mitsuba 3) is not installed")

WIDTH, HEIGHT = 64, 48


def ramps() -> Image:
    """Ridges along u, steeper on one side, and lower ones along v."""
    v, u = (np.indices((32, 32)) + 0.5) / 32
    heights = np.sin(2 * np.pi * u) + 0.4 * np.sin(4 * np.pi * u + 1) + 0.5 * np.cos(2 * np.pi * v)
    return of_heights(Image(heights[::-1, :, None].astype(np.float32), "data"), 0.06)


def scene(strong: float, rotation: float) -> Scene:
    texture = Texture(ramps(), (2.0, 2.0), (0.1, 0.3), rotation)
    material = Material(id="m", values={"normal": strong}, textures={"normal": texture})
    return (
        Scene()
        .with_materials(material)
        .with_nodes(
            MeshObject(id="floor", geometry=floor(2.0), materials=("m",)),
            Camera(id="eye", transform=looking((0.3, 2.2, 1.0), (0, 0, 0)), fov=40.0),
            DirectionalLamp(
                id="sun", transform=looking((1.0, 1.4, 0.4), (0, 0, 0)), intensity=3.0, angle=1.0
            ),
        )
    )


def shown(scene: Scene, host: PluginHost, workers: Workers) -> np.ndarray:
    services = Services(workers, host)
    pipeline = Pipeline([*BACKEND.stages(services), PictureStage(services)])
    view = dataclasses.replace(scene_view(scene, None, WIDTH, HEIGHT), antialias=2)
    pipeline.update(
        Frame(scene, view, backend_params(BACKEND, {"vertices": 800}), 1), everything(scene), Job("shade")
    )
    found = pipeline.artifact(Picture)
    assert found is not None
    return np.asarray(found.linear, np.float64)


@pytest.mark.parametrize(("strong", "rotation"), [(1.0, 0.0), (1.0, 35.0), (-0.7, 90.0)])
def test_bumps_lie_as_in_the_studio(
    host: PluginHost, workers: Workers, tmp_path: Path, strong: float, rotation: float
) -> None:
    made = scene(strong, rotation)
    assert not EXPORTER.save(made, tmp_path, host)
    loaded = mitsuba_run.load(tmp_path, width=WIDTH, height=HEIGHT)
    mi = mitsuba_run.mitsuba()
    true = np.asarray(mi.render(loaded, spp=32, integrator=mi.load_dict({"type": "direct"})), np.float64)

    def wrong(other: Scene) -> float:
        ours = shown(other, host, workers)
        return float(np.sqrt(((ours - true[..., :3]) ** 2).mean()) / true.mean())

    found = wrong(made)
    assert found < 0.05
    for other in (scene(0.0, 0.0), scene(-strong, rotation), scene(strong, rotation + 90)):
        assert wrong(other) > 3 * found
