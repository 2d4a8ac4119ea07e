"""Undo is exact: whatever was done, going back and forth shows the same bits again.

A state machine does edits of every kind, gestures, undo, redo, jumps, saving and reopening, against a model
that is a list of fingerprints.
"""

from __future__ import annotations

import contextlib
import gc
import shutil
import tempfile
import threading
import tracemalloc
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from random import Random

import numpy as np
import pytest
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, precondition, rule
from random_edits import random_edit
from scenes import fingerprint, little_scene

from studio_core import copies, edits
from studio_core.document import Document, Gesture, Step
from studio_core.errors import EditError
from studio_core.project.codec import scene_digest
from studio_core.project.records import History
from studio_core.project.store import load, save
from studio_core.scene.diff import Aspect, Changes, diff
from studio_core.scene.geometry import Geometry
from studio_core.scene.nodes import Group, Scene
from studio_core.scene.paint import Paint
from studio_core.scene.transform import Transform
from studio_core.strokes.marks import COLUMNS, WIDTH, Marks
from studio_core.strokes.stroke import Stroke

SEEDS = st.integers(0, 2**32)
UNLIMITED = 1 << 60


def move(x: float, node: str = "cube") -> edits.Move:
    return edits.Move({node: Transform((x, 0.5, 0.0))}, label=f"Move to {x}")


@dataclass(frozen=True)
class Failing:
    """Does half its work, then fails like a bug would."""

    label: str = "Fails"

    def __call__(self, scene: Scene) -> Scene:
        edits.Add((Group(id="half"),))(scene)
        raise ZeroDivisionError("a bug in an edit")


