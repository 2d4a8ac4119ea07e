"""The document: the current scene, its history, and one signal.

Undo keeps the previous `Scene`; since versions share whatever did not change, that costs what the edit
made new. Used from one thread only, the one that made it.
"""

from __future__ import annotations

import itertools
import threading
from collections import deque
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

from studio_core.edits import Edit
from studio_core.errors import EditError
from studio_core.scene.diff import Changes, diff
from studio_core.scene.nodes import Scene
from studio_core.scene.paint import Paint
from studio_core.signal import Signal

_VALUE_BYTES = 600  # a node or material
_ENTRY_BYTES = 100  # its place in a scene's map


@dataclass(frozen=True)
class Step:
    """One entry of the history: what was done, and the scene it gave."""

    label: str
    scene: Scene


class Gesture:
    """Press…release as one undo entry: every `apply` starts again from the scene at the press."""

    def __init__(self, document: Document, label: str) -> None:
        self.label = label
        self.start = document.scene
        self._document = document

    def apply(self, edit: Edit) -> None:
        """Show the scene as it was at the press, changed by `edit`."""
        self._show(edit, self.start)

    def add(self, edit: Edit) -> None:
        """Change the scene as the gesture has left it."""
        self._show(edit, self._document.scene)

    def _show(self, edit: Edit, scene: Scene) -> None:
        self._document._assert_thread()
        if self._document._gesture is not self:
            raise EditError("the gesture is over")
        self._document._show(edit(scene))


