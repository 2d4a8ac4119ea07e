"""Painted objects look like objects of the painted material, wherever paint is the same all over."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from oracles.meshes import box

from studio_core.arrays import frozen_map
from studio_core.contract import Services
from studio_core.raster import PictureStage
from studio_core.scene.diff import Changes, diff
from studio_core.scene.nodes import Camera, Material, MeshObject, PointLamp, Scene
from studio_core.scene.paint import Paint
from studio_core.scene.transform import Transform, looking
from studio_core.shading.artifacts import Casters, Lighting, Shapes, Surfaces
from studio_core.shading.coefficients import CoefficientTable
from studio_core.shading.error_meter import ErrorMeter
from studio_core.shading.frame import Frame
from studio_core.shading.job import Job
from studio_core.shading.offline import backend_params, scene_view
from studio_core.shading.painting import coefficient_changes, painted
from studio_core.shading.path_tracing import PathSettings, chosen_points, indirect_layer
from studio_core.shading.path_world import PathWorlds
from studio_core.shading.pipeline import Pipeline


@pytest.fixture(scope="module")
def services(host, workers):
    return Services(workers, host)


MODELS = {
    "lambert": {"base_color": (0.5, 0.4, 0.3)},
    "phong": {"diffuse": (0.4, 0.3, 0.2), "specular": (0.2, 0.2, 0.2), "exponent": 30.0},
    "ggx": {"base_color": (0.5, 0.4, 0.3), "metallic": 0.2, "roughness": 0.4},
}
CHANGES = {
    "lambert": {"base_color": (0.2, -0.1, 0.1)},
    "phong": {"diffuse": (0.1, 0.1, -0.1), "specular": (0.3, 0.2, 0.1)},
    "ggx": {"base_color": (-0.2, 0.1, 0.1), "metallic": 0.3, "roughness": 0.15},
}


def scene_of(model, paint=None, more=None):
    values = {**MODELS[model], **(more or {})}
    material = Material(id="m", name="M", model=model, values=frozen_map(values))
    thing = MeshObject(id="box", geometry=box((1, 1, 1), (-0.5, 0, -0.5)), materials=("m",), paint=paint)
    eye = looking((1.6, 1.4, 2.0), (0, 0.5, 0))
    lamp = PointLamp(id="lamp", intensity=3.0, transform=Transform((1.5, 2.0, 1.0)))
    return Scene().with_materials(material).with_nodes(thing, lamp, Camera(id="eye", transform=eye))


def everywhere(changes, rng=None):
    """Paint of these changes at points all over the box."""
    rng = rng or np.random.default_rng(0)
    sides = np.concatenate([np.eye(3), -np.eye(3)])
    normals = np.repeat(sides, 20, axis=0)
    places = rng.uniform(-0.5, 0.5, normals.shape)
    places = np.where(normals != 0, 0.5 * normals, places) + np.array([0, 0.5, 0])
    wide = {name: np.broadcast_to(v, (len(places), *np.shape(v))) for name, v in changes.items()}
    return Paint.of(places, normals, np.zeros(len(places)), wide)


def pipeline_of(services, host):
    return Pipeline([*host.get("backend", "reference").stages(services), PictureStage(services)])


def frame_of(scene, host):
    view = dataclasses.replace(scene_view(scene, "eye", 48, 36), antialias=1)
    params = backend_params(host.get("backend", "reference"), {"directions": "1024", "vertices": 600})
    return Frame(scene, view, params, 1)


@pytest.mark.parametrize("model", list(MODELS))
def test_paint_that_is_alike_all_over_is_another_material(model, services, host):
    change = CHANGES[model]
    other = {
        name: tuple(np.add(MODELS[model][name], v)) if np.ndim(v) else MODELS[model][name] + v
        for name, v in change.items()
    }
    pictures = []
    for scene in (scene_of(model, everywhere(change)), scene_of(model, None, other), scene_of(model)):
        frame = frame_of(scene, host)
        pictures.append(pipeline_of(services, host).update(frame, Changes(), Job("shade")).linear)
    made, expected, plain = pictures
    np.testing.assert_allclose(made, expected, rtol=2e-3, atol=1e-4 * expected.max())
    assert np.abs(made - plain).max() > 0.05 * plain.max()


def test_paint_follows_its_object_and_edits_redo_only_what_depends_on_it(services, host):
    pipeline = pipeline_of(services, host)
    before = scene_of("ggx")
    pipeline.update(frame_of(before, host), Changes(), Job("shade"))
    after = scene_of("ggx", everywhere(CHANGES["ggx"]))
    node = dataclasses.replace(before["box"], paint=after["box"].paint)
    after = before.with_nodes(node)
    made = pipeline.update(frame_of(after, host), diff(before, after), Job("shade")).linear
    fresh = pipeline_of(services, host).update(frame_of(after, host), Changes(), Job("shade")).linear
    np.testing.assert_allclose(made, fresh, rtol=1e-5, atol=1e-6)
    moved = after.with_nodes(dataclasses.replace(node, transform=Transform((0.2, 0.0, 0.1))))
    made = pipeline.update(frame_of(moved, host), diff(after, moved), Job("shade")).linear
    fresh = pipeline_of(services, host).update(frame_of(moved, host), Changes(), Job("shade")).linear
    np.testing.assert_allclose(made, fresh, rtol=1e-5, atol=1e-6)


@pytest.mark.parametrize("model", ["phong", "ggx"])
def test_the_truth_sees_paint(model, services, host):
    pipeline = pipeline_of(services, host)
    frame = frame_of(scene_of(model, everywhere(CHANGES[model])), host)
    pipeline.update(frame, Changes(), Job("shade"))
    error = ErrorMeter(services, 200)(pipeline, frame, Job("measure"))
    assert error.vertices.relative_rmse < 2e-3
    assert error.picture.relative_rmse < 0.02


def test_paths_see_paint(services, host):
    layers = []
    other = {"base_color": (0.3, 0.5, 0.4), "metallic": 0.5, "roughness": 0.55}
    for paint, values in ((everywhere(CHANGES["ggx"]), None), (None, other), (None, None)):
        scene = scene_of("ggx", paint, values)
        beside = box((3, 0.02, 3), (-1.5, -0.02, -1.5))
        white = Material(id="w", values=frozen_map({"base_color": (0.8, 0.8, 0.8)}))
        scene = scene.with_materials(white).with_nodes(
            MeshObject(id="floor", geometry=beside, materials=("w",))
        )
        pipeline, frame = pipeline_of(services, host), frame_of(scene, host)
        pipeline.update(frame, Changes(), Job("shade"))
        surfaces, casters = pipeline.artifact(Surfaces), pipeline.artifact(Casters)
        lighting, shapes = pipeline.artifact(Lighting), pipeline.artifact(Shapes)
        mesh = surfaces.unrefined.mesh
        near = np.abs(mesh.positions[:, 0] - 0.7) < 0.15
        rows = np.flatnonzero(near & (mesh.normals[:, 1] > 0.9) & (np.abs(mesh.positions[:, 2]) < 0.4))
        world = PathWorlds(services.registry)(scene, surfaces, casters, lighting)
        given = (chosen_points(mesh, rows), shapes.of_points(rows), np.array([1.6, 1.4, 2.0]), world)
        made = indirect_layer(*given, PathSettings(1, 4096), services.workers, Job("paths"))
        layers.append(made.irradiance.mean(axis=0))
    np.testing.assert_allclose(layers[0], layers[1], rtol=0.02)
    assert np.abs(layers[0] / layers[2] - 1).max() > 0.1


def test_the_table_stays_while_nothing_of_it_changes(services, host):
    pipeline = pipeline_of(services, host)
    scene = scene_of("ggx", everywhere(CHANGES["ggx"]))
    pipeline.update(frame_of(scene, host), Changes(), Job("shade"))
    surfaces = pipeline.artifact(Surfaces)
    table = CoefficientTable(services.registry)
    first = table(scene, surfaces)
    assert first.painted.shape == (len(surfaces.mesh), 3 * first.width)
    assert table(scene, surfaces) is first
    bare = scene.with_nodes(dataclasses.replace(scene["box"], paint=None))
    assert not len(table(bare, surfaces).painted)
    shapes = pipeline.artifact(Shapes)
    assert shapes.row is not None


def test_painted_numbers_stay_in_their_range(host):
    from studio_core.params import param_infos

    infos = param_infos(host.brdf("phong").Params)
    assert painted(30.0, np.log(2), infos["exponent"]) == pytest.approx(60)
    assert painted(30.0, 1e9, infos["exponent"]) == infos["exponent"].high
    np.testing.assert_allclose(painted((0.5, 0.5, 0.5), (0.7, -0.7, 0.1), infos["diffuse"]), (1, 0, 0.6))


def test_parameters_that_a_model_does_not_have_change_nothing(host):
    material = Material(id="m", model="lambert", values=frozen_map(MODELS["lambert"]))
    made = coefficient_changes(material, host, {"roughness": np.ones(4, np.float32)})
    assert made.shape == (4, 1, 3)
    assert not made.any()
