"""The dome that a photograph is projected on; that far away ones are right is told by test_compose."""

from __future__ import annotations

import numpy as np
from hypothesis import assume, given
from hypothesis import strategies as st
from oracles.radiance import lat_long

from studio_core.kernels.background import backdrop_at, background_hits, reach_of_dome
from studio_core.kernels.camera import sample_directions
from studio_core.scene.transform import looking, rotation_matrix
from studio_core.session import View
from studio_core.shading.primary import pinhole

PIXELS = np.random.default_rng(6).random((16, 32, 3)).astype(np.float32)
NUMBER = st.floats(-3, 3)
HEIGHT, RADIUS = 1.5, 5.0


@given(st.tuples(NUMBER, st.floats(-1.45, 3), NUMBER), st.tuples(NUMBER, NUMBER, NUMBER))
def test_a_ray_from_inside_ends_on_the_disc_or_on_the_dome(eye, way):
    assume(np.linalg.norm(way) > 1e-2)
    assume(np.linalg.norm(np.add(eye, (0, HEIGHT, 0))) < RADIUS * (1 - 1e-6))
    reach = reach_of_dome(*eye, HEIGHT, RADIUS, *way)
    end = np.array(eye) + reach * np.array(way) + (0, HEIGHT, 0)  # from the foot
    assert 0 < reach < np.inf
    if abs(end[1]) < 1e-9:
        assert np.hypot(end[0], end[2]) <= RADIUS * (1 + 1e-9)
    else:
        assert end[1] > 0
        np.testing.assert_allclose(np.linalg.norm(end), RADIUS, rtol=1e-6)


@given(st.tuples(*[st.floats(-20, 20)] * 3), st.tuples(NUMBER, NUMBER, NUMBER))
def test_from_outside_it_is_far_away(eye, way):
    foot = np.add(eye, (0, HEIGHT, 0))
    assume(np.linalg.norm(way) > 1e-2)
    assume(foot[1] <= 0 or np.linalg.norm(foot) >= RADIUS * (1 + 1e-9))
    assert reach_of_dome(*eye, HEIGHT, RADIUS, *way) == np.inf


def dome_of(view, foot):
    x, y, z = np.subtract(view.transform.translation, foot)
    return np.array([x, y - HEIGHT, z, HEIGHT, RADIUS, *rotation_matrix(view.transform.rotation).ravel()])


def views(foot):
    for eye, target in (((0.5, 1.0, 2.0), (0, 0, 0)), ((-2, 0.3, 1), (1, 0.1, 0)), ((0, 2, 0.1), (0, 0, 0))):
        yield View(looking(np.add(eye, foot), np.add(target, foot)), 60, 13, 9, antialias=2)


def test_what_lies_on_the_ground_stays_there_whoever_looks():
    foot, turn = (3.0, -0.4, 1.0), np.eye(3, dtype=np.float32)
    gain = np.array([1, 2, 0.5], np.float32)
    for view in views(foot):
        lens, dome = pinhole(view), dome_of(view, foot)
        every = np.arange(13 * 9 * 4)
        rays = np.empty((len(every), 3), np.float32)
        sample_directions(lens, every, rays)
        beside, met = np.empty((len(every), 3), np.float32), np.zeros((len(every), 3), np.float32)
        nothing = np.full(len(every), -1, np.int32)
        background_hits(0, len(every), lens, every[:0], nothing, turn, dome, PIXELS, gain, beside)
        away = (view.transform.translation[1] - foot[1]) / np.maximum(-rays[:, 1], 1e-9)
        points = np.array(view.transform.translation) + away[:, None] * rays
        on = (rays[:, 1] < 0) & (np.linalg.norm(points - foot, axis=1) < RADIUS * 0.999)
        assert on.sum() > 50
        backdrop_at(0, len(every), lens, every, away.astype(np.float32), turn, dome, PIXELS, gain, met)
        for index in np.flatnonzero(on):
            way = points[index] - foot - (0, HEIGHT, 0)
            expected = gain * lat_long(PIXELS, way / np.linalg.norm(way))
            np.testing.assert_allclose(beside[index], expected, atol=2e-4)
            np.testing.assert_allclose(met[index], expected, atol=2e-4)
