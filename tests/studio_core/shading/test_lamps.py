"""Lamps as samples: their irradiance is the analytic one."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from studio_core.scene.nodes import AreaLamp, DirectionalLamp, Group, PointLamp, Scene, SpotLamp
from studio_core.scene.transform import Transform, axis_angle, looking
from studio_core.shading.lamps import lamp_light, lamp_targets, lamps, spot_falloff

DOWN = looking((0, 2, 0), (0, 0, 0))


def irradiance(scene, point, normal, samples=256):
    total = 0.0
    for lamp in lamps(scene):
        directions, weight = lamp_light(lamp, lamp_targets(lamp, samples), np.array([point], np.float64))
        total += float((weight[0] * np.maximum(directions[0] @ np.array(normal, np.float32), 0)).sum())
    return total


def one(lamp):
    return Scene().with_nodes(lamp)


def test_point_lamp_follows_the_square_of_distance():
    scene = one(PointLamp(id="l", name="l", transform=DOWN))
    assert irradiance(scene, (0, 0, 0), (0, 1, 0)) == pytest.approx(1 / 4)
    cosine = 2 / math.sqrt(8)
    assert irradiance(scene, (2, 0, 0), (0, 1, 0)) == pytest.approx(cosine / 8)


@given(st.floats(0.2, 3), st.floats(0.2, 3), st.floats(0.3, 5))
def test_area_lamp_equals_its_form_factor(width, height, distance):
    transform = looking((0, distance, 0), (0, 0, 0))
    scene = one(AreaLamp(id="l", name="l", transform=transform, width=width, height=height))
    # form factor of a rectangle above the middle: four quarter rectangles
    a, b = width / 2 / distance, height / 2 / distance
    p, q = math.sqrt(1 + a * a), math.sqrt(1 + b * b)
    expected = 2 * (a / p * math.atan(b / p) + b / q * math.atan(a / q))
    assert irradiance(scene, (0, 0, 0), (0, 1, 0)) == pytest.approx(expected, rel=0.03)


def test_area_lamp_gives_no_light_backwards():
    scene = one(AreaLamp(id="l", name="l", transform=DOWN))
    assert irradiance(scene, (0, 4, 0), (0, -1, 0)) == 0


@pytest.mark.parametrize("angle", [0.0, 0.53, 20.0])
def test_sun_gives_its_irradiance_to_a_surface_facing_it(angle):
    scene = one(DirectionalLamp(id="l", name="l", transform=DOWN, angle=angle))
    expected = 1.0 if angle == 0 else (1 + math.cos(math.radians(angle / 2))) / 2
    assert irradiance(scene, (5, 0, -3), (0, 1, 0)) == pytest.approx(expected, rel=2e-3)


def test_spot_ends_at_its_cone_and_is_full_inside():
    scene = one(SpotLamp(id="l", name="l", transform=DOWN, cone=30, inner=20))
    assert irradiance(scene, (0, 0, 0), (0, 1, 0)) == pytest.approx(1 / 4)
    assert irradiance(scene, (2 * math.tan(math.radians(31)), 0, 0), (0, 1, 0)) == 0
    inside = 2 * math.tan(math.radians(19))
    distance2 = 4 + inside**2
    assert irradiance(scene, (inside, 0, 0), (0, 1, 0)) == pytest.approx(2 / math.sqrt(distance2) / distance2)


def test_falloff_is_monotone_and_a_step_without_a_margin():
    cosine = np.linspace(-1, 1, 101)
    soft = spot_falloff(cosine, 0.9, 0.3)
    assert (np.diff(soft) >= 0).all()
    assert soft[0] == 0
    assert soft[-1] == 1
    assert set(np.unique(spot_falloff(cosine, 0.5, 0.5))) == {0.0, 1.0}


def test_scale_and_rotation_of_a_parent_act_on_the_lamp():
    lamp = AreaLamp(id="l", name="l", parent="g", width=1, height=1, transform=DOWN)
    scaled = Transform((0, 0, 0), axis_angle((0, 1, 0), 30), 2.0)
    scene = Scene().with_nodes(Group(id="g", name="g", transform=scaled), lamp)
    twice = one(
        dataclasses.replace(lamp, parent=None, width=2, height=2, transform=looking((0, 4, 0), (0, 0, 0)))
    )
    assert irradiance(scene, (0, 0, 0), (0, 1, 0)) == pytest.approx(
        irradiance(twice, (0, 0, 0), (0, 1, 0)), rel=1e-3
    )


def test_hidden_lamps_are_left_out():
    assert lamps(one(PointLamp(id="l", name="l", hidden=True))) == ()
    scene = Scene().with_nodes(Group(id="g", name="g", hidden=True), PointLamp(id="l", name="l", parent="g"))
    assert lamps(scene) == ()


def test_a_point_at_the_lamp_stays_finite():
    scene = one(PointLamp(id="l", name="l"))
    assert math.isfinite(irradiance(scene, (0, 0, 0), (0, 1, 0)))
