"""What needs no window: navigation, drags, angles, projection, settings, bridge, tasks."""

from __future__ import annotations

import math
import threading
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pytestqt.qtbot import QtBot
from ui_support import room

from studio_core.document import Document
from studio_core.edits import Move, SetFields
from studio_core.errors import Cancelled, InputError
from studio_core.params import ParamInfo
from studio_core.scene.arranging import placed, roots, shifted, turned
from studio_core.scene.standing import dropped
from studio_core.scene.transform import Transform, axis_angle, looking, multiply, rotation_matrix
from studio_core.session import View
from studio_core.shading.scheduler import ComputeThread, InlineExecutor
from studio_ui.bridge import Bridge
from studio_ui.canvas import navigation
from studio_ui.canvas.projection import axes_of, bounds, eye_of, project, project_segments, ray
from studio_ui.editing import Editing
from studio_ui.forms.euler import from_euler, to_euler
from studio_ui.forms.fields import slider_range
from studio_ui.journal import Journal
from studio_ui.settings import Settings
from studio_ui.tasks import Tasks

angle = st.floats(-180, 180)
coordinate = st.floats(-20, 20)
eyes = st.tuples(coordinate, coordinate, coordinate).filter(lambda e: math.dist(e, (0, 0, 0)) > 0.5)
views = st.builds(
    lambda eye, fov: View(looking(eye, (0, 0, 0)), fov, 400, 300, math.dist(eye, (0, 0, 0))),
    eyes,
    st.floats(10, 120),
)


@given(st.floats(-89, 89), angle, angle)
def test_angles_come_back_as_the_same_rotation(tilt: float, turn: float, roll: float) -> None:
    rotation = from_euler((tilt, turn, roll))
    again = from_euler(to_euler(rotation))
    assert np.allclose(rotation_matrix(rotation), rotation_matrix(again), atol=1e-6)


@given(st.sampled_from([-90.0, 90.0]), angle, angle)
def test_angles_at_the_pole(tilt: float, turn: float, roll: float) -> None:
    rotation = from_euler((tilt, turn, roll))
    again = from_euler(to_euler(rotation))
    assert np.allclose(rotation_matrix(rotation), rotation_matrix(again), atol=1e-4)


@given(views, st.floats(0.05, 0.95), st.floats(0.05, 0.95), st.floats(0.1, 50))
def test_a_ray_meets_the_canvas_where_it_started(view: View, x: float, y: float, far: float) -> None:
    point = eye_of(view) + far * ray(view, x, y)
    assert project(view, [point])[0] == pytest.approx((x, y), abs=1e-6)


@given(views, st.floats(-1, 1), st.floats(-1, 1))
def test_orbit_keeps_the_target_in_place_and_the_horizon_level(view: View, dx: float, dy: float) -> None:
    made = navigation.orbit(view, dx, dy)
    assert np.allclose(made.target, view.target, atol=1e-5 * view.focus + 1e-6)
    assert math.isclose(math.dist(made.transform.translation, made.target), view.focus, rel_tol=1e-5)
    assert abs(axes_of(made)[0][1]) < 1e-5
    assert axes_of(made)[1][1] > -1e-9, "never upside down"


@given(views, st.floats(-1, 1), st.floats(-1, 1), st.tuples(coordinate, coordinate, coordinate))
def test_orbit_about_a_point_keeps_its_distance(
    view: View, dx: float, dy: float, pivot: tuple[float, float, float]
) -> None:
    made = navigation.orbit(view, dx, dy, pivot)
    before = math.dist(view.transform.translation, pivot)
    assert math.isclose(math.dist(made.transform.translation, pivot), before, rel_tol=1e-6, abs_tol=1e-6)


@given(views, st.floats(0.3, 3), st.floats(0.1, 0.9), st.floats(0.1, 0.9))
def test_zoom_keeps_what_is_under_the_cursor(view: View, factor: float, x: float, y: float) -> None:
    distance = view.focus * 1.2
    point = eye_of(view) + distance * ray(view, x, y)
    made = navigation.zoom(view, factor, x, y, distance)
    assert project(made, [point])[0] == pytest.approx((x, y), abs=1e-5)


@given(views, st.floats(-0.5, 0.5), st.floats(-0.5, 0.5))
def test_pan_takes_the_target_along_with_the_hand(view: View, dx: float, dy: float) -> None:
    made = navigation.pan(view, dx, dy)
    x, y = project(made, [view.target])[0]
    assert (x - 0.5) * view.width / view.height == pytest.approx(dx, abs=1e-6)
    assert y - 0.5 == pytest.approx(dy, abs=1e-6)