class UndoMachine(RuleBasedStateMachine):
    def __init__(self) -> None:
        super().__init__()
        self.serial = 0
        self.folder = Path(tempfile.mkdtemp(prefix="lucarne-undo-"))
        self.other = Document(little_scene())
        self.other.apply(move(3.0))
        self.other_print = fingerprint(self.other.scene)
        self.prints = [fingerprint(little_scene())]
        self.at = 0
        self.shown = self.prints[0]
        self.gesture: Gesture | None = None
        self.hold(Document(little_scene(), history_bytes=UNLIMITED))

    def hold(self, document: Document) -> None:
        self.document = document
        self.last_told = document.scene

        def told(before: Scene, after: Scene, changes: Changes) -> None:
            assert before is self.last_told
            assert after is self.document.scene
            assert changes == diff(before, after)
            self.last_told = after

        document.changed.connect(told)

    def outcome(self, edit: edits.Edit, scene: Scene) -> Scene | None:
        """What an edit gives, or None when it does not fit."""
        try:
            return edit(scene)
        except EditError:
            return None

    def some_edit(self, seed: int, scene: Scene) -> edits.Edit:
        self.serial += 1
        return random_edit(Random(seed), scene, self.serial)

    def pushed(self, print_: str) -> None:
        self.prints[self.at + 1 :] = [print_]
        self.at += 1

    @rule(seed=SEEDS)
    def edit(self, seed: int) -> None:
        before = self.document.scene
        edit = self.some_edit(seed, before)
        made = self.outcome(edit, before)
        if self.gesture is not None or made is None:
            with pytest.raises(EditError):
                self.document.apply(edit)
        else:
            self.document.apply(edit)
            if made is not before:
                self.shown = fingerprint(made)
                self.pushed(self.shown)
                assert self.document.history[-1].label == edit.label

    @precondition(lambda self: self.gesture is None)
    @rule()
    def a_bug_in_an_edit(self) -> None:
        with pytest.raises(ZeroDivisionError):
            self.document.apply(Failing())
        with pytest.raises(ZeroDivisionError), self.document.gesture("Drag") as gesture:
            gesture.apply(edits.Add((Group(id="whole"),)))
            gesture.apply(Failing())

    @rule()
    def press(self) -> None:
        if self.gesture is not None:
            with pytest.raises(EditError, match="already under way"):
                self.document.begin("Drag")
        else:
            self.gesture = self.document.begin("Drag")

    @precondition(lambda self: self.gesture is not None)
    @rule(seed=SEEDS, from_start=st.booleans())
    def drag(self, seed: int, from_start: bool) -> None:
        assert self.gesture is not None
        base = self.gesture.start if from_start else self.document.scene
        edit = self.some_edit(seed, base)
        made = self.outcome(edit, base)
        act = self.gesture.apply if from_start else self.gesture.add
        if made is None:
            with pytest.raises(EditError):
                act(edit)
        else:
            act(edit)
            self.shown = fingerprint(made)

    @precondition(lambda self: self.gesture is not None)
    @rule(escape=st.booleans())
    def release(self, escape: bool) -> None:
        assert self.gesture is not None
        moved = self.document.scene is not self.gesture.start
        if escape:
            self.document.cancel()
            self.shown = self.prints[self.at]
        else:
            self.document.commit()
            if moved:
                self.pushed(self.shown)
        over, self.gesture = self.gesture, None
        with pytest.raises(EditError, match="over"):
            over.apply(move(2.0))

    @precondition(lambda self: self.gesture is None)
    @rule(seeds=st.lists(SEEDS, max_size=4), fails=st.booleans())
    def group(self, seeds: list[int], fails: bool) -> None:
        """Edits and a gesture that nobody ends are one step; an error brings back what was."""
        before, steps = self.document.scene, self.document.history
        with contextlib.suppress(ZeroDivisionError), self.document.grouped("Group"):
            for seed in seeds:
                with contextlib.suppress(EditError):
                    self.document.apply(self.some_edit(seed, self.document.scene))
            with contextlib.suppress(EditError):
                self.document.begin("Left open").add(self.some_edit(0, self.document.scene))
            pushed = len({*map(id, self.document.history)} - {*map(id, steps)})
            pushed += self.document.scene is not self.document.history[self.document.position].scene
            if fails:
                raise ZeroDivisionError
        if fails:
            assert self.document.history == steps
        elif pushed:
            del self.prints[self.at + 1 :]
            if self.document.scene is not before:
                self.shown = fingerprint(self.document.scene)
                self.pushed(self.shown)
                assert pushed == 1 or self.document.history[-1].label == "Group"

    @rule(forward=st.booleans())
    def step(self, forward: bool) -> None:
        wanted = self.at + (1 if forward else -1)
        possible = self.gesture is None and 0 <= wanted < len(self.prints)
        assert (self.document.redo() if forward else self.document.undo()) is possible
        if possible:
            self.at, self.shown = wanted, self.prints[wanted]

    @rule(place=st.integers(-2, 60))
    def jump(self, place: int) -> None:
        possible = self.gesture is None and 0 <= place < len(self.prints)
        assert self.document.go_to(place) is possible
        if possible:
            self.at, self.shown = place, self.prints[place]

    @precondition(lambda self: self.gesture is None)
    @rule()
    def save_and_reopen(self) -> None:
        path = self.folder / "room.lucarne"
        document = self.document
        save(path, document.scene, history=History(document.history, document.position))
        loaded = load(path)
        assert loaded.history is not None
        assert fingerprint(loaded.scene) == self.shown
        assert scene_digest(loaded.scene) == scene_digest(document.scene)
        reopened = Document(history_bytes=UNLIMITED)
        reopened.restore(*loaded.history.opened())
        assert not reopened.modified
        self.hold(reopened)

    @invariant()
    def the_document_is_what_the_model_says(self) -> None:
        document = self.document
        assert fingerprint(document.scene) == self.shown
        assert self.last_told is document.scene
        assert document.position == self.at
        assert len(document.history) == len(self.prints)
        assert document.can_undo is (self.at > 0)
        assert document.can_redo is (self.at + 1 < len(self.prints))
        assert document.in_gesture is (self.gesture is not None)
        assert document.modified is (document.scene is not document.saved_scene)

    @invariant()
    def another_document_notices_nothing(self) -> None:
        assert fingerprint(self.other.scene) == self.other_print
        assert len(self.other.history) == 2

    def teardown(self) -> None:
        try:
            self.go_back_and_forth()
        finally:
            shutil.rmtree(self.folder)

    def go_back_and_forth(self) -> None:
        if self.gesture is not None:
            self.document.cancel()
        self.document.go_to(len(self.prints) - 1)
        walked = [fingerprint(self.document.scene)]
        while self.document.undo():
            walked.append(fingerprint(self.document.scene))
        assert walked[::-1] == self.prints
        while self.document.redo():
            pass
        assert fingerprint(self.document.scene) == self.prints[-1]


