"""The view moves smoothly to where it is sent; whatever the hand does stops it."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from PySide6.QtCore import QPoint, Qt
from ui_support import Driver
from views import views

from studio_core.scene.transform import multiply, rotation_matrix
from studio_core.session import View
from studio_ui.canvas import navigation
from studio_ui.canvas.flight import Flight, between, slerp
from studio_ui.canvas.projection import axes_of, eye_of

SHARES = st.floats(0, 1)


@given(views(), views(), SHARES)
def test_the_way_starts_and_ends_and_is_turned_evenly(start: View, goal: View, share: float) -> None:
    assert between(start, goal, 0.0) is start
    assert between(start, goal, 1.0) is goal
    made = between(start, goal, share)
    near, far = sorted((start.focus, goal.focus))
    assert near * (1 - 1e-9) <= made.focus <= far * (1 + 1e-9)
    target = (1 - share) * np.array(start.target) + share * np.array(goal.target)
    assert made.target == pytest.approx(target, abs=1e-6)
    whole = _angle(start, goal)
    assert _angle(start, made) == pytest.approx(share * whole, abs=0.01)
    assert _angle(made, goal) == pytest.approx((1 - share) * whole, abs=0.01)


@given(views(), st.floats(0, 360), SHARES)
def test_around_one_target_the_distance_stays(view: View, degrees: float, share: float) -> None:
    other = navigation.orbit(view, degrees / navigation.TURN, 0.0)
    made = between(view, other, share)
    assert np.linalg.norm(eye_of(made) - view.target) == pytest.approx(view.focus)
    assert made.target == pytest.approx(view.target, abs=1e-6)


@given(views(), SHARES)
def test_slerp_takes_the_shorter_way(view: View, share: float) -> None:
    turned = view.transform.rotation
    opposite = (-turned[0], -turned[1], -turned[2], -turned[3])
    assert rotation_matrix(slerp(turned, opposite, share)) == pytest.approx(rotation_matrix(turned), abs=1e-9)
    assert multiply(slerp(turned, turned, share), (1.0, 0.0, 0.0, 0.0)) == pytest.approx(
        multiply(turned, (1.0, 0.0, 0.0, 0.0)), abs=1e-12
    )


def _angle(a: View, b: View) -> float:
    """Degrees from one rotation to the other."""
    trace = np.trace(axes_of(a) @ axes_of(b).T)
    return float(np.degrees(np.arccos(np.clip((trace - 1) / 2, -1, 1))))


@pytest.fixture
def flight(driver: Driver) -> Flight:
    """Of a window that animates."""
    made: Flight = driver.window.tools.looking.flight
    made.animated = True
    return made


def test_it_arrives_exactly(driver: Driver, flight: Flight) -> None:
    seen: list[View] = []
    driver.session.changed.connect(lambda _: seen.append(driver.session.view))
    driver.do("view.top")
    goal = flight.goal
    assert goal is not None
    assert driver.feed.moving
    driver.until(lambda: flight.goal is None)
    assert driver.session.view == goal
    assert len(seen) > 1, "there are views in between"
    driver.settle()


def test_a_gesture_stops_it(driver: Driver, flight: Flight) -> None:
    driver.do("view.top")
    assert flight.goal is not None
    at = QPoint(300, 200)
    driver.press(at, Qt.KeyboardModifier.NoModifier, Qt.MouseButton.MiddleButton)
    driver.move(at + QPoint(20, 0))
    assert flight.goal is None
    driver.release(at + QPoint(20, 0), Qt.KeyboardModifier.NoModifier, Qt.MouseButton.MiddleButton)
    view = driver.session.view
    driver.settle()
    assert driver.session.view == view
    assert not driver.feed.moving


def test_another_view_from_elsewhere_wins(driver: Driver, flight: Flight) -> None:
    driver.do("view.top")
    other = View(fov=30.0, width=driver.session.view.width, height=driver.session.view.height)
    driver.session.look(other)
    driver.until(lambda: flight.goal is None)
    assert driver.session.view == other


def test_another_size_on_the_way_is_kept(driver: Driver, flight: Flight) -> None:
    driver.do("view.top")
    driver.feed.resized(500, 400)
    driver.until(lambda: flight.goal is None)
    assert (driver.session.view.width, driver.session.view.height) == (500, 400)
    assert driver.session.view.transform.matrix()[1, 2] == pytest.approx(1.0)


def test_closing_the_window_stops_it(driver: Driver, flight: Flight) -> None:
    driver.do("view.top")
    driver.window.close()
    assert flight.goal is None
