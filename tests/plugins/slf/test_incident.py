"""What vertices near strokes see is kept, and its light for as long as nothing changes it."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from path_rooms import furnished, stand
from scenes import sky

from studio_core.contract import Services
from studio_core.parallel import Workers
from studio_core.scene.nodes import Environment, PointLamp
from studio_core.scene.transform import Transform
from studio_core.shading.artifacts import Shapes
from studio_core.strokes.solution import Lit
from studio_plugins.slf import incident
from studio_plugins.slf.incident import Incident, averaged
from studio_plugins.slf.places import Places

SKY = Environment(id="sky", name="Sky", image=sky(), intensity=1.0)
BULB = PointLamp(id="bulb", name="Bulb", transform=Transform((0.5, 1.8, 1.0)), intensity=2.0)


@pytest.fixture(scope="module")
def services(host):
    return Services(Workers(2), host)


@pytest.fixture(scope="module")
def room(services):
    scene = furnished([SKY, BULB])
    made = stand(scene, services, 1500)
    shapes = Shapes.__new__(Shapes)  # no part of what is seen
    return scene, Lit(made.surfaces, made.casters, shapes, made.lighting, None, None)


def at(lit, vertices):
    mesh = lit.surfaces.unrefined.mesh
    own = np.asarray(vertices)
    axes = np.tile(np.eye(3), (len(own), 1, 1))
    axes[:, 2] = mesh.normals[own]
    none = np.zeros(len(own), np.int64)
    return Places(mesh.positions[own].astype(np.float64), axes, axes[:, 2], own, none, none, none)


def seen(light):
    return light.light[light.row], light.open[light.row], light.axes[light.row]


def test_vertices_that_are_known_are_not_looked_from_again(room, services):
    scene, lit = room
    kept = Incident(services)
    first, more = np.array([40, 7, 7, 300]), np.array([300, 12, 40, 41])
    assert kept.at(scene, lit, at(lit, first)).rays >= 3 * 1024
    lamps = kept.at(scene, lit, at(lit, first)).rays
    assert lamps < 1024
    both = kept.at(scene, lit, at(lit, more))
    assert 2 * 1024 <= both.rays < 3 * 1024
    alone = Incident(services).at(scene, lit, at(lit, more))
    for mine, other in zip(seen(both), seen(alone), strict=True):
        np.testing.assert_array_equal(mine, other)
    np.testing.assert_array_equal(both.strength, alone.strength)


def test_other_light_is_seen(room, services):
    scene, lit = room
    kept = Incident(services)
    places = at(lit, np.array([40, 7, 300]))
    before = kept.at(scene, lit, places)
    assert before.open.any()
    brighter = scene.with_nodes(dataclasses.replace(scene["sky"], intensity=2.0))
    after = kept.at(brighter, lit, places)
    np.testing.assert_allclose(after.light[after.row], 2 * before.light[before.row], rtol=1e-5)
    dark = kept.at(scene.with_nodes(dataclasses.replace(scene["sky"], hidden=True)), lit, places)
    assert not dark.light.any()


def test_what_is_not_asked_for_goes_when_it_is_too_much(room, services, monkeypatch):
    scene, lit = room
    monkeypatch.setattr(incident, "MOST", 4)
    kept = Incident(services)
    kept.at(scene, lit, at(lit, np.array([1, 2, 3])))
    made = kept.at(scene, lit, at(lit, np.array([3, 4, 5])))
    assert len(made.light) == 3
    assert kept.at(scene, lit, at(lit, np.array([3]))).light is made.light


def test_means_of_a_sky_are_those_of_cells():
    sky_ = np.random.default_rng(0).uniform(0, 1, (1 << 12, 3)).astype(np.float32)
    np.testing.assert_allclose(averaged(sky_, 10)[3], sky_[12:16].mean(axis=0), rtol=1e-6)
    assert averaged(sky_, 12) is sky_
