"""A stroke is explained again until the picture shows it: by a rule, and in a room that lights itself."""

from __future__ import annotations

import threading
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from painting_support import Rule, brush_in_hand, controls, desk, studio_of
from PySide6.QtCore import QPoint
from pytestqt.qtbot import QtBot
from ui_support import Driver

from studio.bench.strokes_figure_scenes import closed
from studio_core.edits import Compound, SetPaint
from studio_core.errors import InputError
from studio_core.scene.nodes import Camera, NodeId, Scene
from studio_core.scene.paint import Paint
from studio_core.session import View
from studio_core.shading.job import Job
from studio_core.strokes.solution import Finding, Lit, Reason, Solution
from studio_core.strokes.stroke import Stroke
from studio_plugins.interreflection import plugin as interreflection
from studio_plugins.slf import plugin as slf

STOOL = (1.0, 0.5, 0.5)


class World(Rule):
    """Half of the light at a stroke follows a power of the colour's share that there is: others send it."""

    def __init__(self) -> None:
        super().__init__()
        self.power = 4.0

    def light(self, scene: Scene) -> Any:
        """Of what there was once."""
        return 0.5 * share(scene) + 0.5 * share(scene) ** self.power

    def solve(self, scene: Scene, strokes: Sequence[NodeId], lit: Lit, params: Any, job: Job) -> Solution:
        self.calls.append(tuple(strokes))
        self.before()
        if self.problem is not None:
            raise self.problem
        (stroke,) = (scene[name] for name in strokes)
        marks = stroke.marks.some(stroke.marks.painted)
        light = marks.shown.mean(axis=0) * self.light(scene) / share(scene)
        change = marks.wanted.mean(axis=0) / light - 1
        paint = Paint.of(np.zeros((1, 3)), np.array([[0, 1, 0]]), np.zeros(1), {"base_color": change[None]})
        edit = SetPaint("stool", paint)
        reason = Reason("colour", 1.0, 0.0, {"base_color": (0.5, 0.4, 0.3)}, edit)
        return Solution(Compound("World", (edit,)), (Finding("stool", 0, (stroke.id,), (reason,)),))

    def shown(self, scene: Scene, strokes: Sequence[NodeId], lit: Lit, job: Job) -> dict[NodeId, Any]:
        return {name: scene[name].marks.shown * self.light(scene) for name in strokes}


def share(scene: Scene) -> Any:
    """Of the stool's colour, that it has now."""
    paint = scene["stool"].paint
    return np.ones(3) if paint is None else 1 + paint.change("base_color")[0]


@pytest.fixture
def rule() -> World:
    return World()


@pytest.fixture
def painter(painter: Driver) -> Driver:
    """With a stroke on the stool."""
    desk(painter).store.use(colour=(0.4, 0.3, 0.3))
    paint(painter)
    return painter


def paint(driver: Driver) -> Stroke:
    at = driver.at(STOOL)
    driver.press(at)
    driver.release(at + QPoint(6, 0))
    driver.until(lambda: not desk(driver).work.begun)
    driver.settle()
    return stroke_of(driver)


def stroke_of(driver: Driver) -> Stroke:
    (found,) = driver.document.scene.of(Stroke)
    return found


def match(driver: Driver) -> str:
    """Until it is over, and what is found now is told: the words for how it went."""
    matching, work = desk(driver).matching, desk(driver).work
    matching.start(stroke_of(driver).id)
    driver.until(lambda: not matching.running and not work.asking)
    return matching.told


def test_what_others_light_is_asked_for_until_it_is_met_in_one_step(painter: Driver, rule: World) -> None:
    driver, stroke, before = painter, stroke_of(painter), share(painter.document.scene)
    told = match(driver)
    assert told.startswith("Matched: ")
    assert driver.labels()[-2:] == ["Paint colour on Stool", "Match Colour on Stool"]
    np.testing.assert_allclose(rule.light(driver.document.scene), before, rtol=0.02)
    assert stroke_of(driver).table is stroke.table or stroke_of(driver).table.key == stroke.table.key
    asked = len(rule.calls)
    assert match(driver).startswith("The picture shows what was painted: ")
    assert len(rule.calls) == asked, "nothing was left to be asked"
    assert driver.labels()[-1] == "Match Colour on Stool"
    driver.do("edit.undo")
    np.testing.assert_array_equal(share(driver.document.scene), before)


