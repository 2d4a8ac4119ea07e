"""Stylising the whole scene from the window: one step, of what is there when it is done."""

from __future__ import annotations

import pytest
from painting_support import Rule, controls
from ui_support import Driver

from studio_core.errors import InputError
from studio_core.scene.nodes import MeshObject
from studio_ui.strokes.scene_style import SceneStyle


def style(driver: Driver) -> SceneStyle:
    """Unfolded, as the menu does it."""
    controls(driver)
    driver.do("stroke.stylise")
    made = controls(driver).style_
    assert made.button.isVisible()
    return made


def press(driver: Driver) -> SceneStyle:
    made = style(driver)
    made.button.click()
    driver.until(lambda: made.button.isEnabled())
    return made


def red(driver: Driver, node: str) -> float:
    found = driver.document.scene[node]
    assert isinstance(found, MeshObject)
    return 0.0 if found.paint is None else float(found.paint.change("base_color")[0, 0])


def test_all_objects_are_painted_in_one_step(painter: Driver) -> None:
    made = style(painter)
    made.form.fields["amount"].spin.setValue(-0.5)  # type: ignore[attr-defined]
    assert made.amount == -0.5
    press(painter)
    assert painter.labels() == ["Open", "Stylise"]
    assert made.told.text() == "3 objects painted."
    assert red(painter, "stool") == pytest.approx(-0.05)
    painter.do("edit.undo")
    assert red(painter, "stool") == 0
    painter.settle()


def test_what_is_edited_in_the_meantime_counts(painter: Driver, rule: Rule) -> None:
    def once() -> None:
        rule.before = lambda: None
        painter.studio.bridge.post(painter.window.commands.hide)

    painter.session.select(["seat"])
    rule.before = once
    press(painter)
    assert painter.labels() == ["Open", "Hide Seat", "Stylise"]
    assert painter.document.scene["seat"].hidden


def test_what_fails_changes_nothing_and_can_be_tried_again(painter: Driver, rule: Rule) -> None:
    scene, rule.problem = painter.document.scene, InputError("The light is too strange")
    made = press(painter)
    assert painter.document.scene is scene
    assert made.told.text() == "The light is too strange"
    rule.problem = None
    press(painter)
    assert painter.labels()[-1] == "Stylise"


def test_it_can_be_cancelled(painter: Driver, rule: Rule) -> None:
    made = style(painter)
    rule.before = lambda: made.job.checkpoint() if made.job is not None else None
    made.button.click()
    (task,) = painter.context.tasks.running
    assert task.job.label == "Stylising"
    painter.context.tasks.cancel()
    painter.until(lambda: made.button.isEnabled())
    assert painter.labels() == ["Open"]
    assert made.told.text() == ""
    assert not painter.context.tasks.running
    assert painter.context.tasks.finished[-1].state == "cancelled"
