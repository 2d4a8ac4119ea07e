"""Strokes in the window, over the real core: what a designer does in one sitting."""

from __future__ import annotations

import re
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from names import nameless
from painting_support import Rule, brush_in_hand, controls, desk, studio_of
from PySide6.QtCore import QPoint, Qt
from PySide6.QtGui import QPalette
from PySide6.QtWidgets import QLabel, QToolButton
from pytestqt.qtbot import QtBot
from ui_support import Driver

from studio_core.edits import SetFields
from studio_core.errors import InputError
from studio_core.scene.nodes import MeshObject
from studio_core.scene.paint import Paint
from studio_core.strokes.stroke import AUTOMATIC, GLOSS, Stroke
from studio_plugins.slf import plugin as slf
from studio_ui.canvas.viewport import Pointer
from studio_ui.strokes.sketches import HEIGHT, WIDTH

ALT, CTRL, SHIFT = (
    Qt.KeyboardModifier.AltModifier,
    Qt.KeyboardModifier.ControlModifier,
    Qt.KeyboardModifier.ShiftModifier,
)
STOOL = (1.0, 0.5, 0.5)


def strokes(driver: Driver) -> list[Stroke]:
    return list(driver.document.scene.of(Stroke))


def paint(driver: Driver, at: QPoint, *ways: QPoint) -> None:
    """A stroke, up to where it is explained."""
    driver.press(at)
    for way in ways:
        driver.move(at + way)
    driver.release(at + (ways[-1] if ways else QPoint()))
    driver.until(lambda: not desk(driver).work.begun)
    driver.settle()


def stool(driver: Driver) -> MeshObject:
    node = driver.document.scene["stool"]
    assert isinstance(node, MeshObject)
    return node


