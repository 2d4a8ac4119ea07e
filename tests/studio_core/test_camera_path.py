"""Turntables and camera paths: through every key, without flips, at even speed."""

from __future__ import annotations

import dataclasses
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scenes import little_scene

from studio_core.camera_path import CameraPath, light_turned, rotation_between, turn_angles, turntable
from studio_core.errors import InputError
from studio_core.scene.nodes import DirectionalLamp, Group
from studio_core.scene.transform import Transform, axis_angle, looking, rotation_matrix
from studio_core.session import View

PLACES = st.tuples(*[st.floats(-20, 20)] * 3)
TURNS = st.tuples(*[st.floats(-1, 1)] * 4).filter(lambda q: np.hypot.reduce(q) > 0.1)


def unit(quaternion):
    return tuple(float(c) for c in np.array(quaternion) / np.linalg.norm(quaternion))


VIEWS = st.builds(
    lambda place, turn, fov, focus: View(Transform(place, unit(turn)), fov, focus=focus),
    PLACES,
    TURNS,
    st.floats(5, 150),
    st.floats(0.1, 50),
)
PATHS = st.lists(VIEWS, min_size=2, max_size=6)


def gap(a: View, b: View) -> float:
    return float(np.linalg.norm(np.subtract(a.transform.translation, b.transform.translation)))


def same(a: View, b: View) -> bool:
    turn = rotation_between(a.transform.rotation, b.transform.rotation)
    return gap(a, b) < 1e-6 and turn < 1e-4 and abs(a.fov - b.fov) < 1e-6 and abs(a.focus - b.focus) < 1e-6


@given(PATHS, st.booleans())
def test_a_path_leads_through_every_key(keys, closed):
    path = CameraPath(keys, closed=closed)
    assert path.segments == len(keys) - (not closed)
    assert all(same(path.at(index), key) for index, key in enumerate(keys))
    if closed:
        assert same(path.at(path.segments), keys[0])


@given(PATHS, st.booleans(), st.booleans())
@settings(max_examples=30, deadline=None)
def test_pictures_begin_and_end_at_keys(keys, closed, ease):
    views = CameraPath(keys, closed=closed).views(7, ease=ease)
    assert len(views) == 7
    assert same(views[0], keys[0])
    assert closed or same(views[-1], keys[-1])


@given(PATHS, st.booleans())
@settings(max_examples=30, deadline=None)
def test_nothing_flips(keys, closed):
    """Steps get smaller as they should when there are more of them, all along the path and over its keys."""
    path = CameraPath(keys, closed=closed)
    for steps in (256, 1024):
        _, turns = path._states(np.linspace(0, path.segments, path.segments * steps + 1))
        assert np.abs(np.linalg.norm(turns, axis=1) - 1).max() < 1e-9
        cosine = np.abs((turns[1:] * turns[:-1]).sum(axis=1)).min()
        # at most a few turns in a segment
        assert np.degrees(2 * np.arccos(min(cosine, 1.0))) < 4000 / steps


@given(PATHS)
@settings(max_examples=30, deadline=None)
def test_speed_is_continuous_at_keys(keys):
    """Velocities before and after a key agree, in the path's own parameter."""
    path, step = CameraPath(keys), 1e-5
    for index in range(1, path.segments):
        key = np.array(path.at(index).transform.translation)
        spans = path._spans[index - 1 : index + 1]
        before = (key - path.at(index - step).transform.translation) / (step * spans[0])
        after = (np.array(path.at(index + step).transform.translation) - key) / (step * spans[1])
        np.testing.assert_allclose(before, after, atol=2e-3 * (1 + np.abs(before).max()))


@given(PLACES, PLACES, st.integers(3, 40))
@settings(max_examples=30, deadline=None)
def test_two_cameras_that_look_alike_make_a_straight_even_path(start, end, frames):
    assume(np.linalg.norm(np.subtract(start, end)) > 0.01)
    keys = [View(Transform(place), focus=2.0) for place in (start, end)]
    views = CameraPath(keys).views(frames)
    expected = np.linspace(start, end, frames)
    np.testing.assert_allclose([v.transform.translation for v in views], expected, atol=1e-3)


@given(PATHS, st.booleans())
@settings(max_examples=30, deadline=None)
def test_even_speed_is_even(keys, closed):
    path = CameraPath(keys, closed=closed)
    views = path.views(200, even=True)
    turns = np.array(
        [
            np.radians(rotation_between(a.transform.rotation, b.transform.rotation)) / 2
            for a, b in pairwise(views)
        ]
    )
    zooms = np.array([np.log(np.tan(np.radians(view.fov) / 2)) for view in views])
    moves = np.array([gap(a, b) for a, b in pairwise(views)])
    steps = moves + path._reach * (turns + np.abs(np.diff(zooms)))
    assume(steps.mean() > 1e-6)
    assert np.quantile(steps, 0.95) < 1.3 * steps.mean()
    assert np.quantile(steps, 0.05) > 0.6 * steps.mean()


