"""The error meter against errors that are known."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from scenes import sky

from studio_core.contract import Services
from studio_core.raster import PictureStage
from studio_core.scene.diff import Changes
from studio_core.scene.geometry import Image
from studio_core.scene.nodes import Environment, PointLamp, Scene
from studio_core.scene.transform import Transform
from studio_core.shading.artifacts import Hits, Lighting, Picture, Radiance
from studio_core.shading.error_meter import ErrorMeter, SteadyMeter
from studio_core.shading.frame import Frame
from studio_core.shading.job import Job
from studio_core.shading.offline import backend_params, scene_view
from studio_core.shading.pipeline import Pipeline


@pytest.fixture(scope="module")
def services(host, workers):
    return Services(workers, host)


def measured(scene, services, host, *, places=300, fine=False, **values):
    backend = host.get("backend", "reference")
    pipeline = Pipeline([*backend.stages(services), PictureStage(services)])
    view = dataclasses.replace(scene_view(scene, None, 64, 36), antialias=1, fine_edges=fine)
    params = backend_params(backend, {"directions": "32768", "vertices": 1800, **values})
    frame = Frame(scene, view, params, 1)
    made = pipeline.update(frame, Changes(), Job("shade"))
    return ErrorMeter(services, places)(pipeline, frame, Job("measure")), made, pipeline, frame


def test_brute_force_has_no_error_at_its_vertices(services, host, little_scene):
    meter, _, _, _ = measured(little_scene(), services, host)
    assert meter.vertices.relative_rmse < 1e-5
    assert 0 < meter.picture.relative_rmse < 0.5


def test_coarse_directions_and_coarse_meshes_show(services, host, little_scene):
    scene = little_scene()
    fine, _, _, _ = measured(scene, services, host)
    few, _, _, _ = measured(scene, services, host, directions="1024")
    many, _, _, _ = measured(scene, services, host, vertices=20_000)
    assert few.vertices.relative_rmse > 20 * fine.vertices.relative_rmse
    assert many.picture.p99 < 0.5 * fine.picture.p99


def test_the_estimate_meets_the_error_of_all_pixels(services, host, little_scene):
    scene = little_scene()
    some, _, _, _ = measured(scene, services, host, places=400)
    every, made, _, _ = measured(scene, services, host, places=10**9)
    assert isinstance(made, Picture)
    assert every.picture.places == int((made.node >= 0).sum())
    assert abs(some.picture.relative_rmse - every.picture.relative_rmse) < 4 * some.picture.uncertainty + 1e-4


def test_finer_edges_leave_what_is_measured(services, host, little_scene):
    plain, _, _, _ = measured(little_scene(), services, host)
    fine, made, pipeline, _ = measured(little_scene(), services, host, fine=True)
    assert len(pipeline.artifact(Hits).edges.pixels) > 50
    assert fine.picture == plain.picture
    assert np.isfinite(made.linear).all()


def test_every_light_layer_has_its_error(services, host, little_scene):
    lamp = PointLamp(id="lamp", name="Lamp", transform=Transform((1, 2, 1)), intensity=3.0)
    scene = little_scene().with_nodes(lamp)
    meter, _, pipeline, _ = measured(scene, services, host)
    assert set(meter.layers) == set(pipeline.artifact(Radiance).layers)
    assert "lamp" in meter.layers
    assert all(np.isfinite(e.relative_rmse) for e in meter.layers.values())


def test_layers_that_brute_force_does_not_make_are_left_out(services, host, little_scene):
    scene = little_scene()
    plain, _, pipeline, frame = measured(scene, services, host)
    radiance = pipeline.artifact(Radiance)
    other = dataclasses.replace(next(iter(radiance.layers.values())))
    radiance.layers["bounced"] = other
    meter = ErrorMeter(services, 300)(pipeline, frame, Job("measure"))
    assert meter == plain
    assert set(meter.layers) == {"sky"}


def test_more_places_can_be_asked_for(services, host, little_scene):
    _, _, pipeline, frame = measured(little_scene(), services, host, places=50)
    meter = ErrorMeter(services, 50)
    few, many = (meter(pipeline, frame, Job("measure"), places) for places in (None, 500))
    assert (few.picture.places, many.picture.places) == (50, 500)
    assert many.picture.uncertainty < few.picture.uncertainty
    errors = many.as_dict()
    assert errors["picture"]["p99"] > 0
    assert errors["layers"]["sky"]["p99"] == many.layers["sky"].p99


def test_the_hits_of_a_refined_mesh_are_its_own(services, host, little_scene):
    """Radiance of a refined mesh brings its hits; those of the stage before it may be another mesh's."""
    plain, _, pipeline, frame = measured(little_scene(), services, host)

    class Refined:
        def artifact(self, kind):
            found = pipeline.artifact(kind)
            return dataclasses.replace(found, face=np.full_like(found.face, -1)) if kind is Hits else found

    assert ErrorMeter(services, 300)(Refined(), frame, Job("measure")) == plain


def test_suns_have_no_error_at_vertices(services, host, little_scene):
    image = np.array(sky(64).pixels)
    image[9, 20] = [9e3, 7e3, 4e3]
    scene = little_scene(environment=Image(image))
    meter, _, pipeline, _ = measured(scene, services, host)
    assert pipeline.artifact(Lighting).sun is not None
    assert meter.vertices.relative_rmse < 1e-5


def test_a_wrong_picture_is_seen_as_wrong(services, host, little_scene):
    scene = little_scene()
    _, _, pipeline, frame = measured(scene, services, host)
    radiance = pipeline.artifact(Radiance)
    environment = next(scene.of(Environment))
    layer = radiance.layers[environment.id]
    layer.terms[...] *= np.float32(1.5)
    meter = ErrorMeter(services, 300)(pipeline, frame, Job("measure"))
    assert meter.vertices.relative_rmse == pytest.approx(0.5, abs=0.1)


def test_a_scene_without_light_has_no_error(services, host, little_scene):
    bare = {k: v for k, v in little_scene().nodes.items() if k != "sky"}
    meter, _, _, _ = measured(Scene(bare, little_scene().materials), services, host)
    assert meter.picture.relative_rmse == meter.vertices.relative_rmse == 0
    assert not meter.layers


def test_an_empty_picture_has_no_error_to_measure(services, host, little_scene):
    scene = Scene()
    meter, _, _, _ = measured(scene, services, host)
    assert meter is None


def test_each_further_look_is_at_other_places_of_the_same_picture(services, host, little_scene):
    once, _, pipeline, frame = measured(little_scene(), services, host, places=100)
    meter = SteadyMeter(ErrorMeter(services, 100))
    made = [meter(pipeline, frame, Job("measure")) for _ in range(4)]
    assert made[0] == once
    assert [one.picture.places for one in made] == [100, 200, 300, 400]
    assert [one.vertices.places for one in made] == [100, 200, 300, 400]
    assert len({one.picture.relative_rmse for one in made}) == 4
    every, _, _, _ = measured(little_scene(), services, host, places=10**9)
    off = abs(made[-1].picture.relative_rmse - every.picture.relative_rmse)
    assert off < 4 * made[-1].picture.uncertainty + 1e-4


def test_another_picture_is_looked_at_anew(services, host, little_scene):
    _, _, pipeline, frame = measured(little_scene(), services, host, places=50)
    meter = SteadyMeter(ErrorMeter(services, 50))
    meter(pipeline, frame, Job("measure"))
    _, _, other, later = measured(little_scene(), services, host, places=50, directions="1024")
    assert meter(other, later, Job("measure")).picture.places == 50
