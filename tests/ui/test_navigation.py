"""Movements of the view as geometry: what stays where it was, whatever the view."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from ui_support import room
from views import PLACES, views

from studio_core.edits import Add
from studio_core.scene.nodes import AreaLamp, Camera, Group, PointLamp
from studio_core.scene.transform import Transform
from studio_core.session import View
from studio_ui.canvas import navigation
from studio_ui.canvas.projection import axes_of, eye_of, project, ray

SHARES = st.floats(-0.6, 0.6)
ON_CANVAS = st.floats(0.05, 0.95)


def close(a: View, b: View) -> None:
    assert np.allclose(a.transform.matrix(), b.transform.matrix(), atol=1e-7)
    assert a.focus == pytest.approx(b.focus)
    assert a.fov == b.fov


@given(views(), ON_CANVAS, ON_CANVAS, st.floats(0.3, 30), st.floats(0.3, 3))
def test_zooming_keeps_what_is_under_the_cursor_there(
    view: View, x: float, y: float, distance: float, factor: float
) -> None:
    point = eye_of(view) + ray(view, x, y) * distance
    nearer = navigation.zoom(view, factor, x, y, distance)
    assert project(nearer, point)[0] == pytest.approx((x, y), abs=1e-6)
    assert np.linalg.norm(eye_of(nearer) - point) == pytest.approx(factor * distance)


@given(views(), ON_CANVAS, ON_CANVAS, st.floats(0.3, 30), st.floats(0.5, 2))
def test_zooming_in_and_out_at_one_place_comes_back(
    view: View, x: float, y: float, distance: float, factor: float
) -> None:
    there = navigation.zoom(view, factor, x, y, distance)
    close(navigation.zoom(there, 1 / factor, x, y, distance * factor), view)
    assume(view.focus * min(factor, 1) > navigation.LEAST)
    there = navigation.zoom(view, factor, x, y)  # nothing is seen there
    close(navigation.zoom(there, 1 / factor, x, y), view)


@given(views(), ON_CANVAS, ON_CANVAS, st.floats(0.05, 30))
def test_zooming_never_goes_through_what_is_under_the_cursor(
    view: View, x: float, y: float, distance: float
) -> None:
    point = eye_of(view) + ray(view, x, y) * distance
    for _ in range(200):
        view = navigation.approach(view, 0.8, point)
        assert navigation.depth(view, point) > 0
    assert np.linalg.norm(eye_of(view) - point) == pytest.approx(navigation.NEAREST, rel=1e-3)


@given(views())
def test_an_empty_room_can_be_walked_through(view: View) -> None:
    start, travelled = view, []
    for _ in range(120):
        before = eye_of(view)
        view = navigation.zoom(view, 0.86)
        travelled.append(np.linalg.norm(eye_of(view) - before))
    assert min(travelled) > 0.02
    assert navigation.depth(start, eye_of(view)) > start.focus
    assert view.focus >= navigation.LEAST * 0.86


@given(views(), SHARES, SHARES, ON_CANVAS, ON_CANVAS, st.floats(0.3, 30))
def test_orbiting_keeps_the_pivot_where_it_is_seen(
    view: View, dx: float, dy: float, x: float, y: float, distance: float
) -> None:
    pivot = eye_of(view) + ray(view, x, y) * distance
    turned = navigation.orbit(view, dx, dy, pivot)
    assert project(turned, pivot)[0] == pytest.approx((x, y), abs=1e-5)
    assert np.linalg.norm(eye_of(turned) - pivot) == pytest.approx(distance)


@given(views(), st.lists(st.tuples(SHARES, SHARES), max_size=12))
def test_orbiting_stays_upright_and_never_flips(view: View, drags: list[tuple[float, float]]) -> None:
    for dx, dy in drags:
        view = navigation.orbit(view, dx, dy)
        right, up, back = axes_of(view)
        assert abs(right[1]) < 1e-6, "the horizon is level"
        assert up[1] > 0, "nothing stands on its head"
        assert abs(np.degrees(np.arcsin(back[1]))) <= navigation.STEEPEST + 1e-6


@given(views(), SHARES, SHARES, ON_CANVAS, ON_CANVAS, st.floats(0.5, 30))
def test_what_is_slid_follows_the_mouse(
    view: View, dx: float, dy: float, x: float, y: float, distance: float
) -> None:
    point = eye_of(view) + ray(view, x, y) * distance
    slid = navigation.pan(view, dx, dy, navigation.depth(view, point))
    at = project(slid, point)[0]
    assert at == pytest.approx((x + dx * view.height / view.width, y + dy), abs=1e-6)


@given(views(), st.floats(-0.05, 0.05), st.floats(-0.05, 0.05))
def test_turning_the_head_stays_where_it_is(view: View, dx: float, dy: float) -> None:
    turned = navigation.turn(view, dx, dy)
    assert eye_of(turned) == pytest.approx(eye_of(view), abs=1e-9)
    across = project(turned, view.target)[0] - 0.5
    if abs(dy) > 1e-3:
        assert np.sign(across[1]) == np.sign(dy), "the room goes with the hand"


@given(views(), PLACES, st.tuples(*[st.floats(0, 4)] * 3))
def test_a_framed_box_is_seen_whole_and_fills_the_picture(
    view: View, low: tuple[float, ...], size: tuple[float, ...]
) -> None:
    high = np.add(low, size)
    framed = navigation.frame(view, low, high)
    corners = np.array(np.meshgrid(*zip(low, high, strict=True))).reshape(3, -1).T
    seen = project(framed, corners)
    assert ((seen > 0) & (seen < 1)).all()
    if min(size) > 0.06:
        assert np.abs(2 * seen - 1).max() == pytest.approx(1 / navigation.MARGIN), "and fills it"
    assert framed.transform.rotation == view.transform.rotation
    assert framed.target == pytest.approx(np.add(low, high) / 2, abs=1e-6)


@given(views(), st.sampled_from(sorted(navigation.AXES)), PLACES)
def test_from_an_axis_one_looks_straight_at_the_point(
    view: View, axis: str, about: tuple[float, ...]
) -> None:
    seen = navigation.along_axis(view, axis, about)
    assert axes_of(seen)[2] == pytest.approx(navigation.AXES[axis], abs=1e-9)
    assert seen.target == pytest.approx(about, abs=1e-6)
    assert seen.focus == view.focus


def test_what_has_no_surface_is_framed_with_a_size() -> None:
    scene = Add(
        (
            PointLamp(id="lamp", transform=Transform((0.0, 2.0, 0.0))),
            AreaLamp(id="panel", width=2.0, height=0.5, transform=Transform((0.0, 3.0, 0.0))),
            Camera(id="camera"),
            Group(id="empty", transform=Transform((5.0, 0.0, 0.0))),
            PointLamp(id="above", parent="chair", transform=Transform((0.0, 9.0, 0.0))),
        )
    )(room())
    low, high = navigation.seen_box(scene, ("lamp",)) or ((), ())
    assert (low, high) == (pytest.approx((-0.25, 1.75, -0.25)), pytest.approx((0.25, 2.25, 0.25)))
    low, high = navigation.seen_box(scene, ("panel",)) or ((), ())
    assert np.subtract(high, low) == pytest.approx((2.0, 0.5, 0.0))
    assert navigation.seen_box(scene, ("empty",)) is not None
    low, high = navigation.seen_box(scene, ("chair",)) or ((), ())
    assert high == pytest.approx((-0.5, 1.5, 0.5)), "a lamp far away does not make its chair small"
    hidden = scene.with_nodes(dataclasses.replace(scene["back"], hidden=True))
    low, high = navigation.seen_box(hidden, ("chair",)) or ((), ())
    assert high[1] == 1.0
    assert navigation.seen_box(scene, ()) is None