TestUndo = UndoMachine.TestCase
TestUndo.settings = settings(max_examples=100, stateful_step_count=100)


def test_ten_thousand_random_edits_are_undone_and_redone_bit_by_bit() -> None:
    rng = Random(20261101)
    document = Document(little_scene(), history_bytes=UNLIMITED)
    prints = {0: fingerprint(document.scene)}
    refused = 0
    for serial in range(10_000):
        before = document.scene
        edit = random_edit(rng, before, serial)
        try:
            document.apply(edit)
        except EditError:
            refused += 1
            assert document.scene is before
        if document.position % 50 == 0:
            prints[document.position] = fingerprint(document.scene)
    last = document.position
    prints[last] = fingerprint(document.scene)
    assert last > 6_500
    assert refused > 200
    while document.undo():
        if document.position in prints:
            assert fingerprint(document.scene) == prints[document.position]
    assert document.position == 0
    while document.redo():
        pass
    assert document.position == last
    assert fingerprint(document.scene) == prints[last]


@pytest.mark.parametrize(
    "make",
    [
        lambda i: move(float(i)),
        lambda i: edits.SetMaterial("paint", {"base_color": (i / 5000, 0.0, 0.0)}),
        lambda i: edits.Add((Group(id=f"g{i}"),)),
        lambda i: edits.Remove(("cube",)),
    ],
    ids=["move", "material", "add", "remove"],
)
def test_memory_is_flat_over_edits_with_undo(make: Callable[[int], edits.Edit]) -> None:
    document = Document(little_scene())

    def pairs(start: int, stop: int) -> None:
        for i in range(start, stop):
            document.apply(make(i))
            document.undo()

    pairs(0, 500)
    gc.collect()
    tracemalloc.start()
    try:
        pairs(500, 600)
        before = tracemalloc.get_traced_memory()[0]
        pairs(600, 5100)
        gc.collect()
        grown = tracemalloc.get_traced_memory()[0] - before
    finally:
        tracemalloc.stop()
    assert grown < 1024 * 4500 / 100  # a hundredth of what is promised
    assert len(document.history) == 2


# ---------------------------------------------------------------- examples


def test_undo_inside_a_group_is_undo() -> None:
    document = Document(little_scene())
    for x in (1.0, 2.0, 3.0):
        document.apply(move(x))
    with document.grouped("Group"):
        document.undo()
        document.undo()
    assert (document.position, len(document.history)) == (1, 4)
    with document.grouped("Group"):
        document.undo()
        document.apply(move(4.0))
        document.apply(move(5.0))
        document.apply(move(6.0))
        document.undo()
    assert [step.label for step in document.history] == ["Open", "Group", "Move to 6.0"]
    assert document.scene["cube"].transform.translation[0] == 5.0
    assert document.redo()
    with pytest.raises(ZeroDivisionError), document.grouped("Group"):
        document.go_to(0)
        document.apply(move(7.0))
        raise ZeroDivisionError
    assert [step.label for step in document.history] == ["Open", "Group", "Move to 6.0"]
    assert document.position == 2
    assert document.history_bytes() == sum(document._costs)


def test_a_group_that_changes_nothing_in_the_end_is_no_step() -> None:
    document = Document(little_scene())
    with document.grouped("Group"):
        document.apply(edits.Add((Group(id="a"),)))
        document.undo()
    assert len(document.history) == 2  # it can be done again
    with document.grouped("Group"):
        pass
    document.begin("Drag")
    with pytest.raises(EditError, match="finish the gesture"), document.grouped("Group"):
        pass


