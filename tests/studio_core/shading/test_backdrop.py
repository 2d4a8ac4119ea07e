"""Furniture in a photographed room: what catches shadows shows the photograph, as it is lit."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from scenes import little_scene, sky

from studio_core.contract import Services
from studio_core.scene.nodes import Environment, PointLamp, Scene
from studio_core.scene.transform import Transform, looking
from studio_core.session import View
from studio_core.shading.offline import backend_params, measured_picture, picture

ABOVE = View(looking((0.01, 5, 0), (0, 0, 0)), 60, 48, 48, antialias=1)


def photographed(**fields) -> Scene:
    """The little scene on a floor that catches shadows."""
    scene = little_scene(floor_size=6.0, environment=sky(64))
    there = next(scene.of(Environment))
    floor = dataclasses.replace(scene.material("matt"), catches=True)
    return scene.with_nodes(dataclasses.replace(there, **fields)).with_materials(floor)


def without_cube(scene: Scene) -> Scene:
    return scene.with_nodes(dataclasses.replace(scene["cube"], hidden=True))


@pytest.fixture
def draw(host, workers):
    def make(scene, view=ABOVE, name="reference", **params):
        backend = host.get("backend", name)
        given = backend_params(backend, {"directions": "4096", "vertices": 3000, **params})
        return picture(scene, view, backend, given, Services(workers, host))

    return make


def test_where_nothing_stands_the_photograph_is_as_it_was(draw):
    for fields in ({}, {"projection": "on the ground"}, {"azimuth": 70.0, "tint": (1.0, 0.5, 2.0)}):
        scene = without_cube(photographed(**fields))
        bare = draw(scene.with_nodes(dataclasses.replace(scene["floor"], hidden=True)))
        shown = draw(scene)
        assert (shown.coverage > 0.5).mean() > 0.9
        np.testing.assert_allclose(shown.linear, bare.linear, rtol=6e-3)


def test_shadows_lie_around_what_stands_there_and_nowhere_else(draw):
    scene = photographed()
    before, after = draw(without_cube(scene)), draw(scene)
    cube = after.nodes.index("cube")
    ratio = (after.linear / before.linear).mean(axis=2)
    rows, columns = np.nonzero(after.node == cube)
    beside = ratio[rows.max() + 1, columns.min() : columns.max() + 1]
    assert (beside < 0.85).all()
    assert (ratio[after.node != cube] < 1.004).all()
    assert ratio[0, 0] > 0.98  # far from it


def test_a_lamp_of_the_scene_brightens_the_photograph(draw):
    scene = without_cube(photographed())
    lamp = PointLamp(id="lamp", name="Lamp", transform=Transform((0, 1, 0)), intensity=2.0)
    ratio = draw(scene.with_nodes(lamp)).linear / draw(scene).linear
    middle, corner = ratio[24, 24], ratio[1, 1]
    assert (middle > 1.5).all()
    assert (corner < middle).all()
    assert (ratio > 1).all()


def test_what_catches_shadows_casts_none_itself(draw):
    scene = photographed()
    floating = dataclasses.replace(scene["floor"], transform=Transform((0, 2.0, 0)))
    below = View(looking((2.5, 1.2, 2.5), (0, 0.4, 0)), 40, 32, 24, antialias=1)
    over, under = draw(scene.with_nodes(floating), below), draw(scene, below)
    on_top = (over.node == over.nodes.index("cube")) & (under.node == under.nodes.index("cube"))
    assert on_top.sum() > 50
    np.testing.assert_array_equal(over.linear[on_top], under.linear[on_top])


def test_without_a_background_nothing_is_shown(draw):
    shown = draw(photographed(background=False))
    floor = shown.node == shown.nodes.index("floor")
    assert floor.any()
    assert (shown.linear[floor] == 0).all()


def test_the_light_of_an_environment_that_is_switched_off_leaves_lamps(draw):
    scene = without_cube(photographed(intensity=0.0))
    lamp = PointLamp(id="lamp", name="Lamp", transform=Transform((0, 1, 0)), intensity=2.0)
    assert (draw(scene).linear == 0).all()
    assert (draw(scene.with_nodes(lamp)).linear[20:28, 20:28] > 0).all()


def test_cuts_show_what_the_reference_shows(draw):
    scene = photographed()
    exact = draw(scene)
    made = draw(scene, name="cuts", directions="4096")
    np.testing.assert_allclose(made.linear.mean(), exact.linear.mean(), rtol=0.01)
    assert np.sqrt(((made.linear - exact.linear) ** 2).mean()) < 0.04 * exact.linear.mean()


@pytest.mark.parametrize("directions", ["4096", "32768"])
def test_errors_are_measured_on_the_photograph_too(host, workers, directions):
    """As good as the furniture's, and where nothing stands there is none."""
    backend = host.get("backend", "reference")
    given = backend_params(backend, {"directions": directions, "vertices": 4000})
    services = Services(workers, host)
    lamp = PointLamp(id="lamp", name="Lamp", transform=Transform((1, 2, 0.5)), intensity=2.0)
    for fields in ({}, {"projection": "on the ground", "tint": (1.0, 0.5, 2.0)}):
        scene = photographed(**fields).with_nodes(lamp)
        _, error = measured_picture(scene, ABOVE, backend, given, services, 256)
        assert error is not None
        assert 0.001 < error.picture.relative_rmse < 0.12
    _, error = measured_picture(without_cube(photographed()), ABOVE, backend, given, services, 64)
    assert error is not None
    assert error.picture.relative_rmse < 0.01