def has_picture(card: QToolButton) -> bool:
    """Not the bare patch of before."""
    image = card.icon().pixmap(WIDTH, HEIGHT).toImage()
    bare = card.palette().color(QPalette.ColorRole.Base)
    return image.pixelColor(image.width() // 2, image.height() // 2) != bare


def same(one: Paint | None, other: Paint | None) -> bool:
    return one is not None and other is not None and one.key == other.key


@pytest.fixture
def explainer(qtbot: QtBot, tmp_path: Path) -> Iterator[Driver]:
    """The same, with the solver that the studio brings."""
    yield from brush_in_hand(studio_of(tmp_path / "state", qtbot, slf))


def test_a_designers_sitting(explainer: Driver, tmp_path: Path) -> None:
    driver, at = explainer, explainer.at(STOOL)
    bot = driver.bot
    # a colour of the picture: radiance, not what the screen makes of it
    driver.session.display(exposure=1.0)
    chair = driver.at((-1.0, 0.5, 0.5))
    bot.mouseClick(driver.viewport, Qt.MouseButton.LeftButton, ALT, chair)
    x, y = chair.x() / driver.viewport.width(), chair.y() / driver.viewport.height()
    picked = desk(driver).store.now.settings.colour
    assert picked == pytest.approx(driver.viewport.probe(x, y).radiance)
    assert picked[0] > 2 * picked[1]
    # paint: one step that holds the stroke and what explains it
    paint(driver, at, QPoint(10, 0), QPoint(20, 4))
    assert driver.labels() == ["Open", "Paint colour on Stool"]
    (stroke,) = strokes(driver)
    assert stroke.name == "Colour on Stool"
    assert stroke.objects == ("stool",)
    assert stroke.marks is not None
    painted = np.not_equal(stroke.marks.wanted, stroke.marks.shown).any(axis=1)
    assert np.allclose(stroke.marks.wanted[painted], picked, rtol=1e-4)
    seen = driver.viewport.probe(at.x() / driver.viewport.width(), at.y() / driver.viewport.height())
    assert np.allclose(seen.radiance, picked, rtol=0.1), "the picture came to look as it was painted"
    # why
    why = controls(driver).why
    (line,) = why.lines
    assert line.text().startswith("Stool: ")
    share = re.search(r"explains (\d+) % of the stroke", line.text())
    assert share is not None
    assert int(share[1]) > 90
    assert len(why.cards) > 1
    assert [card.isChecked() for card in why.cards] == [True] + [False] * (len(why.cards) - 1)
    driver.until(lambda: all(has_picture(card) for card in controls(driver).why.cards))
    # the runner-up instead
    first, (finding,) = stool(driver).paint, desk(driver).work.findings(stroke.id)
    other = finding.reasons[1]
    controls(driver).why.cards[1].click()
    assert driver.labels()[-1].endswith("Stool") or driver.labels()[-1].startswith("Leave Stool")
    assert stool(driver).paint is None or not same(stool(driver).paint, first)
    if other.meaning:
        assert strokes(driver)[0].meaning == other.meaning
        assert [card.isChecked() for card in controls(driver).why.cards[:2]] == [False, True]
    # undo, redo
    driver.do("edit.undo")
    assert same(stool(driver).paint, first)
    driver.do("edit.undo")
    assert (strokes(driver), stool(driver).paint) == ([], None)
    driver.do("edit.redo")
    driver.settle()
    # save, reopen
    driver.answers.target = tmp_path / "room.lucarne"
    driver.do("file.save")
    driver.until(lambda: not driver.window.files.modified)
    driver.window.files.open(tmp_path / "room.lucarne")
    driver.until(lambda: driver.context.document.history[0].scene.nodes.get("stool") is not None)
    driver.until(lambda: same(stool(driver).paint, first) and stool(driver).paint is not first)
    driver.settle()
    # chosen in the list, it tells why again
    inside = controls(driver)
    driver.until(lambda: inside.list.topLevelItemCount() == 1)
    inside.list.setCurrentItem(inside.list.topLevelItem(0))
    driver.until(lambda: bool(inside.why.cards))
    assert inside.why.lines[0].text().startswith("Stool: ")
    # what moves keeps its paint
    driver.session.select(["stool"])
    driver.do("object.left")
    assert same(stool(driver).paint, first)
    driver.settle()
    # export
    driver.answers.target = tmp_path / "room.glb"
    driver.do("file.export_glb")
    driver.until(lambda: (tmp_path / "room.glb").exists() and not driver.context.tasks.running)
    assert driver.problems() == []


def test_what_is_painted_is_seen_at_once_and_goes_with_the_answer(painter: Driver) -> None:
    driver, at = painter, painter.at(STOOL)
    desk(driver).store.use(colour=(0.0, 3.0, 0.0), size=0.2)
    before = driver.viewport.grab_image().pixelColor(at)
    driver.press(at)
    driver.move(at + QPoint(5, 0))
    seen = driver.viewport.grab_image().pixelColor(at)
    assert (seen.red(), seen.green()) == (0, 255)
    assert before.green() < 200
    driver.until(lambda: stool(driver).paint is not None)  # while the button is held
    assert driver.labels() == ["Open"]
    driver.release(at + QPoint(5, 0))
    driver.until(lambda: len(driver.labels()) == 2)
    driver.settle()
    after = driver.viewport.grab_image().pixelColor(at)
    assert before.green() < after.green() < 255


def test_the_runner_up_is_a_click_away(painter: Driver) -> None:
    driver = painter
    paint(driver, driver.at(STOOL), QPoint(10, 0))
    why = controls(driver).why
    assert why.lines[0].text().endswith("explains 93 % of the stroke")
    assert [card.text() for card in why.cards] == ["colour  93 %", "gloss  90 %"]
    told = [label.text() for label in why.findChildren(QLabel)]
    assert "Cannot tell from here: shine" in told
    assert "One other reason is nearly as good" in told
    first = stool(driver).paint
    driver.until(lambda: all(has_picture(card) for card in why.cards))
    driver.do("stroke.stylise")
    assert nameless(driver.window) == []
    why.cards[1].click()
    assert driver.labels()[-1] == "Gloss of Stool"
    assert stool(driver).paint is not None
    assert "roughness" in stool(driver).paint.changes
    assert strokes(driver)[0].meaning == GLOSS
    assert [card.isChecked() for card in controls(driver).why.cards] == [False, True]
    assert all(has_picture(card) for card in controls(driver).why.cards), "those of before"
    driver.do("edit.undo")
    assert stool(driver).paint is first
    assert [card.isChecked() for card in controls(driver).why.cards] == [True, False]


def test_what_is_left_to_the_program_again_may_change_any_object(painter: Driver) -> None:
    driver = painter
    paint(driver, driver.at(STOOL), QPoint(10, 0))
    (stroke,) = strokes(driver)
    chosen = {"meaning": GLOSS, "through": "stool", "through_slot": 0}
    driver.context.editing.apply(SetFields(stroke.id, chosen, "Choose"))
    means = controls(driver).form.fields["meaning"].combo  # type: ignore[attr-defined]
    driver.until(lambda: means.currentText() == GLOSS)
    means.activated.emit(means.findText(AUTOMATIC))
    driver.until(lambda: not desk(driver).work.begun)
    (stroke,) = strokes(driver)
    assert (stroke.meaning, stroke.through, stroke.through_slot) == (AUTOMATIC, "", -1)


def test_escape_abandons_a_stroke(painter: Driver) -> None:
    driver, at = painter, painter.at(STOOL)
    scene = driver.document.scene
    driver.press(at)
    driver.move(at + QPoint(8, 0))
    driver.bot.keyClick(driver.viewport, Qt.Key.Key_Escape)
    driver.move(at + QPoint(16, 0))
    driver.release(at + QPoint(16, 0))
    driver.settle()
    assert driver.document.scene is scene
    assert driver.labels() == ["Open"]


def test_the_background_alone_makes_no_stroke(painter: Driver) -> None:
    scene = painter.document.scene
    paint(painter, QPoint(20, 12), QPoint(4, 0))
    assert painter.document.scene is scene


def test_shift_paints_a_straight_line(painter: Driver) -> None:
    driver, at = painter, painter.at(STOOL)
    hand, shift = desk(driver).hand, partial(Pointer, button="left", shift=True, pixels=(800, 500))

    def pointer(kind: str, way: QPoint) -> Pointer:
        place = at + way
        return shift(kind, place.x() / driver.viewport.width(), place.y() / driver.viewport.height())

    hand.pointer(pointer("press", QPoint()))
    for way in (QPoint(5, 30), QPoint(30, 20), QPoint(40, 0)):
        hand.pointer(pointer("move", way))
    assert hand.sheet is not None
    start, end = (hand.place(pointer("move", way)) for way in (QPoint(), QPoint(40, 0)))
    assert hand.sheet.path == [start, end]
    mask = desk(driver).store.now.brush.mask([start, end], *reversed(hand.sheet.mask.shape))
    own = hand.sheet.picture.node == hand.sheet.picture.nodes.index("stool")
    assert np.array_equal(hand.sheet.mask, mask * own)
    driver.context.editing.cancel_any()
    hand.pointer(pointer("release", QPoint(40, 0)))
    assert hand.sheet is None


def test_what_changes_in_the_list_is_solved_again(painter: Driver, rule: Rule) -> None:
    driver = painter
    paint(driver, driver.at(STOOL), QPoint(10, 0))
    paint(driver, driver.at(STOOL) + QPoint(0, 20), QPoint(10, 20))
    one, other = strokes(driver)
    inside, asked = controls(driver), len(rule.calls)
    painted = stool(driver).paint
    inside.list.topLevelItem(0).setCheckState(0, Qt.CheckState.Unchecked)
    driver.until(lambda: not desk(driver).work.begun)
    assert driver.labels()[-1] == "Leave out Colour on Stool"
    assert strokes(driver)[0].hidden
    assert not same(stool(driver).paint, painted)
    assert rule.calls[asked:] == [(one.id, other.id)]
    driver.do("edit.undo")
    assert same(stool(driver).paint, painted)
    driver.settle()
    inside.list.setCurrentItem(inside.list.topLevelItem(1))
    inside.form.fields["weight"].spin.setValue(4.0)  # type: ignore[attr-defined]
    driver.until(lambda: driver.labels()[-1] == "Weight of Colour on Stool" and not desk(driver).work.begun)
    assert strokes(driver)[1].weight == 4.0
    assert not same(stool(driver).paint, painted)
    for _ in range(2):
        inside.list.setCurrentItem(inside.list.topLevelItem(0))
        controls(driver).bin.click()
        driver.until(lambda: not desk(driver).work.begun and not inside.soon.isActive())
    assert strokes(driver) == []
    assert stool(driver).paint is None, "nothing asks for it any more"
    driver.do("edit.undo")
    assert stool(driver).paint is not None


def test_what_fails_is_told_in_one_line_and_changes_nothing(painter: Driver, rule: Rule) -> None:
    rule.problem = InputError("The light is too strange")
    scene = painter.document.scene
    paint(painter, painter.at(STOOL), QPoint(10, 0))
    assert painter.document.scene is scene
    assert any("The light is too strange" in text for text in painter.problems())
    assert controls(painter).why.told.text() == "The light is too strange"
    rule.problem = None
    paint(painter, painter.at(STOOL), QPoint(10, 0))
    assert len(strokes(painter)) == 1


def test_another_edit_keeps_the_stroke_which_is_explained_after_it(painter: Driver, rule: Rule) -> None:
    driver, at = painter, painter.at(STOOL)

    def once() -> None:
        rule.before = lambda: None
        driver.studio.bridge.post(driver.window.commands.hide)

    driver.session.select(["seat"])
    driver.press(at)
    rule.before = once
    driver.release(at)
    driver.until(lambda: len(driver.labels()) == 4 and not desk(driver).work.begun)
    assert driver.labels()[1:] == ["Paint colour on Stool", "Hide Seat", "Explain Colour on Stool"]
    assert stool(driver).paint is not None


def test_the_brush_is_turned_by_keys_and_wheel_and_remembered(painter: Driver) -> None:
    driver, store = painter, desk(painter).store
    size, hardness = store.now.brush.size, store.now.brush.hardness
    driver.do("stroke.larger")
    driver.do("stroke.softer")
    assert store.now.brush.size > size
    assert store.now.brush.hardness < hardness
    driver.do("stroke.smaller")
    assert store.now.brush.size == pytest.approx(size)
    driver.do("stroke.indirect")
    assert controls(driver).hands[True].isChecked()
    again = type(store)(driver.window.settings)
    assert again.now == store.now
    driver.window.settings.set("stroke_brush", {"size": "large", "tool": 7})
    assert type(store)(driver.window.settings).now == type(store.now)()


def test_the_spread_is_shown_over_the_picture(painter: Driver) -> None:
    driver = painter
    paint(driver, driver.at(STOOL), QPoint(10, 0))
    inside = controls(driver)
    inside.spread.click()
    driver.until(lambda: len(desk(driver).likeness.marks((0, 0, 1, 1)).marks) == 1)
    (film,) = desk(driver).likeness.marks((0, 0, 1, 1)).marks
    height, width = film.pixels.shape[:2]  # type: ignore[union-attr]
    for place, there in ((STOOL, True), ((-1.0, 0.5, 0.5), False)):
        at = driver.at(place)
        row, column = at.y() * height // driver.viewport.height(), at.x() * width // driver.viewport.width()
        assert bool(film.pixels[row, column, 3]) == there  # type: ignore[union-attr]
    inside.spread.click()
    assert desk(driver).likeness.marks((0, 0, 1, 1)).marks == ()


def test_strokes_are_no_clutter(painter: Driver) -> None:
    driver = painter
    paint(driver, driver.at(STOOL), QPoint(10, 0))
    (stroke,) = strokes(driver)
    outliner = driver.window.panels["outliner"]
    assert not outliner.model.of(stroke.id).isValid()
    driver.do("edit.select_all")
    assert stroke.id not in driver.session.selection
