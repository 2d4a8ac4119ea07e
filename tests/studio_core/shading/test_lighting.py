"""The stage of all lights: exact at rest, quick while a hand turns them, nothing done twice."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from scenes import sky

from studio_core.contract import Services
from studio_core.kernels.environment import map_power
from studio_core.scene.diff import Aspect, Changes, diff, view_changed
from studio_core.scene.geometry import Image
from studio_core.scene.nodes import Environment, PointLamp, Scene
from studio_core.scene.transform import Transform
from studio_core.session import View
from studio_core.shading.artifacts import Lighting
from studio_core.shading.cache import DiskCache
from studio_core.shading.frame import Frame
from studio_core.shading.job import Job
from studio_core.shading.lighting import LightingStage
from studio_core.shading.pipeline import Pipeline


@pytest.fixture(scope="module")
def services(host, workers):
    return Services(workers, host)


def sunny():
    pixels = np.array(sky(64).pixels)
    pixels[9, 20] = [9e3, 7e3, 4e3]
    return Image(pixels)


class Lit:
    """A scene of one environment and a lamp, whose changes go through the stage alone."""

    def __init__(self, services, **environment):
        environment = {"image": sunny(), **environment}
        lamp = PointLamp(id="lamp", name="Lamp", transform=Transform((1, 2, 1)))
        self.scene = Scene().with_nodes(Environment(id="sky", name="Sky", **environment), lamp)
        self.pipeline = Pipeline([LightingStage(services)])
        self.now = self.update(Changes())

    def update(self, changes, moving=False) -> Lighting:
        frame = Frame(self.scene, View(Transform()), None, 0, moving)
        self.now = self.pipeline.update(frame, changes, Job("light"))
        return self.now

    def set(self, moving=False, node="sky", **values) -> Lighting:
        after = self.scene.with_nodes(dataclasses.replace(self.scene[node], **values))
        changes, self.scene = diff(self.scene, after), after
        return self.update(changes, moving)

    def rest(self) -> Lighting:
        return self.update(view_changed())


def power(lighting):
    return lighting.tree.prefix_power[-1] + lighting.sun.irradiance.sum(axis=0, dtype=np.float64)


def test_tree_and_sun_are_all_light_of_the_picture(services):
    image = sunny()
    lit = Lit(services, image=image)
    assert not lit.now.coarse
    assert lit.now.layers == ("sky", "lamp")
    np.testing.assert_allclose(power(lit.now), map_power(image.pixels), rtol=1e-4)
    assert lit.now.tree.radiance.max() < 10


def test_a_turn_is_coarse_while_it_lasts_and_exact_at_rest(services):
    lit = Lit(services)
    before = lit.now
    for azimuth in (10.0, 20.0, 30.0):
        moving = lit.set(moving=True, azimuth=azimuth, tilt=5.0)
        assert moving.coarse
        assert moving.tree.k == 15
        np.testing.assert_allclose(power(moving), power(before), rtol=1e-3)
    exact = lit.rest()
    fresh = Lit(services, image=lit.scene["sky"].image, azimuth=30.0, tilt=5.0).now
    assert not exact.coarse
    assert exact.integrated == fresh.integrated
    assert exact.integrated != moving.integrated
    assert exact.integrated != before.integrated
    np.testing.assert_array_equal(exact.tree.radiance, fresh.tree.radiance)
    np.testing.assert_array_equal(exact.sun.directions, fresh.sun.directions)
    np.testing.assert_array_equal(moving.sun.directions, exact.sun.directions)
    half = 1 << 14
    ours = moving.tree.prefix_vector[half] - moving.tree.prefix_vector[0]
    true = exact.tree.coarsened(15).prefix_vector[half]
    np.testing.assert_allclose(ours, true, atol=5e-3 * true.max())


def test_the_first_light_is_exact_even_in_a_hand(services):
    scene = Lit(services).scene
    pipeline = Pipeline([LightingStage(services)])
    made = pipeline.update(Frame(scene, View(Transform()), None, 0, True), Changes(), Job("light"))
    assert not made.coarse


def test_another_picture_in_a_hand_is_exact(services):
    lit = Lit(services)
    made = lit.set(moving=True, image=sky(32, 3.0))
    assert not made.coarse
    assert made.sun is None


def test_looking_around_integrates_nothing(services):
    lit = Lit(services)
    before = lit.now
    assert lit.update(view_changed(), moving=True) is before
    assert lit.rest() is before
    moving = lit.set(moving=True, azimuth=15.0)
    assert lit.update(view_changed(), moving=True) is moving
    assert lit.rest() is not moving


def test_lamps_and_gains_leave_the_environment_alone(services):
    lit = Lit(services)
    before = lit.now
    lamp = lit.set(node="lamp", transform=Transform((0, 3, 0)))
    assert lamp is not before
    assert lamp.tree is before.tree
    assert lamp.sun is before.sun
    assert lit.set(intensity=3.0) is lamp
    turned = lit.set(moving=True, azimuth=15.0)
    again = lit.set(moving=True, node="lamp", transform=Transform((0, 1, 0)))
    assert again.tree is turned.tree
    np.testing.assert_array_equal(again.lamps[0].position, [0, 1, 0])


def test_turning_back_finds_the_exact_light_again(services):
    lit = Lit(services)
    before = lit.now
    lit.set(moving=True, azimuth=15.0)
    back = lit.set(moving=True, azimuth=0.0)
    assert not back.coarse
    assert back.tree is before.tree
    assert lit.rest() is back


def test_hidden_and_shown_again(services):
    lit = Lit(services)
    before = lit.now
    hidden = lit.set(hidden=True)
    assert hidden.tree is hidden.sun is hidden.environment is None
    assert hidden.layers == ("lamp",)
    assert lit.set(hidden=False).tree is before.tree


@pytest.mark.parametrize("image", [sunny(), sky(32)], ids=["sun", "no sun"])
def test_light_is_kept_on_disk(host, workers, tmp_path, image):
    services = Services(workers, host, DiskCache(tmp_path))
    first = Lit(services, image=image, azimuth=40.0).now
    assert len(list(tmp_path.glob("*.npz"))) == 1
    lit = Lit(services, image=image, azimuth=40.0)
    np.testing.assert_array_equal(lit.now.tree.radiance, first.tree.radiance)
    assert (lit.now.sun is None) == (first.sun is None)
    if first.sun is not None:
        for name in ("directions", "irradiance", "parts"):
            np.testing.assert_array_equal(getattr(lit.now.sun, name), getattr(first.sun, name))
    turned = lit.set(azimuth=50.0)
    fresh = Lit(Services(workers, host), image=image, azimuth=50.0).now
    np.testing.assert_array_equal(turned.tree.radiance, fresh.tree.radiance)


def test_what_dirties_it():
    assert LightingStage.dirtied_by & Aspect.VIEW
    assert not LightingStage.dirtied_by & (Aspect.GAIN | Aspect.TRANSFORM | Aspect.MATERIAL)