class Document:
    """`changed(before, after, changes)` is emitted after every change, also undo and redo.

    A receiver may edit: that is done at once, and told when everybody has heard of what came before. A
    receiver's error is raised by whatever made the change, which is then done and was told to all others.
    """

    def __init__(self, scene: Scene | None = None, *, history_bytes: int = 256 << 20) -> None:
        self._thread = threading.get_ident()
        self._steps = [Step("Open", scene if scene is not None else Scene())]
        self._costs = [0]
        self._at = 0
        self._scene = self._steps[0].scene
        self._gesture: Gesture | None = None
        self._history_bytes = history_bytes
        self._untold: deque[tuple[Scene, Scene]] = deque()
        self._telling = False
        self.changed: Signal[[Scene, Scene, Changes]] = Signal()
        self.saved: Signal[[]] = Signal()
        self.saved_scene: Scene | None = self._scene

    @property
    def scene(self) -> Scene:
        """The scene as it is now."""
        return self._scene

    @property
    def history(self) -> tuple[Step, ...]:
        """Every step, the opening first."""
        return tuple(self._steps)

    @property
    def position(self) -> int:
        """Index in `history` of what is shown."""
        return self._at

    @property
    def modified(self) -> bool:
        """Whether the scene is another one than was last saved."""
        return self._scene is not self.saved_scene

    @property
    def can_undo(self) -> bool:
        """Whether there is a step before this one."""
        return self._at > 0

    @property
    def can_redo(self) -> bool:
        """Whether a step was undone."""
        return self._at + 1 < len(self._steps)

    def apply(self, edit: Edit) -> None:
        """Do an edit as one step. Raises what the edit raises, and then nothing has changed."""
        self._assert_thread()
        if self._gesture is not None:
            raise EditError("finish the gesture first")
        after = edit(self._scene)
        if after is not self._scene:
            self._push(Step(edit.label, after))
            self._show(after)

    @contextmanager
    def gesture(self, label: str) -> Iterator[Gesture]:
        """One undo entry for all that is applied inside; an exception rolls back."""
        gesture = self.begin(label)
        try:
            yield gesture
        except BaseException:
            self.cancel()
            raise
        self.commit()

    @contextmanager
    def grouped(self, label: str) -> Iterator[None]:
        """Whatever is done inside is one step of the history; an exception puts everything back as it was.

        Edits, gestures and undo work inside as they do outside. A single step keeps its own label.
        """
        self._assert_thread()
        if self._gesture is not None:
            raise EditError("finish the gesture first")
        steps, costs, at = list(self._steps), list(self._costs), self._at
        try:
            yield
            self.commit()
        except BaseException:
            self._gesture = None
            self._steps, self._costs, self._at = steps, costs, at
            self._show(steps[at].scene)
            raise
        self._join(label, {id(step) for step in steps})

    def _join(self, label: str, known: set[int]) -> None:
        """Make one step of those up to this one that are not `known`."""
        first = next((i for i, step in enumerate(self._steps) if id(step) not in known), len(self._steps))
        if first == 0 or first >= self._at:
            return
        before, joined = self._steps[first - 1].scene, Step(label, self._scene)
        same = self._scene is before
        self._steps[first : self._at + 1] = [] if same else [joined]
        self._costs[first : self._at + 1] = [] if same else [_cost(before, joined.scene)]
        self._at = first - 1 if same else first

    def begin(self, label: str) -> Gesture:
        """Start a gesture that spans events; `commit` or `cancel` ends it."""
        self._assert_thread()
        if self._gesture is not None:
            raise EditError("a gesture is already under way")
        self._gesture = Gesture(self, label)
        return self._gesture

    def commit(self) -> None:
        """End the gesture; nothing is kept in the history when it changed nothing."""
        self._assert_thread()
        gesture, self._gesture = self._gesture, None
        if gesture is not None and self._scene is not gesture.start:
            self._push(Step(gesture.label, self._scene))

    def cancel(self) -> None:
        """Roll the gesture back (Esc)."""
        self._assert_thread()
        gesture, self._gesture = self._gesture, None
        if gesture is not None:
            self._show(gesture.start)

    @property
    def in_gesture(self) -> bool:
        """Whether a gesture is under way."""
        return self._gesture is not None

    def undo(self) -> bool:
        """One step back; False when there is none or a gesture is under way."""
        return self.go_to(self._at - 1)

    def redo(self) -> bool:
        """One step forward again."""
        return self.go_to(self._at + 1)

    def go_to(self, position: int) -> bool:
        """Show any step of the history."""
        self._assert_thread()
        if self._gesture is not None or not 0 <= position < len(self._steps):
            return False
        self._at = position
        self._show(self._steps[position].scene)
        return True

    def restore(self, steps: tuple[Step, ...], position: int) -> None:
        """Take over a history that was read from a project file; none of it goes before the next edit."""
        self._assert_thread()
        if not 0 <= position < len(steps):
            raise EditError("the history does not hold that step")
        self._gesture = None
        costs = [_cost(before.scene, after.scene) for before, after in itertools.pairwise(steps)]
        self._steps, self._costs, self._at = list(steps), [0, *costs], position
        self.saved_scene = steps[position].scene
        self._show(self.saved_scene)

    def mark_saved(self, scene: Scene) -> None:
        """Remember what is in the file, and tell `saved()`."""
        self.saved_scene = scene
        self.saved.emit()

    def _show(self, after: Scene) -> None:
        before, self._scene = self._scene, after
        if before is not after:
            self._untold.append((before, after))
        if self._telling:
            return
        first: Exception | None = None
        self._telling = True
        try:
            while self._untold:
                before, after = self._untold.popleft()
                try:
                    self.changed.emit(before, after, diff(before, after))
                except Exception as error:
                    first = first or error
        finally:
            self._telling = False
        if first is not None:
            raise first

    def _push(self, step: Step) -> None:
        del self._steps[self._at + 1 :], self._costs[self._at + 1 :]
        self._costs.append(_cost(self._steps[-1].scene, step.scene))
        self._steps.append(step)
        self._at += 1
        total = sum(self._costs)
        while len(self._steps) > 2 and total > self._history_bytes:
            total -= self._costs[0]
            del self._steps[0], self._costs[0]
            self._at -= 1

    def history_bytes(self) -> int:
        """Bytes that the steps added, each beyond the one before it."""
        return sum(self._costs)

    def _assert_thread(self) -> None:
        if threading.get_ident() != self._thread:
            raise RuntimeError("the document was touched from another thread")


def _cost(before: Scene, after: Scene) -> int:
    """Bytes that `after` adds to `before`."""
    there = _parts(before)
    new = sum(size for part, size in _parts(after).items() if part not in there)
    return new + _ENTRY_BYTES * len(after.nodes)


def _parts(scene: Scene) -> dict[int, int]:
    found = {id(thing): _VALUE_BYTES for thing in (*scene.nodes.values(), *scene.materials.values())}
    for node in scene.nodes.values():
        heavy = [getattr(node, name, None) for name in ("geometry", "image", "table")]
        paint: Paint | None = getattr(node, "paint", None)
        heavy += paint.tables if paint is not None else ()
        found |= {id(thing): thing.nbytes for thing in heavy if thing is not None}
    for material in scene.materials.values():
        found |= {id(t.image): t.image.nbytes for t in material.textures.values()}
        found |= {id(table): table.nbytes for table in material.tables.values()}
    return found
