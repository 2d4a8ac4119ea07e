"""What strokes and findings are called, and from where small pictures look."""

from __future__ import annotations

import dataclasses
import re

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from ui_support import room

from studio_core.edits import Add, Compound, SetFields
from studio_core.scene.transform import looking
from studio_core.session import View
from studio_core.strokes.marks import Marks
from studio_core.strokes.solution import Finding, Reason
from studio_core.strokes.stroke import AUTOMATIC, COLOUR, FIXATE, GLOSS, TOOLS, Stroke
from studio_ui.canvas.projection import project
from studio_ui.strokes.sketches import around
from studio_ui.strokes.why import chosen_reason, held, short_name, swatch, together, worth_showing
from studio_ui.strokes.words import TOOLS as NAMES
from studio_ui.strokes.words import changed, nothing_found, painted_on, place, sentence, silence


def reason(meaning: str, explained: float = 0.93, **values: float | tuple[float, float, float]) -> Reason:
    return Reason(meaning, explained, 0.0, values, Compound("", ()))


def test_every_tool_has_its_words() -> None:
    assert set(NAMES) == set(TOOLS)


def test_things_are_called_by_their_groups() -> None:
    scene = room()
    assert painted_on(scene, ["seat"]) == painted_on(scene, ["seat", "back"]) == "Chair"
    assert painted_on(scene, ["stool", "seat"]) == "2 things"
    assert painted_on(scene, ["gone"]) == "nothing"
    fixed = SetFields("chair", {"locked": True})(scene)
    assert painted_on(fixed, ["seat"]) == "Seat", "of a room that stays where it is, its part"
    assert [place(scene, node) for node in ("seat", "stool", "gone")] == [
        "Chair · Seat",
        "Stool",
        "What is gone",
    ]


def test_a_finding_is_a_sentence() -> None:
    finding = Finding("seat", 0, ("s",), (reason("shine", shine=0.35),))
    change = changed({"shine": 0.04}, {"shine": "Shine"}, finding.reasons[0])
    told = sentence(place(room(), "seat"), finding.reasons[0], change)
    assert told == "Chair · Seat: shine 0.04 → 0.35, explains 93 % of the stroke"
    assert sentence("Chair · Seat", reason(""), "") == "Chair · Seat: nothing needs to change"
    assert silence(finding) == ""
    assert (
        silence(Finding("seat", 0, (), (), silent=("shine", "gloss")))
        == "Cannot tell from here: shine and gloss"
    )


def test_what_changes_most_is_told_first_and_what_stays_not_at_all() -> None:
    before = {"a": 0.5, "b": (0.1, 0.1, 0.1), "c": 0.2}
    found = reason("everything", a=0.6, b=(0.1, 0.9, 0.1), c=0.2)
    assert changed(before, {"b": "Colour"}, found) == "colour 0.10 0.10 0.10 → 0.10 0.90 0.10, a 0.5 → 0.6"


@given(st.floats(-10, 10))
def test_shares_are_shares(explained: float) -> None:
    told = sentence("Seat", reason("shine", explained), "")
    assert 0 <= int(told.split("explains ")[1].split(" %")[0]) <= 100


def test_what_was_taken_is_what_it_means() -> None:
    finding = Finding("stool", 0, ("s",), (reason(COLOUR), reason(GLOSS)))
    for meaning, expected in ((AUTOMATIC, COLOUR), (GLOSS, GLOSS), (COLOUR, COLOUR), ("everything", COLOUR)):
        assert chosen_reason(Stroke(id="s", meaning=meaning), finding).meaning == expected


def test_colours_are_seen_and_read() -> None:
    found, before = reason("colour", b=(1.0, 0.0, 0.0), c=0.5), {"b": (0.0, 0.0, 0.0), "c": 0.2}
    told = changed(before, {}, found, swatch)
    assert re.findall("#[0-9a-f]{6}", told) == ["#000000", "#ff0000"]
    assert "c 0.2 → 0.5" in told


