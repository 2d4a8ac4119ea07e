"""The progressive path traced method: what it shows on its way, and when it need not start again."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest
from path_rooms import furnished, stand

from studio_core.contract import Services
from studio_core.errors import Cancelled
from studio_core.scene.diff import Aspect, Changes
from studio_core.scene.nodes import Material, PointLamp
from studio_core.scene.transform import Transform
from studio_core.shading.artifacts import Casters, Indirect, Lighting, Receivers, Shapes, Surfaces
from studio_core.shading.frame import IndirectChoice
from studio_core.shading.job import Job
from studio_core.shading.pipeline import Pipeline
from studio_plugins.reference.paths import IN_HAND, METHOD, Params

NOTHING = Changes()
LAMP = PointLamp(id="lamp", intensity=5.0, transform=Transform((1.0, 2.0, 1.0)))


class Given:
    """A stage that hands on what is put in."""

    needs: tuple[type, ...] = ()
    dirtied_by = Aspect.NONE

    def __init__(self, artifact: Any) -> None:
        self.gives, self.artifact = type(artifact), artifact

    def run(self, frame, inputs, job):
        return self.artifact


class Method:
    """The method's stages over a scene, as whoever runs it would."""

    def __init__(self, scene, services, vertices=600):
        self.found = stand(scene, services, vertices)
        mesh = self.found.surfaces.mesh
        seen = mesh.normals @ np.array([0.3, 0.6, 0.5]) > 0
        self.receivers = Receivers(seen, np.array([0.0, 1.0, 6.0]))
        given = [getattr(self.found, name) for name in ("surfaces", "casters", "shapes", "lighting")]
        self.pipeline = Pipeline([*map(Given, given), Given(self.receivers), *METHOD.stages(services)])

    def update(self, changes=NOTHING, scene=None, job=None, moving=False, **params) -> Indirect:
        choice = IndirectChoice("paths", Params(**params))
        frame = dataclasses.replace(
            self.found.frame, scene=scene or self.found.scene, indirect=choice, moving=moving
        )
        return self.pipeline.update(frame, changes, job or Job("paths"))


@pytest.fixture(scope="module")
def services(host, workers):
    return Services(workers, host)


def test_it_is_registered(host):
    assert host.get("indirect", "paths") is METHOD
    stages = METHOD.stages(Services(None, host))
    assert stages[-1].gives is Indirect
    assert {*stages[0].needs} == {Surfaces, Casters, Shapes, Lighting, Receivers}


def test_it_shows_every_step_and_ends_with_all_paths(services):
    shown: list[Indirect] = []
    method = Method(furnished((LAMP,)), services)
    made = method.update(job=Job("paths", on_publish=shown.append), samples=100)
    assert [one.facts["paths a vertex"] for one in shown] == [4, 16, 64]
    assert made.facts["paths a vertex"] == 100
    assert made.final
    assert not any(one.final for one in shown)
    seen = method.receivers.seen
    np.testing.assert_array_equal(made.valid, seen)
    assert not made.layer.irradiance[~seen].any()
    errors = [_distance(one, made, seen) for one in shown]
    assert errors == sorted(errors, reverse=True)


def test_nobody_listens_no_steps(services):
    method = Method(furnished((LAMP,)), services)
    made = method.update(samples=64)
    assert made.counts["paths"] == 64 * int(method.receivers.seen.sum())


def test_in_hand_it_is_quick_and_at_rest_it_goes_on(services):
    method = Method(furnished((LAMP,)), services)
    moving = method.update(moving=True, samples=64)
    assert moving.facts["paths a vertex"] == IN_HAND
    assert not moving.final
    rest = method.update(Changes(aspects=Aspect.VIEW), samples=64)
    assert rest.facts["paths a vertex"] == 64
    assert rest.final
    assert method.update(Changes(aspects=Aspect.VIEW), samples=64) is rest


def test_gains_and_colours_count(services):
    method = Method(furnished((LAMP,)), services)
    first = method.update(samples=64)
    scene = furnished((dataclasses.replace(LAMP, intensity=10.0),))
    second = method.update(Changes(aspects=Aspect.GAIN), scene, samples=64)
    np.testing.assert_allclose(second.layer.irradiance, 2 * first.layer.irradiance, rtol=1e-3, atol=1e-6)
    soot = Material(id="wall", name="Wall", values={"base_color": (0.0,) * 3})
    darker = furnished((LAMP,)).with_materials(soot)
    black = method.update(Changes(aspects=Aspect.MATERIAL), darker, samples=16)
    assert not black.layer.irradiance.any()


def test_more_bounces_bring_more_light(services):
    method = Method(furnished((LAMP,)), services)
    quality = Changes(aspects=Aspect.QUALITY)
    light = [
        float(method.update(quality, samples=256, **more).layer.irradiance.mean())
        for more in ({"bounces": 1}, {"bounces": 3}, {"converged": True})
    ]
    assert light[0] < light[1] < light[2] < 2 * light[1]


def test_it_stops_and_starts_again(services):
    method = Method(furnished((LAMP,)), services)
    job = Job("paths")
    seen: list[Indirect] = []

    def stop(artifact):
        seen.append(artifact)
        job.cancel()

    job._on_publish = stop
    with pytest.raises(Cancelled):
        method.update(job=job, samples=64)
    assert len(seen) == 1
    assert method.update(samples=64).final


def test_normal_maps_have_their_tilts(services, workers):
    """Terms at leaning normals, from the same rays, as `LayerRadiance.tilts` wants them."""
    from studio_core.scene.geometry import Image, Texture
    from studio_core.shading.path_tracing import PathSettings, chosen_points, indirect_layer
    from studio_core.shading.tilting import turned_points

    bump = np.zeros((4, 4, 3), np.float32)
    bump[...] = np.array([0.3, 0.0, 0.954]) / 2 + 0.5
    paint = Material(
        id="paint", name="P", values={"base_color": (0.6,) * 3}, textures={"normal": Texture(Image(bump))}
    )
    method = Method(furnished((LAMP,), paint), services)
    shapes = method.found.shapes
    assert shapes.tilt is not None
    made = method.update(samples=1024).layer
    assert made.tilts is not None
    mesh = method.found.surfaces.mesh
    some = np.flatnonzero(
        method.receivers.seen & (mesh.material == method.found.surfaces.materials.index("paint"))
    )
    points, own = chosen_points(mesh, some), shapes.of_points(some)
    x = 0.3
    lean = np.tile(np.array([x, 0, np.sqrt(1 - x * x)], np.float32), (len(some), 1))
    plain = dataclasses.replace(own, tilt=None)
    direct = indirect_layer(
        points, plain, method.receivers.eye, method.found.world, PathSettings(3, 1024, 9), workers, Job("t"),
        facing=turned_points(points, lean),
    ).terms[:, 0]  # fmt: skip
    told = made.terms[some, 0] + x * made.tilts[some, 0, 0] + (1 - lean[0, 2]) * made.tilts[some, 2, 0]
    error = np.sqrt(np.mean((told - direct) ** 2)) / direct.mean()
    upright = np.sqrt(np.mean((made.terms[some, 0] - direct) ** 2)) / direct.mean()
    assert error < 0.1
    assert error < 0.5 * upright


def _distance(one: Indirect, other: Indirect, seen: Any) -> float:
    return float(np.square(one.layer.irradiance[seen] - other.layer.irradiance[seen]).mean())