def test_a_gesture_is_one_step_from_the_press() -> None:
    document = Document(little_scene())
    told: list[Aspect] = []
    document.changed.connect(lambda before, after, changes: told.append(changes.aspects))
    with document.gesture("Drag") as gesture:
        for x in (1.0, 2.0):
            gesture.apply(move(x))
        gesture.apply(edits.Add((Group(id="ghost"),)))
        gesture.apply(move(3.0))
        gesture.add(edits.SetFields("cube", {"name": "Moved"}))
    assert [step.label for step in document.history] == ["Open", "Drag"]
    assert document.scene["cube"].transform.translation[0] == 3.0
    assert document.scene["cube"].name == "Moved"
    assert "ghost" not in document.scene.nodes
    both = Aspect.TRANSFORM | Aspect.STRUCTURE
    assert told == [Aspect.TRANSFORM, Aspect.TRANSFORM, both, both, Aspect.NAME]
    document.undo()
    assert told[-1] == Aspect.TRANSFORM | Aspect.NAME


def test_escape_within_a_gesture_ends_it() -> None:
    document = Document(little_scene())
    start = document.scene
    with document.gesture("Drag") as gesture:
        gesture.apply(move(1.0))
        document.cancel()
        assert document.scene is start
    assert len(document.history) == 1


def test_a_gesture_that_changes_nothing_leaves_no_step() -> None:
    document = Document(little_scene())
    with document.gesture("Click"):
        pass
    assert not document.can_undo


def test_an_edit_after_undo_forgets_what_was_undone() -> None:
    document = Document(little_scene())
    document.apply(move(1.0))
    document.apply(move(2.0))
    document.go_to(1)
    document.apply(move(3.0))
    assert [step.label for step in document.history] == ["Open", "Move to 1.0", "Move to 3.0"]
    assert not document.can_redo


def test_modified_follows_what_was_saved() -> None:
    document = Document(little_scene())
    assert not document.modified
    document.apply(move(1.0))
    assert document.modified
    document.mark_saved(document.scene)
    assert not document.modified
    document.undo()
    assert document.modified
    document.redo()
    assert not document.modified


def test_restoring_tells_once_and_is_not_a_modification() -> None:
    document = Document(little_scene())
    seen: list[bool] = []
    document.changed.connect(lambda *_: seen.append(document.modified))
    first, second = little_scene(), move(1.0)(little_scene())
    document.begin("Drag")
    document.restore((Step("Open", first), Step("Move", second)), 1)
    assert seen == [False]
    assert document.scene is second
    assert not document.in_gesture
    assert document.undo()
    assert document.scene is first
    with pytest.raises(EditError, match="does not hold that step"):
        document.restore((Step("Open", first),), 1)
    assert document.scene is first


def test_the_oldest_steps_go_when_the_history_is_full() -> None:
    def heavy(i: int) -> Geometry:
        return Geometry(np.full((25_000, 3), i, np.float32), np.zeros((1, 3), np.uint32))  # 300 kB

    document = Document(little_scene(), history_bytes=2_000_000)
    for i in range(20):
        document.apply(edits.SetGeometry("cube", heavy(i), label=f"Mesh {i}"))
        assert document.history_bytes() <= 2_000_000
        assert document.history[document.position].scene is document.scene
    assert [step.label for step in document.history][-5:] == [f"Mesh {i}" for i in range(15, 20)]
    assert 5 <= len(document.history) <= 8
    assert document.can_undo


def test_one_undo_stays_however_small_the_room() -> None:
    document = Document(little_scene(), history_bytes=0)
    for x in range(5):
        document.apply(move(float(x)))
    assert len(document.history) == 2
    assert document.undo()
    assert document.scene["cube"].transform.translation[0] == 3.0


def test_a_shared_mesh_costs_once() -> None:
    document = Document(little_scene())
    document.apply(move(0.0))
    bare = document.history_bytes()
    document.apply(copies.duplicate(document.scene, ("cube",)))
    assert document.history_bytes() - bare < 2000


