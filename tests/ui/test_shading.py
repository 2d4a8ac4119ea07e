"""The picture and its making: stale marks, order of events, failures, threads."""

from __future__ import annotations

import threading
import time

import numpy as np
import pytest
from ui_support import Driver, Make, room

from studio_core.edits import Add, Edit, Move, SetFields, SetMaterial, SetPaint
from studio_core.scene.diff import Aspect
from studio_core.scene.nodes import PointLamp
from studio_core.scene.paint import Paint
from studio_core.scene.transform import Transform
from studio_core.session import View
from studio_ui.feed import Freshness
from studio_ui.pace import ALIKE, KEPT


def shift(driver: Driver, x: float) -> None:
    driver.document.apply(Move({"stool": Transform((x, 0.0, 0.0))}))


def rough(driver: Driver, value: float) -> None:
    driver.document.apply(SetMaterial("red", {"roughness": value}))


def test_the_first_picture_is_shown_with_its_numbers(driver: Driver) -> None:
    assert driver.viewport.freshness is Freshness.CURRENT
    image = driver.viewport.grab_image()
    at = driver.at((-1.0, 0.5, 0.5))
    colour = image.pixelColor(at)
    assert colour.red() > 2 * colour.green(), "the chair is red"
    status = driver.window.status
    assert status.vertices.text() == "8 vertices"
    assert status.directions.text() == "1,024 directions"
    assert status.error.text() == "error: not measured"
    assert status.backend.text()


def test_the_old_picture_stays_marked_while_a_new_one_is_made(make: Make) -> None:
    driver = make(threads=True)
    driver.show(room())
    old = driver.feed.last.picture
    states: list[Freshness] = []
    driver.feed.freshness.connect(states.append)
    driver.fake.gate = threading.Event()
    driver.fake.started.clear()
    shift(driver, 1.5)
    driver.until(driver.fake.started.is_set)
    assert driver.viewport.freshness is Freshness.STALE
    assert driver.viewport._picture is old
    driver.fake.gate.set()
    driver.settle()
    assert states[0] is Freshness.STALE
    assert states[-1] is Freshness.CURRENT
    assert driver.viewport._picture is not old
    assert driver.viewport.freshness is Freshness.CURRENT


def test_an_edit_while_computing_cancels_and_the_newest_is_shown(make: Make) -> None:
    driver = make(threads=True)
    driver.show(room())
    shown: list[float] = []
    driver.feed.shown.connect(lambda s: shown.append(float(s.picture.distance.min())))
    driver.fake.gate = threading.Event()
    driver.fake.started.clear()
    rough(driver, 0.55)
    driver.until(driver.fake.started.is_set)
    cancelled = driver.feed._scheduler.cancelled_jobs
    for value in (0.6, 0.7, 0.8):
        rough(driver, value)
    driver.until(lambda: driver.feed._scheduler.cancelled_jobs == cancelled + 1)
    assert shown == [], "what was cancelled is never shown"
    driver.fake.gate.set()
    driver.settle()
    assert driver.fake.frames[-1].scene is driver.document.scene
    asked = [f.scene.material("red").values["roughness"] for f in driver.fake.frames]
    assert 0.6 not in asked, "what happened meanwhile is asked for once"
    assert 0.7 not in asked


def test_a_single_move_is_first_seen_quickly(driver: Driver) -> None:
    count = len(driver.fake.frames)
    shift(driver, 1.5)
    driver.settle()
    glance, exact = driver.fake.frames[count:]
    assert glance.moving
    assert glance.view.width < driver.feed.size[0]
    assert not exact.moving
    assert exact.view.width == driver.feed.size[0]
    rough(driver, 0.9)
    driver.settle()
    (exact,) = driver.fake.frames[count + 2 :]
    assert not exact.moving, "what is soon exact needs no other"


def test_keys_that_come_quicker_than_pictures_are_seen_on_their_way(make: Make) -> None:
    driver = make(threads=True)
    driver.show(room())
    driver.fake.gate = threading.Event()
    driver.fake.started.clear()
    cancelled = driver.feed._scheduler.cancelled_jobs
    shift(driver, 1.1)
    driver.until(driver.fake.started.is_set)
    shown: list[float] = []
    driver.feed.shown.connect(
        lambda s: shown.append(driver.fake.frames[-1].scene.world("stool").translation[0])
    )
    for x in (1.2, 1.3, 1.4):
        shift(driver, x)
        driver.bot.wait(5)
    assert driver.feed._scheduler.cancelled_jobs == cancelled
    driver.fake.gate.set()
    driver.settle()
    assert shown[0] == 1.1
    assert driver.fake.frames[-1].scene is driver.document.scene