def test_what_never_follows_is_left_as_it_was(painter: Driver, rule: World) -> None:
    rule.light, scene = lambda scene: np.ones(3), painter.document.scene  # type: ignore[method-assign]
    assert match(painter).startswith("No nearer than ")
    assert painter.document.scene is scene
    assert painter.labels()[-1] == "Paint colour on Stool"


@pytest.mark.parametrize("how", ["escape", "stop", "edit", "paint", "undo"])
def test_it_gives_way(painter: Driver, rule: World, how: str) -> None:
    driver, matching, scene = painter, desk(painter).matching, painter.document.scene
    driver.session.select(["seat"])
    does = {
        "escape": driver.context.editing.cancel_any,
        "stop": matching.stop,
        "edit": driver.window.commands.hide,
        "undo": driver.context.editing.undo,
        "paint": lambda: desk(driver).work.begin("Paint"),
    }
    calls, done = len(rule.calls), threading.Event()

    def now() -> None:
        does[how]()
        done.set()

    def second() -> None:
        if len(rule.calls) > calls + 2:
            rule.before = lambda: None
            driver.studio.bridge.post(now)
            assert done.wait(60)

    rule.before = second
    matching.start(stroke_of(driver).id)
    driver.until(lambda: not matching.running)
    assert done.is_set()
    assert matching.told.startswith("Stopped ")
    matched = "Match Colour on Stool" in driver.labels()
    assert matched == (how != "escape")
    assert (driver.document.scene is scene) == (how in ("escape", "undo"))
    assert (driver.labels()[-1] == "Hide Seat") == (how == "edit")
    driver.context.editing.cancel_any()


def test_a_window_may_close_meanwhile(painter: Driver, rule: World) -> None:
    asked = threading.Event()
    rule.before = asked.set
    desk(painter).matching.start(stroke_of(painter).id)
    painter.until(asked.is_set)
    painter.close()
    assert not desk(painter).matching.running


def test_what_fails_is_told_and_leaves_nothing(painter: Driver, rule: World) -> None:
    rule.problem, scene = InputError("The light is too strange"), painter.document.scene
    assert match(painter) == "The light is too strange"
    assert desk(painter).matching.failed
    assert painter.document.scene is scene
    rule.problem = None
    assert match(painter).startswith("Matched: ")


@pytest.fixture
def explainer(qtbot: QtBot, tmp_path: Path) -> Iterator[Driver]:
    """With what the studio brings."""
    yield from brush_in_hand(studio_of(tmp_path / "state", qtbot, slf, interreflection))


def test_a_room_that_lights_itself_comes_to_look_as_painted(explainer: Driver) -> None:
    driver = explainer
    inside = controls(driver)
    scene = closed()
    driver.open(scene)
    camera = scene["camera"]
    assert isinstance(camera, Camera)
    driver.session.look(View(camera.transform, camera.fov, driver.session.view.width, 300, 1.0))
    driver.session.bounce(True)
    driver.settle()
    desk(driver).store.use(colour=(0.15, 0.19, 0.24), size=0.2)
    assert not inside.match.isVisibleTo(inside), "there is no stroke"
    at = QPoint(driver.viewport.width() // 2, driver.viewport.height() // 4)
    driver.press(at)
    driver.release(at + QPoint(60, 0))
    driver.until(lambda: not desk(driver).work.begun)
    driver.settle()
    controls(driver)
    assert inside.match.isVisibleTo(inside)
    (first,) = desk(driver).work.findings(stroke_of(driver).id)
    inside.match.click()
    controls(driver)
    assert inside.match.text() == "Stop here"
    driver.until(lambda: not desk(driver).matching.running)
    driver.settle()
    controls(driver)
    assert inside.match.text() == "Match what was painted"
    assert inside.matched.text().startswith("Matched: ")
    seen = driver.viewport.probe((at.x() + 30) / driver.viewport.width(), at.y() / driver.viewport.height())
    assert np.allclose(seen.radiance, (0.15, 0.19, 0.24), rtol=0.1)
    assert driver.labels()[-1].startswith("Match ")
    driver.until(lambda: not desk(driver).work.asking)
    was, now = (
        next(v for v in found.reasons[0].values.values() if isinstance(v, tuple))
        for found in (first, *desk(driver).work.findings(stroke_of(driver).id))
    )
    assert now[0] > was[0], "it was too dark in red, and what is told now is what there is now"
    assert now[2] < was[2]