def test_what_explains_nothing_is_not_offered() -> None:
    reasons = (reason(COLOUR), reason(GLOSS, 0.004), reason("", 0.0), reason("shine", 0.2))
    finding = Finding("stool", 0, ("s",), reasons)
    assert [r.meaning for _, r in worth_showing([finding], reasons[0])] == [COLOUR, "", "shine"]
    assert (finding, reasons[1]) in worth_showing([finding], reasons[1])


def test_of_rivals_one_holds_and_the_best_are_offered_with_it() -> None:
    def rival(node: str, *scores: float) -> Finding:
        reasons = (dataclasses.replace(reason(COLOUR), score=score) for score in scores)
        return Finding(node, 0, ("s",), tuple(reasons), rivals=True)

    side, _, lamp = rivals = [rival("side", 1.0, 4.0, 5.0), rival("box", 2.0, 6.0), rival("lamp", 7.0)]
    plain = Finding("stool", 0, ("s",), (reason(COLOUR),))
    assert together([*rivals, plain]) == [rivals, [plain]]
    assert held(Stroke(id="s"), rivals) == (side, side.reasons[0])
    chosen = Stroke(id="s", meaning=COLOUR, through="lamp", through_slot=0)
    assert held(chosen, rivals) == (lamp, lamp.reasons[0])
    assert [r.score for _, r in worth_showing(rivals, side.reasons[0])] == [1, 2, 4, 5]
    assert [r.score for _, r in worth_showing(rivals, lamp.reasons[0])] == [1, 2, 4, 7]
    assert held(Stroke(id="s", through="gone"), rivals) == (side, side.reasons[0])


def test_cards_name_what_tells_them_apart() -> None:
    one = Finding("stool", 0, ("s",), (reason(COLOUR), reason(GLOSS)), rivals=True)
    other = Finding("seat", 0, ("s",), (reason(COLOUR),), rivals=True)
    scene = room()
    assert [short_name(scene, [one], one, r) for r in one.reasons] == ["colour", "gloss"]
    told = [short_name(scene, [one, other], f, r) for f in (one, other) for r in f.reasons]
    assert told == ["Stool", "Stool, gloss", place(scene, "seat").split(" · ")[-1]]


def test_strokes_without_an_explanation_say_what_that_means() -> None:
    told = {nothing_found(Stroke(id="s", tool=tool, indirect=far))
            for tool, far in ((FIXATE, False), (TOOLS[0], True), (TOOLS[0], False))}  # fmt: skip
    assert len(told) == 3


def stroke(places: np.ndarray) -> Stroke:
    count = len(places)
    zeros, ones = np.zeros((count, 3), np.float32), np.ones(count, np.float32)
    none = np.zeros(count, np.int64)
    marks = Marks(none, places.astype(np.float32), zeros, none, zeros, zeros, zeros, ones, zeros)
    return Stroke(id="s", objects=("stool",), table=marks.table())


@pytest.mark.parametrize("eye", [(0.0, 2.5, 7.0), (1.0, 9.0, 0.0), (1.0, -9.0, 1e-4)])
def test_small_pictures_see_the_stroke(eye: tuple[float, float, float]) -> None:
    places = np.array([[0.0, 0.5, 0.5], [0.2, 0.6, 0.5], [-0.2, 0.4, 0.5]])
    scene = Add((stroke(places),))(room())
    view = around(scene, "s", View(looking(eye, (0.0, 0.6, 0.0)), 40.0))
    assert view is not None
    assert view.transform.translation == pytest.approx(eye)
    seen = project(view, places + np.array([1.0, 0.0, 0.0]))
    assert (seen > 0.2).all()
    assert (seen < 0.8).all()


def test_without_marks_there_is_nothing_to_look_at() -> None:
    scene = Add((Stroke(id="s", objects=("stool",)),))(room())
    assert around(scene, "s", View()) is None
    assert around(scene, "gone", View()) is None
