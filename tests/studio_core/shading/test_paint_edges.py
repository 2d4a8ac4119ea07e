"""Paint is a reason to refine a mesh, also where no vertex sees it."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from scenes import floor

from studio_core.arrays import frozen_map
from studio_core.contract import Services
from studio_core.raster import PictureStage
from studio_core.scene.diff import Changes
from studio_core.scene.nodes import Camera, Material, MeshObject, PointLamp, Scene
from studio_core.scene.paint import Paint
from studio_core.scene.transform import Transform, looking
from studio_core.shading.artifacts import Surfaces
from studio_core.shading.frame import Frame
from studio_core.shading.job import Job
from studio_core.shading.offline import backend_params, scene_view
from studio_core.shading.pipeline import Pipeline
from studio_core.shading.refinement import Adaptive
from studio_core.shading.stages import common_stages

CENTRE = np.array([0.61, 0.0, 0.47])


@pytest.fixture(scope="module")
def services(host, workers):
    return Services(workers, host)


def spot(radius):
    """A red disc on points a tenth of its radius apart, and grey about it."""
    across = np.arange(-2 * radius, 2.05 * radius, radius / 10)
    x, z = (one.ravel() for one in np.meshgrid(across, across))
    places = CENTRE + np.stack([x, 0 * x, z], axis=1)
    within = (np.hypot(x, z) < radius)[:, None]
    change = np.where(within, (0.3, -0.3, -0.3), 0.0)
    return Paint.of(
        places, np.broadcast_to([0.0, 1.0, 0.0], places.shape), np.zeros(len(x)), {"base_color": change}
    )


def ground(paint):
    grey = Material(id="m", model="lambert", values=frozen_map({"base_color": (0.5, 0.5, 0.5)}))
    node = MeshObject(id="floor", geometry=floor(4.0), materials=("m",), paint=paint)
    eye = Camera(id="eye", transform=looking((0.5, 2.2, 1.2), (0.5, 0, 0.4)))
    lamp = PointLamp(id="lamp", intensity=5.0, transform=Transform((0.5, 3.0, 0.5)))
    return Scene().with_materials(grey).with_nodes(node, lamp, eye)


def shown(services, scene, vertices, goal):
    backend = services.registry.get("backend", "reference")
    own = backend.stages(services)[len(common_stages(services)) :]
    pipeline = Pipeline([*common_stages(services, lambda params: goal), *own, PictureStage(services)])
    view = dataclasses.replace(scene_view(scene, "eye", 160, 120), antialias=1)
    params = backend_params(backend, {"directions": "1024", "vertices": vertices})
    picture = pipeline.update(Frame(scene, view, params, 1), Changes(), Job("shade")).linear
    return picture, len(pipeline.artifact(Surfaces).mesh)


@pytest.mark.parametrize("radius", [0.3, 0.06])
def test_a_painted_spot_is_refined_where_it_ends(services, radius):
    scene = ground(spot(radius))
    truth, _ = shown(services, scene, 40_000, None)
    coarse, few = shown(services, scene, 600, None)
    fine, more = shown(services, scene, 600, Adaptive(target=0.005))
    before, after = (np.sqrt(((one - truth) ** 2).mean()) / truth.mean() for one in (coarse, fine))
    assert after < 0.4 * before
    assert few < more <= 4 * few


def test_what_is_painted_alike_needs_no_vertex(services):
    alike = Paint.of([CENTRE], [(0, 1, 0)], [0], {"base_color": [(0.3, -0.3, -0.3)]})
    plain, painted = (
        shown(services, ground(paint), 600, Adaptive(target=0.005))[1] for paint in (None, alike)
    )
    assert painted <= 1.1 * plain