def test_a_drag_does_not_wait_for_an_exact_picture(make: Make) -> None:
    driver = make(threads=True)
    driver.show(room())
    driver.fake.gate = threading.Event()
    driver.fake.started.clear()
    rough(driver, 0.55)
    driver.until(driver.fake.started.is_set)
    cancelled = driver.feed._scheduler.cancelled_jobs
    driver.feed.hold()
    shift(driver, 1.5)
    driver.until(lambda: driver.feed._scheduler.cancelled_jobs == cancelled + 1)
    driver.fake.gate.set()
    driver.feed.release()
    driver.settle()


def test_a_change_of_name_computes_nothing(driver: Driver) -> None:
    count = len(driver.fake.frames)
    driver.document.apply(SetFields("stool", {"name": "Taboret"}))
    driver.bot.wait(30)
    assert len(driver.fake.frames) == count
    assert driver.feed.state is Freshness.CURRENT


def test_many_edits_at_once_are_one_request(driver: Driver) -> None:
    count = len(driver.fake.frames)
    for x in np.linspace(1, 2, 20):
        shift(driver, float(x))
    driver.settle()
    assert len(driver.fake.frames) <= count + 2


def test_while_dragging_pictures_are_quick_and_at_rest_they_are_fine(driver: Driver) -> None:
    driver.feed.hold()
    shift(driver, 1.4)
    driver.until(lambda: driver.fake.frames[-1].scene is driver.document.scene)
    view = driver.fake.frames[-1].view
    assert view.antialias == 1
    assert view.width * view.height <= 1.01 * driver.feed.pace.pixels
    driver.feed.release()
    driver.settle()
    view = driver.fake.frames[-1].view
    assert view.antialias == 2
    assert view.fine_edges
    assert (view.width, view.height) == driver.feed.size


def test_other_pixels_are_another_view_to_the_stages(driver: Driver) -> None:
    asked: list[tuple[View, Aspect]] = []
    request = driver.feed._scheduler.request
    driver.feed._scheduler.request = lambda frame, changes: (
        asked.append((frame.view, changes.aspects)),
        request(frame, changes),
    )[1]
    driver.feed.hold()
    for x in (1.1, 1.2):
        shift(driver, x)
        driver.until(lambda: driver.feed.last.moving and not driver.feed.busy)
    (small, first), (same, then) = asked
    assert small.width < driver.feed.size[0]
    assert not small.fine_edges
    assert first & Aspect.VIEW
    assert first & Aspect.TRANSFORM
    assert same == small
    assert not then & Aspect.VIEW, "primary rays are kept"
    driver.feed.release()
    driver.settle()
    assert asked[-1][1] & Aspect.VIEW


def asked_for(driver: Driver) -> list[tuple[View, bool, Aspect]]:
    """View, whether in motion, and changes of whatever is asked for from now on."""
    asked: list[tuple[View, bool, Aspect]] = []
    request = driver.feed._scheduler.request
    driver.feed._scheduler.request = lambda frame, changes: (
        asked.append((frame.view, frame.moving, changes.aspects)),
        request(frame, changes),
    )[1]
    return asked


@pytest.mark.parametrize(
    "edit",
    [
        SetMaterial("red", {"roughness": 0.7}),
        SetFields("lamp", {"intensity": 3.0}),
        Move({"lamp": Transform((0.0, 2.0, 0.0))}),
        SetPaint("stool", Paint.of([[0, 0, 0]], [[0, 1, 0]], [0], {"base_color": [[0.1, 0.0, 0.0]]})),
    ],
    ids=["material", "gain", "lamp", "paint"],
)
def test_dragging_a_material_or_a_light_or_painting_keeps_what_is_seen_at_rest(
    driver: Driver, edit: Edit
) -> None:
    driver.document.apply(Add((PointLamp(id="lamp", name="Lamp"),)))
    driver.settle()
    driver.feed.restart()  # whatever the new lamp made of the window's layout
    driver.settle()
    rest = driver.fake.frames[-1].view
    assert (rest.antialias, rest.fine_edges) == (2, True)
    asked = asked_for(driver)
    driver.feed.hold()
    driver.document.apply(edit)
    driver.until(lambda: driver.feed.last.moving and not driver.feed.busy)
    ((view, moving, aspects),) = asked
    assert (view, moving) == (rest, True)
    assert not aspects & Aspect.VIEW, "primary rays are kept"
    driver.feed.release()
    driver.settle()
    assert not asked[-1][1]
    assert asked[-1][2] & Aspect.VIEW


