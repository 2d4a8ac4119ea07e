"""What the error meter says of light between surfaces: the truth's own noise is no error."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from path_rooms import furnished

from studio_core.contract import Services
from studio_core.errors import Cancelled
from studio_core.raster import PictureStage
from studio_core.scene.diff import Changes
from studio_core.scene.nodes import Camera, Material, PointLamp
from studio_core.scene.transform import Transform, looking
from studio_core.session import INDIRECT
from studio_core.shading.artifacts import Radiance
from studio_core.shading.compared import compare
from studio_core.shading.error_meter import ErrorMeter
from studio_core.shading.frame import Frame
from studio_core.shading.indirect import with_indirect
from studio_core.shading.job import Job
from studio_core.shading.offline import backend_params, indirect_choice, scene_view
from studio_core.shading.path_tracing import CONVERGED, bounces_of
from studio_core.shading.pipeline import Pipeline

LAMP = PointLamp(id="lamp", intensity=5.0, transform=Transform((1.0, 2.0, 1.0)))
EYE = Camera(id="eye", fov=50.0, transform=looking((1.5, 2.0, 4.5), (-0.5, 0.8, -0.5)))
PAINT = Material(id="paint", name="P", model="ggx", values={"roughness": 0.5, "base_color": (0.7, 0.2, 0.1)})


@pytest.fixture(scope="module")
def services(host, workers):
    return Services(workers, host)


def shown(services, samples=1024, light="all", vertices=2500, **more):
    scene = furnished((LAMP, EYE), PAINT)
    backend = services.registry.get("backend", "reference")
    pipeline = Pipeline([*with_indirect(backend.stages(services), services), PictureStage(services)])
    view = dataclasses.replace(scene_view(scene, None, 64, 36), antialias=1, fine_edges=False)
    params = backend_params(backend, {"vertices": vertices, "directions": "1024"})
    choice = indirect_choice(services.registry, "paths", {"samples": samples, **more})
    frame = Frame(scene, view, params, 7, indirect=choice, light=light)
    pipeline.update(frame, Changes(), Job("shade"))
    return pipeline, frame


@settings(max_examples=30)
@given(st.floats(0.02, 0.5), st.floats(0.0, 0.4), st.integers(0, 1000))
def test_noise_of_the_truth_is_no_error(wrong, noise, seed):
    rng = np.random.default_rng(seed)
    true = rng.uniform(0.5, 1.5, (4000, 3))
    one, other = (true * (1 + noise * rng.normal(size=true.shape)) for _ in range(2))
    made = compare(true * (1 + wrong), one, seed, other)
    exact = wrong * np.sqrt((true**2).mean()) / true.mean()
    room = 8 * noise * (noise + exact) / np.sqrt(len(true)) + 1e-9
    assert made.relative_rmse**2 == pytest.approx(exact**2, abs=room)


def test_two_equal_truths_are_one():
    rng = np.random.default_rng(0)
    a, b = rng.random((2, 50, 3))
    assert compare(a, b, 3, b) == compare(a, b, 3)


def test_path_traced_light_has_hardly_an_error(services):
    pipeline, frame = shown(services)
    made = ErrorMeter(services, 200)(pipeline, frame, Job("measure"))
    assert made.indirect is not None
    assert made.vertices.relative_rmse < 0.02
    assert made.indirect.relative_rmse < 0.25  # interpolated between few vertices
    assert set(made.layers) == {"lamp"}
    assert made.as_dict()["indirect"]["places"] == 200


def test_few_paths_and_wrong_light_show(services):
    pipeline, frame = shown(services, light=INDIRECT)
    radiance = pipeline.artifact(Radiance)
    assert radiance.indirect is not None
    assert not radiance.layers
    right = ErrorMeter(services, 200)(pipeline, frame, Job("measure"))
    assert right.vertices.relative_rmse < 0.08
    radiance.indirect.terms[...] *= np.float32(1.5)
    wrong = ErrorMeter(services, 200)(pipeline, frame, Job("measure"))
    assert wrong.vertices.relative_rmse == pytest.approx(0.5, rel=0.5)
    assert wrong.vertices.relative_rmse > 3 * right.vertices.relative_rmse
    assert wrong.indirect.relative_rmse > right.indirect.relative_rmse
    few = ErrorMeter(services, 200)(*shown(services, samples=4, light=INDIRECT), Job("measure"))
    assert few.vertices.relative_rmse > 4 * right.vertices.relative_rmse


def test_as_many_bounces_as_the_frame_asks_for(services):
    once = shown(services, bounces=1, light=INDIRECT)
    assert bounces_of(once[1]) == 1
    measured = ErrorMeter(services, 200)(*once, Job("measure"))
    assert measured.vertices.relative_rmse < 0.08
    again = indirect_choice(services.registry, "paths", {"converged": True})
    settled = dataclasses.replace(once[1], indirect=again)
    assert bounces_of(settled) == CONVERGED
    assert ErrorMeter(services, 200)(once[0], settled, Job("measure")).vertices.relative_rmse > 0.1


def test_without_it_there_is_no_such_error(services):
    pipeline, frame = shown(services, light="direct")
    made = ErrorMeter(services, 50)(pipeline, frame, Job("measure"))
    assert made.indirect is None
    assert made.as_dict()["indirect"] is None


def test_it_can_be_stopped(services):
    pipeline, frame = shown(services, samples=4)
    job = Job("measure")
    meter = ErrorMeter(services, 100)
    meter(pipeline, frame, Job("measure"))
    job.cancel()
    with pytest.raises(Cancelled):
        meter(pipeline, frame, job)
