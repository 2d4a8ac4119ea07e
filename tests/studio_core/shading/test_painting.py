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
from studio_core.scene.geometry import Image
from studio_core.scene.nodes import Camera, Environment, Material, MeshObject, PointLamp, Scene
from studio_core.scene.paint import Paint
from studio_core.scene.transform import Transform, looking
from studio_core.shading.artifacts import Casters, Lighting, Shapes, Surfaces
from studio_core.shading.coefficients import CoefficientTable
from studio_core.shading.error_meter import ErrorMeter
from studio_core.shading.frame import Frame
from studio_core.shading.job import Job
from studio_core.shading.offline import backend_params, indirect_choice, picture, scene_view
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
    "specgloss": {"diffuse": (0.4, 0.3, 0.2), "specular": (0.05, 0.05, 0.05), "roughness": 0.5},
    "blinn-phong": {"diffuse": (0.4, 0.3, 0.2), "specular": (0.2, 0.2, 0.2), "exponent": 20.0},
    "ward": {"diffuse": (0.4, 0.3, 0.2), "specular": (0.2, 0.2, 0.2), "roughness": 0.4},
    "plastic": {"base_color": (0.5, 0.4, 0.3), "gloss": 0.6, "roughness": 0.3},
    "cloth": {"base_color": (0.2, 0.1, 0.1), "sheen": (0.3, 0.3, 0.2), "roughness": 0.5},
    "ggx-conductor": {"base_color": (0.7, 0.5, 0.3), "roughness": 0.4},
    "ggx-dielectric": {"tint": (0.7, 0.7, 0.7), "ior": 2.0, "roughness": 0.4},
}
CHANGES = {
    "lambert": {"base_color": (0.2, -0.1, 0.1)},
    "phong": {"diffuse": (0.1, 0.1, -0.1), "specular": (0.3, 0.2, 0.1), "exponent": -1.0},
    "ggx": {"base_color": (-0.2, 0.1, 0.1), "metallic": 0.3, "roughness": 0.15},
    "specgloss": {"diffuse": (0.1, 0.1, -0.1), "specular": (0.3, 0.2, 0.1), "roughness": -0.2},
    "blinn-phong": {"exponent": -1.5},
    "ward": {"roughness": 0.2},
    "plastic": {"base_color": (0.1, 0.1, -0.1), "gloss": 0.4, "roughness": 0.3},
    "cloth": {"sheen": (0.3, 0.2, 0.1), "roughness": 0.3},
    "ggx-conductor": {"roughness": 0.3},
    "ggx-dielectric": {"tint": (0.2, 0.1, -0.1), "roughness": 0.2},
}


def repainted(model):
    """The values that a model has under its changes."""
    made = {}
    for name, change in CHANGES[model].items():
        plain = MODELS[model][name]
        logarithmic = name == "exponent"
        made[name] = tuple(np.add(plain, change)) if np.ndim(change) else plain + change
        made[name] = plain * float(np.exp(change)) if logarithmic else made[name]
    return made


def scene_of(model, paint=None, more=None):
    values = {**MODELS[model], **(more or {})}
    material = Material(id="m", name="M", model=model, values=frozen_map(values))
    thing = MeshObject(id="box", geometry=box((1, 1, 1), (-0.5, 0, -0.5)), materials=("m",), paint=paint)
    eye = looking((1.6, 1.4, 2.0), (0, 0.5, 0))
    lamp = PointLamp(id="lamp", intensity=3.0, transform=Transform((1.5, 2.0, 1.0)))
    return Scene().with_materials(material).with_nodes(thing, lamp, Camera(id="eye", transform=eye))


def shining(scene):
    """With a lamp whose highlight is seen on top of the box."""
    return scene.with_nodes(PointLamp(id="behind", intensity=6.0, transform=Transform((-2.0, 1.6, -2.4))))


def everywhere(changes, count=20):
    """Paint of these changes at points all over the box, `count` a side."""
    rng = np.random.default_rng(0)
    sides = np.concatenate([np.eye(3), -np.eye(3)])
    normals = np.repeat(sides, count, axis=0)
    places = rng.uniform(-0.5, 0.5, normals.shape)
    places = np.where(normals != 0, 0.5 * normals, places) + np.array([0, 0.5, 0])
    wide = {name: np.broadcast_to(v, (len(places), *np.shape(v))) for name, v in changes.items()}
    return Paint.of(places, normals, np.zeros(len(places)), wide)