def test_a_material_changed_while_looking_around_has_the_pixels_of_motion(driver: Driver) -> None:
    driver.feed.hold()
    shift(driver, 1.4)
    driver.until(lambda: driver.feed.last.moving and not driver.feed.busy)
    asked = asked_for(driver)
    rough(driver, 0.9)
    driver.until(lambda: bool(asked) and not driver.feed.busy)
    (view, _, aspects) = asked[0]
    assert view.width < driver.feed.size[0]
    assert not aspects & Aspect.VIEW
    driver.feed.release()
    driver.settle()


def test_material_pictures_that_come_slowly_lose_pixels(driver: Driver) -> None:
    for _ in range(ALIKE):
        driver.feed.pace.took(2 * KEPT, kept=True)
    asked = asked_for(driver)
    driver.feed.hold()
    rough(driver, 0.7)
    driver.until(lambda: driver.feed.last.moving and not driver.feed.busy)
    assert asked[0][0].width < driver.feed.size[0]
    driver.feed.release()
    driver.settle()
    assert driver.feed.pace.keeps, "the next motion tries again"


def test_while_dragging_quick_pictures_grow(driver: Driver) -> None:
    driver.feed._clock = lambda: 0.0  # nothing takes any time
    driver.feed.resized(1920, 1080)
    driver.feed.hold()
    sizes = []
    for x in np.linspace(1.0, 2.0, 12):
        shift(driver, float(x))
        driver.until(lambda: driver.feed.last.moving and not driver.feed.busy)
        sizes.append(driver.fake.frames[-1].view.width)
    assert sizes[0] < sizes[-1] == 961
    assert sizes == sorted(sizes)
    driver.feed._clock = time.monotonic
    driver.feed.release()
    driver.settle()
    assert driver.feed.last.view.width == 1920


def test_a_backend_that_fails_is_contained_and_named(driver: Driver) -> None:
    old = driver.viewport._picture
    driver.fake.fail = ZeroDivisionError("no light")
    shift(driver, 1.5)
    driver.until(lambda: driver.feed.state is Freshness.FAILED)
    assert driver.viewport._picture is old
    assert driver.document.scene.world("stool").translation == (1.5, 0.0, 0.0)
    (told,) = driver.problems()
    assert f"'{driver.session.backend}'" in told
    assert "no light" in told
    assert driver.window.status.message.text() == told
    assert any("no light" in failure.what for failure in driver.context.host.failures)
    driver.fake.fail = None
    driver.document.apply(SetMaterial("red", {"roughness": 0.9}))
    driver.settle()
    assert driver.fake.frames[-1].scene is driver.document.scene


def test_a_backend_that_leaves_the_program_is_contained(driver: Driver) -> None:
    driver.fake.fail = SystemExit(3)
    shift(driver, 1.5)
    driver.until(lambda: driver.feed.state is Freshness.FAILED)
    assert len(driver.problems()) == 1
    driver.fake.fail = None
    driver.do("shade.again")
    driver.settle()


def test_a_cancelled_job_leaves_what_is_shown(make: Make) -> None:
    driver = make(threads=True)
    driver.show(room())
    driver.fake.gate = threading.Event()
    driver.fake.started.clear()
    shift(driver, 1.5)
    driver.until(driver.fake.started.is_set)
    panel = driver.window.panels["jobs"]
    driver.until(lambda: len(panel.rows) == 1)
    panel.rows[0].button.click()
    driver.until(lambda: not driver.feed.busy)
    assert driver.feed.state is Freshness.FAILED
    driver.until(lambda: not panel.rows)
    driver.fake.gate.set()
    shift(driver, 1.6)
    driver.settle()
    assert driver.fake.frames[-1].scene is driver.document.scene


def test_exposure_and_view_transform_compute_nothing(driver: Driver) -> None:
    count = len(driver.fake.frames)
    at = driver.at((-1.0, 0.5, 0.5))
    before = driver.viewport.grab_image().pixelColor(at).red()
    driver.viewport.setFocus()
    driver.do("view.darker")
    driver.do("view.darker")
    assert driver.session.exposure == -1.0
    assert driver.viewport.grab_image().pixelColor(at).red() < before
    driver.session.display(tonemap="raw")
    assert driver.window.view_controls.transform.currentData() == "raw"
    driver.bot.wait(20)
    assert len(driver.fake.frames) == count


def test_a_smaller_canvas_asks_for_a_smaller_picture(driver: Driver) -> None:
    driver.window.resize(900, 500)
    driver.until(lambda: driver.feed.size == (driver.viewport.width(), driver.viewport.height()))
    driver.settle()
    assert driver.feed.last.picture.linear.shape[:2] == (driver.viewport.height(), driver.viewport.width())
