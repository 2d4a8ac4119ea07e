"""Rings: directions and back, means over what is known, runs on a closed circle."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from studio_core.capturing.artifacts import View
from studio_core.imaging.projection import Circle, Lens, project
from studio_plugins.capture.ring import Ring, angles, calmed, coarser, directions, runs


@given(st.floats(0, 6.283), st.floats(0.01, 3.1))
def test_directions_and_back(azimuth, theta):
    way = directions(np.array([azimuth]), np.array([theta]))
    np.testing.assert_allclose(np.linalg.norm(way, axis=-1), 1)
    found, away = angles(way)
    np.testing.assert_allclose(np.exp(1j * found), np.exp(1j * azimuth), atol=1e-9)
    np.testing.assert_allclose(away, theta, atol=1e-9)


def test_azimuth_is_seen_in_the_picture():
    """0 lies to the right, 90 up: y of pictures is down."""
    lens, circle = Lens(), Circle(50, 50, 40)
    ring = Ring(np.radians([80.0]), np.radians([0.0, 90.0, 180.0]))
    points, _ = project(lens, circle, ring.directions)
    assert points[0, 0, 0] > 80
    assert points[0, 1, 1] < 20
    assert points[0, 2, 0] < 20


@given(st.lists(st.booleans(), min_size=1, max_size=24), st.integers(0, 23))
def test_runs_hold_what_is_set_wherever_the_circle_begins(flags, turn):
    flags = np.roll(np.array(flags), turn)
    marked = np.zeros(len(flags), int)
    for start, length in runs(flags):
        marked[(start + np.arange(length)) % len(flags)] += 1
        if length < len(flags):
            assert not flags[start - 1]
            assert not flags[(start + length) % len(flags)]
    np.testing.assert_array_equal(marked, flags)


def test_means_leave_out_what_is_not_known_and_close_the_circle():
    picture = np.full((5, 40), 3.0, np.float32)
    known = np.ones((5, 40), bool)
    picture[2, 10:14], known[2, 10:14] = np.float32(1e9), False
    np.testing.assert_allclose(calmed(picture, known, 1, 2), 3, rtol=1e-5)
    wave = np.repeat(np.cos(np.arange(40) / 40 * 2 * np.pi)[None].astype(np.float32), 5, axis=0)
    made = calmed(wave, np.ones((5, 40), bool), 0.5, 2)
    np.testing.assert_allclose(made, wave * np.exp(-((2 * 2 * np.pi / 40) ** 2) / 2), atol=1e-3)


def test_coarser_views_show_the_same_without_what_is_not_usable():
    light = np.full((120, 160, 3), 2.0, np.float32)
    usable = np.ones((120, 160), bool)
    light[:, 100:103], usable[:, 100:103] = 500.0, False
    view = View(light, usable, Circle(80.5, 61.0, 60.0), Lens())
    small = coarser(view, 20)
    assert small.light.shape == (40, 53, 3)
    assert small.circle == Circle(80.5 / 3, 61 / 3, 20)
    np.testing.assert_allclose(small.light[small.usable], 2, rtol=1e-5)
    assert coarser(view, 50) is view
