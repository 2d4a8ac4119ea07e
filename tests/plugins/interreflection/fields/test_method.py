"""The method as a whole, in the pipeline: lit rooms, moves, edits, and light that comes from nowhere."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from scenes import cube, floor

from studio_core.arrays import frozen_map
from studio_core.contract import Services
from studio_core.edits import Move
from studio_core.scene.diff import Aspect, Changes, diff, view_changed
from studio_core.scene.geometry import Geometry, Image, Texture
from studio_core.scene.nodes import AreaLamp, Camera, Material, MeshObject, Scene
from studio_core.scene.transform import Transform, axis_angle, looking
from studio_core.shading.artifacts import (
    Casters,
    Indirect,
    Lighting,
    Radiance,
    Shapes,
    Surfaces,
)
from studio_core.shading.frame import Frame, IndirectChoice
from studio_core.shading.indirect import with_indirect
from studio_core.shading.job import Job
from studio_core.shading.offline import scene_view
from studio_core.shading.path_tracing import PathSettings, chosen_points, indirect_layer
from studio_core.shading.path_world import PathWorlds
from studio_core.shading.pipeline import Pipeline
from studio_plugins.interreflection.fields.method import METHOD, Params

FEW = Params(components=8, shells=8, cells=8, lights=32, rays=64)


def scene(model="lambert", values=None):
    """Two plates that face each other and a cube between, a lamp shining up on the upper one."""
    paint = Material(id="paint", name="Paint", model=model, values=frozen_map(values or {}))
    white = Material(id="white", name="White", values=frozen_map({"base_color": (0.8, 0.6, 0.4)}))
    flipped = axis_angle((1, 0, 0), 180)
    return (
        Scene()
        .with_materials(paint, white)
        .with_nodes(
            MeshObject(id="floor", name="Floor", geometry=floor(4.0), materials=("white",)),
            MeshObject(
                id="ceiling",
                name="Ceiling",
                geometry=floor(4.0),
                materials=("white",),
                transform=Transform((0, 2.5, 0), flipped),
            ),
            MeshObject(
                id="cube",
                name="Cube",
                geometry=cube(0.6),
                materials=("paint",),
                transform=Transform((0.8, 0.8, 0.3)),
            ),
            AreaLamp(
                id="lamp",
                name="Lamp",
                width=0.5,
                height=0.5,
                intensity=20.0,
                transform=looking((-0.8, 1.2, 0), (-0.8, 2.5, 0.01)),
            ),
            Camera(id="camera", name="Camera", transform=looking((3.5, 1.5, 3.5), (0, 1, 0))),
        )
    )


class Driven:
    def __init__(self, host, workers, first, params=FEW):
        self.services = Services(workers, host)
        backend = host.get("backend", "reference")
        self.pipeline = Pipeline(with_indirect(backend.stages(self.services), self.services))
        self.params, self.scene = backend.Params(vertices=1500, lamp_samples=4), first
        self.method = params
        self.update(first)

    def update(self, now, method=None):
        changes = Changes() if now is self.scene else diff(self.scene, now)
        if method is not None:
            self.method, changes = method, changes | view_changed(Aspect.QUALITY)
        view = scene_view(now, None, 64, 48)
        frame = Frame(now, view, self.params, 1, False, IndirectChoice("fields", self.method))
        made = self.pipeline.update(frame, changes, Job("test"))
        assert isinstance(made, Radiance)
        self.scene, self.eye = now, np.asarray(view.transform.translation)
        self.made = self.pipeline.artifact(Indirect)
        return self.made

    def truth(self, points, samples=128):
        surfaces, casters = self.pipeline.artifact(Surfaces), self.pipeline.artifact(Casters)
        shapes, lighting = self.pipeline.artifact(Shapes), self.pipeline.artifact(Lighting)
        world = PathWorlds(self.services.registry)(self.scene, surfaces, casters, lighting)
        settings = PathSettings(self.method.bounces, samples)
        some = chosen_points(surfaces.mesh, points)
        return indirect_layer(
            some, shapes.of_points(points), self.eye, world, settings, self.services.workers, Job("test")
        )


@pytest.fixture(scope="module")
def driven(host, workers):
    return Driven(host, workers, scene())


def test_it_is_registered(host):
    assert host.get("indirect", "fields") is METHOD


def test_light_between_matte_objects_is_near_the_truth(driven):
    """Coarse fields, a scene without much that hides: mean of each within 15 %, root mean square 35 %."""
    driven.update(scene())
    made = driven.made
    points = np.flatnonzero(made.valid)[::4]
    truth = driven.truth(points)
    mine = made.layer.irradiance[points]
    assert mine.mean(axis=0) == pytest.approx(truth.irradiance.mean(axis=0), rel=0.15)
    assert np.sqrt(((mine - truth.irradiance) ** 2).mean()) < 0.35 * truth.irradiance.mean()
    assert (made.layer.terms >= 0).all()
    assert not made.layer.terms[~made.valid].any()


def test_a_move_makes_no_field(driven):
    driven.update(scene())
    before = driven.made.layer.irradiance.copy()
    now = Move({"cube": Transform((-0.9, 1.4, -0.2), axis_angle((1, 1, 0), 50), 1.0)})(driven.scene)
    made = driven.update(now)
    assert made.counts["fields_made"] == 0
    assert not np.allclose(made.layer.irradiance, before, rtol=0.01)


def test_after_edits_it_is_what_a_fresh_one_makes(driven, host, workers):
    driven.update(scene())
    now = Move({"cube": Transform((0.2, 1.0, -0.4), axis_angle((0, 1, 0), 30), 1.2)})(scene())
    lamp = dataclasses.replace(now["lamp"], intensity=7.0, tint=(1.0, 0.5, 0.2))
    edited = driven.update(now.with_nodes(lamp))
    fresh = Driven(host, workers, now.with_nodes(lamp)).made
    np.testing.assert_array_equal(edited.valid, fresh.valid)
    np.testing.assert_allclose(edited.layer.irradiance, fresh.layer.irradiance, rtol=1e-4, atol=1e-6)


def test_gains_are_linear(driven):
    first = driven.update(scene()).layer.irradiance.copy()
    lamp = dataclasses.replace(driven.scene["lamp"], intensity=40.0)
    made = driven.update(driven.scene.with_nodes(lamp))
    np.testing.assert_allclose(made.layer.irradiance, 2 * first, rtol=1e-4, atol=1e-6)
    assert made.counts["fields_made"] == 0


def test_more_bounces_are_more_light(driven):
    once = driven.update(scene(), dataclasses.replace(FEW, bounces=1)).layer.irradiance.sum()
    thrice = driven.update(scene(), dataclasses.replace(FEW, bounces=3)).layer.irradiance.sum()
    assert once < thrice
    driven.update(scene(), FEW)


def test_instances_share_a_field(driven):
    driven.update(scene())
    twin = dataclasses.replace(
        driven.scene["cube"], id="twin", name="Twin", transform=Transform((-1, 0.7, 1))
    )
    made = driven.update(driven.scene.with_nodes(twin))
    assert made.counts["fields_made"] == 0
    assert made.facts["sources"] == 4


def test_glossy_sources_and_receivers(host, workers):
    values = {"diffuse": (0.2, 0.2, 0.2), "specular": (0.5, 0.5, 0.5), "exponent": 10.0}
    glossy = Driven(host, workers, scene("phong", values), dataclasses.replace(FEW, functions=16))
    made = glossy.made
    mesh = made.surfaces.mesh
    own = np.flatnonzero(made.valid & (mesh.object == 2))
    assert made.facts["K"] == 16
    assert (made.layer.terms >= 0).all()
    assert np.isfinite(made.layer.terms).all()
    truth = glossy.truth(own)
    mine = made.layer.terms[own].mean(axis=(0, 2))
    true = truth.terms.mean(axis=(0, 2))
    assert mine == pytest.approx(true, rel=0.25)


def test_no_light_is_no_light(host, workers):
    lamp = dataclasses.replace(scene()["lamp"], intensity=0.0)
    made = Driven(host, workers, scene().with_nodes(lamp)).made
    assert not made.layer.terms.any()
    assert not made.layer.irradiance.any()


@pytest.mark.parametrize("kind", ["nothing", "one", "glass", "degenerate", "far"])
def test_odd_scenes(host, workers, kind):
    first = scene()
    sources = 3
    match kind:
        case "nothing":
            first, sources = Scene().with_nodes(first["camera"], first["lamp"]), 0
        case "one":
            alone = (first[name] for name in ("camera", "lamp", "floor"))
            first, sources = Scene().with_materials(first.material("white")).with_nodes(*alone), 1
        case "glass":  # lets light pass, and receives it
            first, sources = first.with_materials(Material(id="paint", name="Glass", opacity=0.2)), 2
        case "degenerate":
            flat = Geometry(np.zeros((3, 3), np.float32), np.array([[0, 1, 2]], np.uint32))
            first = first.with_nodes(dataclasses.replace(first["cube"], id="flat", geometry=flat))
        case "far":
            away = Transform((1e4, 0, 2e3))
            nodes = first.nodes.values()
            first = first.with_nodes(*(dataclasses.replace(n, transform=away @ n.transform) for n in nodes))
    made = Driven(host, workers, first).made
    assert made.facts["sources"] == sources
    assert np.isfinite(made.layer.terms).all()
    assert (made.layer.terms >= 0).all()
    if kind == "one":
        assert not made.layer.terms.any()
    if kind == "far":
        near = Driven(host, workers, scene()).made
        mean = made.layer.irradiance.mean(axis=0)
        assert mean == pytest.approx(near.layer.irradiance.mean(axis=0), rel=0.02)


def test_normal_maps_turn_light_as_the_truth_does(host, workers):
    x = np.tile(0.4 * np.cos(2 * np.pi * np.arange(32) / 8), (32, 1))
    normals = np.stack([-x, 0 * x, np.ones_like(x)], axis=2)
    normals /= np.linalg.norm(normals, axis=2, keepdims=True)
    texture = Texture(Image(((normals + 1) / 2).astype(np.float32), "data"))
    bumpy = dataclasses.replace(scene().material("white"), textures=frozen_map({"normal": texture}))
    driven = Driven(host, workers, scene().with_materials(bumpy))
    tilts = driven.made.layer.tilts
    points = np.flatnonzero(driven.made.valid)[::3]
    truth = driven.truth(points, 256).tilts
    assert tilts is not None
    for field in range(3):
        mine, true = tilts[points][:, field, 0].ravel(), truth[:, field, 0].ravel()
        assert np.corrcoef(mine, true)[0, 1] > 0.9