@given(views, st.tuples(coordinate, coordinate, coordinate), st.floats(0.1, 5))
def test_framing_shows_all_of_a_box(view: View, low: tuple[float, float, float], size: float) -> None:
    high = np.add(low, size)
    made = navigation.frame(view, low, high)
    corners = np.array(np.meshgrid(*zip(low, high, strict=True))).reshape(3, -1).T
    seen = project(made, corners)
    assert ((seen > -1e-6) & (seen < 1 + 1e-6)).all()


@pytest.mark.parametrize(("name", "back"), navigation.AXES.items())
def test_axis_views_look_along_their_axis(name: str, back: tuple[float, float, float]) -> None:
    made = navigation.along_axis(View(), name)
    assert axes_of(made)[2] == pytest.approx(back, abs=1e-9)


@given(views)
def test_nudges_go_along_the_axes_of_the_floor(view: View) -> None:
    along, away = navigation.nudge_axes(view)
    assert along[1] == away[1] == 0
    assert along @ away == 0
    right, _, back = axes_of(view)
    assert along @ right >= 0
    assert away @ -back >= -1e-9


def test_segments_behind_the_eye_are_cut() -> None:
    view = View()
    flat = project_segments(
        view, [((0, 0, -1), (0, 0, 1)), ((0, 0, 1), (0, 0, 2)), ((0, 0, -2), (0.1, 0, -1))]
    )
    assert flat.shape == (2, 2, 2)
    assert np.isfinite(flat).all()


@given(angle, st.tuples(coordinate, coordinate, coordinate), st.floats(0.2, 4))
def test_moving_a_child_moves_it_in_the_world(
    degrees: float, delta: tuple[float, float, float], scale: float
) -> None:
    scene = room()
    parent = Transform(
        (3.0, 1.0, 2.0), multiply(axis_angle((0, 1, 0), degrees), axis_angle((1, 0, 0), 20)), scale
    )
    scene = scene.with_nodes(type(scene["chair"])(id="chair", name="Chair", transform=parent))
    before = scene.world("back").translation
    moved = shifted(scene, ["back"], delta)["back"]
    after = (parent @ moved).translation
    assert np.allclose(np.subtract(after, before), delta, atol=1e-6)
    assert np.allclose((parent @ placed(scene, {"back": Transform()})["back"]).matrix(), np.eye(4), atol=1e-6)


@given(angle)
def test_turning_keeps_the_middle(degrees: float) -> None:
    scene = room()
    low, high = bounds(scene, ("stool",))
    pivot = (low + high) / 2
    made = turned(scene, ["stool"], degrees, pivot)["stool"]
    assert np.allclose((made.matrix() @ (0, 0.5, 0, 1))[:3], pivot, atol=1e-9)


def test_roots_leave_out_what_hangs_under_another_and_what_is_locked() -> None:
    scene = room()
    assert roots(scene, ["seat", "chair", "stool"]) == ("chair", "stool")
    scene = SetFields("chair", {"locked": True})(scene)
    assert roots(scene, ["seat", "chair", "stool"]) == ("stool",)


def test_dropping_stands_things_on_the_floor() -> None:
    scene = room()
    lifted = Move({"stool": Transform((1.0, 1.7, 0.0))})(scene)
    assert dropped(lifted, ["stool"])["stool"].translation == pytest.approx((1.0, 0.0, 0.0))
    made = dropped(scene, ["back"])["back"]
    assert (scene.world("chair") @ made).translation[1] == pytest.approx(1.0), "on the seat"


def test_sliders_span_what_a_hand_can_use() -> None:
    assert slider_range(ParamInfo("number", "", low=0, high=1)) == (0, 1)
    assert slider_range(ParamInfo("number", "", low=0, high=1e9, scale="log")) == (0.01, 1000)
    assert slider_range(ParamInfo("number", "", unit="°", low=-3600, high=3600)) == (-180, 180)
    low, high = slider_range(ParamInfo("number", "", low=-1e6, high=1e6))
    assert low == high


def test_settings_come_back(tmp_path: Path) -> None:
    made = Settings(tmp_path / "deep" / "state")
    made.set("theme", "light")
    for name in ("a", "b", "a"):
        made.opened(tmp_path / f"{name}.lucarne")
    again = Settings(tmp_path / "deep" / "state")
    assert again.get("theme", "dark") == "light"
    assert [p.name for p in again.recent] == ["a.lucarne", "b.lucarne"]
    again.forget(tmp_path / "a.lucarne")
    assert [p.name for p in again.recent] == ["b.lucarne"]