def test_what_stands_still_between_two_keys_stays_still():
    """A camera that turns on the spot, then travels: it neither drifts nor spins on."""
    spot, away = (0.0, 1.0, 0.0), (30.0, 1.0, 0.0)
    turn = axis_angle((0, 1, 0), 90)
    keys = [View(Transform(spot)), View(Transform(spot, turn)), View(Transform(away, turn))]
    path = CameraPath(keys)
    for t in np.linspace(0, 1, 20):
        assert path.at(t).transform.translation == pytest.approx(spot, abs=1e-9)
        assert rotation_between(path.at(1 + t).transform.rotation, turn) < 1e-4


def test_easing_starts_and_ends_slowly():
    keys = [View(Transform((x, 0.0, 0.0))) for x in (0.0, 4.0, 10.0)]
    x = [view.transform.translation[0] for view in CameraPath(keys).views(101, ease=True)]
    steps = np.diff(x)
    assert max(steps[0], steps[-1]) < 0.1 * steps[50]
    assert (steps > 0).all()


def test_without_evenness_every_stretch_has_as_many_frames():
    keys = [View(Transform((x, 0.0, 0.0))) for x in (0.0, 1.0, 10.0)]
    views = CameraPath(keys).views(21, even=False)
    assert views[10].transform.translation[0] == pytest.approx(1.0)


def test_pixels_and_samples_are_those_of_the_first():
    keys = [View(width=64, height=36, antialias=3, fine_edges=True), View(Transform((1.0, 0, 0)))]
    view = CameraPath(keys).at(0.6)
    assert (view.width, view.height, view.antialias, view.fine_edges) == (64, 36, 3, True)


@pytest.mark.parametrize("keys", [[], [View()]])
def test_a_path_needs_two_cameras(keys):
    with pytest.raises(InputError, match="two cameras"):
        CameraPath(keys)
    with pytest.raises(InputError, match="frames"):
        CameraPath([View(), View()]).views(0)


@given(VIEWS, st.integers(1, 30), st.floats(-720, 720))
def test_a_turntable_keeps_height_distance_and_aim(view, frames, degrees):
    centre = np.array(view.target)
    made = turntable(view, frames, degrees)
    assert len(made) == frames
    assert same(made[0], view)
    distance = np.linalg.norm(np.array(view.transform.translation) - centre)
    for one in made:
        assert one.transform.translation[1] == pytest.approx(view.transform.translation[1], abs=1e-6)
        assert np.linalg.norm(np.array(one.transform.translation) - centre) == pytest.approx(
            distance, abs=1e-6
        )
        np.testing.assert_allclose(one.target, centre, atol=1e-5)


def test_whole_turns_end_a_step_before_their_beginning():
    assert turn_angles(4) == [0, 90, 180, 270]
    assert turn_angles(4, -360) == [0, -90, -180, -270]
    assert turn_angles(3, 90) == [0, 45, 90]
    assert turn_angles(1, 90) == [0]


def test_a_turn_is_counter_clockwise_from_above():
    view = View(looking((0, 1, 3), (0, 1, 0)), focus=3.0)
    x, _, z = turntable(view, 4)[1].transform.translation
    assert (x, z) == pytest.approx((3, 0), abs=1e-9)
    x, _, z = turntable(view, 4, centre=(1.0, 0.0, 3.0))[2].transform.translation
    assert (x, z) == pytest.approx((2, 3), abs=1e-9)


@given(st.floats(-400, 400), st.floats(-90, 90))
def test_turned_light_comes_from_where_the_camera_would_have_gone_back(degrees, tilt):
    scene = little_scene()
    sky = dataclasses.replace(scene["sky"], azimuth=30.0, tilt=tilt)
    group = Group(id="group", transform=Transform((1.0, 2.0, 3.0), axis_angle((1, 0, 1), 40), 2.0))
    sun = DirectionalLamp(id="sun", parent="group", transform=looking((0, 3, 0), (1, 0, 1)))
    scene = scene.with_nodes(group, sun, sky)
    made = light_turned(scene, degrees)
    turn = rotation_matrix(axis_angle((0, 1, 0), degrees))
    for before, after in (
        (sky.rotation(), made["sky"].rotation()),
        (scene.world("sun"), made.world("sun")),
    ):
        np.testing.assert_allclose(
            rotation_matrix(after.rotation), turn @ rotation_matrix(before.rotation), atol=1e-6
        )
    assert made.world("sun").translation == pytest.approx(scene.world("sun").translation)
    assert made["cube"] is scene["cube"]
    assert light_turned(scene, 0.0) is scene