def pipeline_of(services, host):
    return Pipeline([*host.get("backend", "reference").stages(services), PictureStage(services)])


BACKENDS = [
    ("cuts", {}),
    ("cuts", {"pixel_lamps": "true"}),
    ("residual", {}),
    ("reference", {"indirect": "gather"}),
    ("reference", {"indirect": "fields"}),
]


def shaded(scene, backend, options, services, host):
    """(H, W, 3) the picture of a scene on a floor under a sky that is brighter on one side."""
    pixels = np.full((8, 16, 3), 0.2, np.float32)
    pixels[2:4, 3:6] = 4.0
    white = Material(id="w", values=frozen_map({"base_color": (0.8, 0.8, 0.8)}))
    floor = MeshObject(id="floor", geometry=box((3, 0.02, 3), (-1.5, -0.02, -1.5)), materials=("w",))
    sky = Environment(id="sky", image=Image(pixels), background=False)
    scene = shining(scene).with_materials(white).with_nodes(floor, sky)
    method = host.get("backend", backend)
    values = {name: value for name, value in options.items() if name != "indirect"}
    given = backend_params(method, {"directions": "2048", "vertices": "900", **values})
    view = dataclasses.replace(scene_view(scene, "eye", 48, 36), antialias=1)
    between = options.get("indirect") and indirect_choice(host, options["indirect"], {})
    return picture(scene, view, method, given, services, indirect=between).linear


def frame_of(scene, host):
    view = dataclasses.replace(scene_view(scene, "eye", 48, 36), antialias=1)
    params = backend_params(host.get("backend", "reference"), {"directions": "1024", "vertices": 600})
    return Frame(scene, view, params, 1)


@pytest.mark.parametrize("model", list(MODELS))
def test_paint_that_is_alike_all_over_is_another_material(model, services, host):
    painted, other = everywhere(CHANGES[model]), repainted(model)
    pictures = []
    for scene in (scene_of(model, painted), scene_of(model, None, other), scene_of(model)):
        frame = frame_of(shining(scene), host)
        pictures.append(pipeline_of(services, host).update(frame, Changes(), Job("shade")).linear)
    made, expected, plain = pictures
    np.testing.assert_allclose(made, expected, rtol=5e-3, atol=2e-4 * expected.max())
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


def test_every_gloss_is_painted_here(host):
    for name in host.names("brdf"):
        roles = getattr(host.brdf(name), "roles", {})
        assert "gloss" not in roles or roles["gloss"] in CHANGES[name]


@pytest.mark.parametrize(("backend", "options"), BACKENDS)
@pytest.mark.parametrize("model", ["specgloss", "phong", "plastic"])
def test_every_backend_shows_a_painted_gloss(backend, options, model, services, host):
    gloss = host.brdf(model).roles["gloss"]
    made, expected, plain = (
        shaded(scene, backend, options, services, host)
        for scene in (
            scene_of(model, everywhere({gloss: CHANGES[model][gloss]})),
            scene_of(model, None, {gloss: repainted(model)[gloss]}),
            scene_of(model),
        )
    )
    np.testing.assert_allclose(made, expected, rtol=5e-3, atol=2e-3 * expected.max())
    assert np.abs(made - plain).max() > 0.02 * plain.max()


def test_lamps_in_every_pixel_see_a_gloss_that_differs_from_place_to_place(services, host):
    """The lower part of the box is painted: there it is the painted material, elsewhere the plain one."""
    side = everywhere({"roughness": 0.0}, 400)
    changes = np.where(side.places[:, 1] < 0.7, 0.3, 0.0)
    half = Paint.of(side.places, side.normals, side.slots, {"roughness": changes})
    scenes = (scene_of("specgloss", *rest) for rest in ((half,), (None, {"roughness": 0.8}), ()))
    made, dull, plain = (shaded(scene, "residual", {}, services, host) for scene in scenes)
    far = np.abs(dull - plain).max(axis=2)
    differ = far > 0.01 * plain.max()
    alike = [np.abs(made - one).max(axis=2)[differ] < 0.1 * far[differ] for one in (dull, plain)]
    assert min(alike[0].sum(), alike[1].sum()) > 20
    assert (alike[0] | alike[1]).mean() > 0.7


@pytest.mark.parametrize("model", ["phong", "ggx", "plastic"])
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