def test_settings_live_without_a_disk(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    made = Settings(tmp_path / "file" / "state")
    made.set("theme", "light")
    assert made.get("theme", "dark") == "light"


def test_the_bridge_brings_calls_home_in_order(qtbot: QtBot) -> None:
    bridge, here, came = Bridge(), threading.get_ident(), []

    def send() -> None:
        for number in range(50):
            bridge.post(lambda n=number: came.append((n, threading.get_ident())))

    thread = threading.Thread(target=send)
    thread.start()
    thread.join()
    assert came == []
    qtbot.waitUntil(lambda: len(came) == 50, timeout=30_000)
    assert came == [(n, here) for n in range(50)]
    bridge.post(lambda: came.append((99, here)))
    bridge.close()
    bridge.post(lambda: came.append((100, here)))
    qtbot.wait(20)
    assert len(came) == 50


def test_the_bridge_waits_and_forgets_when_closed(qtbot: QtBot) -> None:
    bridge, came = Bridge(), []
    bridge.later(30, lambda: came.append("late"))
    bridge.later(0, lambda: came.append("soon"))
    qtbot.waitUntil(lambda: came == ["soon", "late"], timeout=30_000)
    bridge.later(10, lambda: came.append("never"))
    bridge.close()
    bridge.later(0, lambda: came.append("never"))
    qtbot.wait(40)
    assert came == ["soon", "late"]


def test_the_bridge_tells_errors_and_goes_on(qtbot: QtBot) -> None:
    told: list[Exception] = []
    came: list[int] = []
    bridge = Bridge(told.append)
    bridge.post(lambda: 1 / 0)
    bridge.post(lambda: came.append(1))
    qtbot.waitUntil(lambda: came == [1], timeout=30_000)
    assert isinstance(told[0], ZeroDivisionError)


@pytest.mark.parametrize(
    ("error", "level", "told"),
    [
        (InputError("chair.obj is empty"), "problem", "chair.obj is empty"),
        (KeyError("x"), "problem", "fault in the program or a plugin"),
        (Cancelled("stop"), None, ""),
        (SystemExit(2), "problem", "leave the program"),
    ],
)
def test_tasks_tell_what_went_wrong(error: BaseException, level: str | None, told: str) -> None:
    journal, ended = Journal(), []

    def work(job: object) -> None:
        raise error

    tasks = Tasks(InlineExecutor(), lambda call: call(), journal)
    task = tasks.run("Working", work, lambda _: ended.append("done"), lambda _: ended.append("failed"))
    assert ended == ["failed"]
    assert tasks.running == []
    assert task.state == ("cancelled" if level is None else "failed")
    assert [entry.level for entry in journal.entries] == ([level] if level else [])
    assert told in "".join(entry.text for entry in journal.entries)


def test_a_task_is_cancelled_at_its_checkpoint(qtbot: QtBot) -> None:
    journal, executor, bridge = Journal(), ComputeThread(), Bridge()
    tasks = Tasks(executor, bridge.post, journal)
    started, ended = threading.Event(), []

    def work(job: object) -> None:
        started.set()
        while True:
            job.checkpoint(1, 2)

    tasks.run("Long", work, lambda _: ended.append("done"), lambda error: ended.append(type(error)))
    assert started.wait(10)
    tasks.cancel()
    qtbot.waitUntil(lambda: bool(ended), timeout=30_000)
    assert ended == [Cancelled]
    assert not journal.entries
    executor.close()
    bridge.close()


@settings(max_examples=60)
@given(
    st.lists(
        st.sampled_from(
            ["begin a", "begin b", "preview a", "preview b", "commit a", "cancel b", "apply", "undo"]
        )
    )
)
def test_whatever_happens_gestures_end_and_history_is_whole(doings: list[str]) -> None:
    """Editing never raises, keeps one gesture at most, and undo-all gives the first scene."""
    document = Document(room())
    first, refused = document.scene, []
    editing = Editing(document, lambda label, error: refused.append(error))
    for number, doing in enumerate(doings):
        what, _, who = doing.partition(" ")
        edit = SetFields("stool", {"name": f"{who}{number}"})
        if what == "begin":
            editing.begin(who, f"by {who}")
        elif what == "preview":
            editing.preview(who, edit)
        elif what == "commit":
            editing.commit(who)
        elif what == "cancel":
            editing.cancel(who)
        elif what == "apply":
            assert editing.apply(edit)
        else:
            editing.undo()
        assert editing.busy == document.in_gesture
    editing.finish()
    while document.undo():
        pass
    assert document.scene is first
    assert refused == []