def test_paint_and_strokes_cost_what_they_hold() -> None:
    at = np.zeros((1000, 3))
    paint = Paint.of(at, at + np.array([0, 1, 0]), np.zeros(1000), {"color": at}, at)
    numbers = np.zeros((1000, 1), np.float32)
    marks = Marks(*(np.broadcast_to(numbers, (1000, width)).squeeze() for width in COLUMNS))
    document = Document(little_scene())
    document.apply(edits.SetPaint("cube", paint))
    painted = document.history_bytes()
    assert painted > 1000 * (7 + 3 + 3) * 4
    document.apply(edits.Add((Stroke(id="stroke", objects=("cube",), table=marks.table()),)))
    assert document.history_bytes() - painted == pytest.approx(1000 * WIDTH * 4, abs=4000)


def test_a_receiver_that_fails_keeps_nobody_else_from_hearing() -> None:
    document = Document(little_scene())
    told: list[float] = []

    def fails(before: Scene, after: Scene, changes: Changes) -> None:
        raise ZeroDivisionError("a bug in a panel")

    document.changed.connect(fails)
    document.changed.connect(lambda _, after, __: told.append(after["cube"].transform.translation[0]))
    with pytest.raises(ZeroDivisionError):
        document.apply(move(1.0))
    assert told == [1.0]
    assert document.position == 1
    with pytest.raises(ZeroDivisionError):
        document.undo()
    assert told == [1.0, 0.0]
    assert document.can_redo


def test_edits_of_a_receiver_are_heard_in_order_by_all() -> None:
    document = Document(little_scene())
    told: list[tuple[Scene, Scene, Changes]] = []

    def follows(before: Scene, after: Scene, changes: Changes) -> None:
        if after["cube"].transform.translation[0] == 1.0:
            document.apply(edits.SetFields("cube", {"name": "Moved"}, label="Name"))
            assert document.scene["cube"].name == "Moved"

    document.changed.connect(follows)
    document.changed.connect(lambda *change: told.append(change))
    document.apply(move(1.0))
    assert [step.label for step in document.history] == ["Open", "Move to 1.0", "Name"]
    assert [changes.aspects for _, _, changes in told] == [Aspect.TRANSFORM, Aspect.NAME]
    assert told[0][1] is told[1][0]
    assert told[1][1] is document.scene


def test_a_restored_history_counts_against_the_cap() -> None:
    def heavy(i: int) -> Scene:
        mesh = Geometry(np.full((25_000, 3), i, np.float32), np.zeros((1, 3), np.uint32))  # 300 kB
        return edits.SetGeometry("cube", mesh)(little_scene())

    document = Document(history_bytes=2_000_000)
    document.restore(tuple(Step(str(i), heavy(i)) for i in range(20)), 19)
    assert len(document.history) == 20  # opening a project forgets nothing
    assert document.history_bytes() > 19 * 300_000
    document.apply(move(1.0))
    assert 5 <= len(document.history) <= 8
    assert document.history_bytes() <= 2_000_000


def test_another_thread_is_refused() -> None:
    document = Document(little_scene())
    gesture = document.begin("Drag")
    calls: list[Callable[[], object]] = [
        lambda: document.apply(move(1.0)),
        lambda: gesture.apply(move(1.0)),
        lambda: gesture.add(move(1.0)),
        document.undo,
        document.redo,
        lambda: document.go_to(0),
        lambda: document.begin("x"),
        document.commit,
        document.cancel,
        lambda: document.restore((Step("Open", Scene()),), 0),
    ]
    refused: list[str] = []

    def intrude() -> None:
        for call in calls:
            try:
                call()
            except RuntimeError as error:
                refused.append(str(error))

    thread = threading.Thread(target=intrude)
    thread.start()
    thread.join()
    assert refused == ["the document was touched from another thread"] * len(calls)
    assert document.scene is gesture.start
    assert document.in_gesture


def test_two_documents_do_not_interact() -> None:
    one, two = Document(little_scene()), Document(little_scene())
    told: list[str] = []
    one.changed.connect(lambda *_: told.append("one"))
    two.changed.connect(lambda *_: told.append("two"))
    two.begin("Drag")
    one.apply(move(1.0))
    assert told == ["one"]
    assert two.in_gesture
    assert not one.in_gesture
    assert fingerprint(two.scene) == fingerprint(little_scene())
