"""A gesture that edits, from its start to its end: by mouse, by axis keys, by what is typed."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable

from studio_core.copies import duplicate
from studio_core.scene.nodes import NodeId
from studio_core.session import Session
from studio_ui.canvas.drags import CopyDrag, Drag, Hold
from studio_ui.canvas.gizmos import NAMES, Frame, Gizmo, Handle, Kind
from studio_ui.canvas.moving import MoveDrag
from studio_ui.canvas.overlay import Label, Overlay
from studio_ui.canvas.turning import SizeDrag, TurnDrag
from studio_ui.canvas.typed import LETTERS, STARTS, Typed
from studio_ui.canvas.viewport import Pointer
from studio_ui.editing import Editing

AXES = {"x": 0, "y": 1, "z": 2}
"""Keys that keep a gesture to an axis; with Shift they leave that axis out."""
_CARET = "▏"
_AT = (16.0, 16.0)  # logical pixels from the gizmo to its words


class Holding:
    """At most one gesture at a time. `keyed` ones go on without a button until a click or Enter ends them."""

    def __init__(self, editing: Editing, session: Session, hint: Callable[[str], None]) -> None:
        self.handle: Handle | None = None
        """What is held; None: the thing itself."""
        self.keyed = False
        self._editing, self._session, self._hint = editing, session, hint
        self._drag: Drag | None = None
        self._hold: Hold | None = None
        self._tool = ""
        self._pointer: Pointer | None = None
        self._typed: Typed | None = None
        self._chosen: tuple[NodeId, ...] = ()  # before copies were made
        self._off = editing.settled.connect(self._settled)

    def close(self) -> None:
        """Stop listening."""
        self._off()

    @property
    def active(self) -> bool:
        """Whether something is held."""
        return self._drag is not None

    @property
    def frame(self) -> Frame | None:
        """Where the gizmo stands meanwhile."""
        return self._drag.frame if self._drag is not None else None

    def start(self, tool: str, hold: Hold, handle: Handle | None, *, keyed: bool = False) -> bool:
        """Take hold of things with a tool (`move`, `rotate`, `scale`); False while they cannot be."""
        drag = _drag(tool, hold, handle)
        if not self.take(drag):
            return False
        self._tool, self._hold, self.handle, self.keyed = tool, hold, handle, keyed
        if keyed:
            self.move(hold.press)
        return True

    def take(self, drag: Drag) -> bool:
        """Begin any other gesture."""
        if self.active or not self._editing.begin(self, drag.label):
            return False
        self._drag, self._hold, self._typed = drag, None, None
        self.handle, self.keyed, self._pointer = None, False, None
        self._chosen = self._session.selection
        return True

    def move(self, pointer: Pointer) -> None:
        """The mouse is there now."""
        self._pointer = pointer
        if self._drag is None:
            return
        edit = self._drag.edit(pointer)
        self._editing.preview(self, edit)
        self._editing.rename(self, self._drag.label)
        if isinstance(self._drag, CopyDrag):
            self._session.select(self._drag.copies)

    def key(self, name: str) -> bool:
        """A key was pressed; whether it means something here."""
        drag = self._drag
        if drag is None:
            return False
        if name == "escape":
            self.cancel()
        elif name == "enter":
            self._enter()
        elif name in AXES or name.removeprefix("shift+") in AXES:
            self._keep_to(name)
        elif drag.unit is not None and (self._typed is not None or name in STARTS):
            self._type(drag, name)
        else:
            return False
        return True

    def wants(self, name: str) -> bool:
        """Whether a key comes before all shortcuts: every plain one, while something is held."""
        return self.active and name != ""

    def commit(self) -> None:
        """Leave things where they are now."""
        if self._drag is not None:
            self._editing.commit(self)

    def cancel(self) -> None:
        """Put everything back."""
        if self._drag is not None:
            copied = isinstance(self._drag, CopyDrag)
            self._editing.cancel(self)
            if copied:
                self._session.select(self._chosen)

    def marks(self, gizmo: Gizmo | None) -> Overlay:
        """The handle that is held, lines, and words beside it."""
        drag = self._drag
        if drag is None:
            return Overlay()
        made = drag.marks()
        if gizmo is not None and self.handle is not None:
            made += gizmo.marks(only=self.handle)
        if drag.frame is not None:
            colour = "problem" if self._typed is not None and self._typed.problem else "line"
            made += Overlay((Label(drag.frame.pivot, self._words(drag), colour, _AT),))
        return made

    def _words(self, drag: Drag) -> str:
        if self._typed is None:
            return drag.told()
        axis = self.handle.axis if self.handle is not None and self.handle.kind != "plane" else -1
        return f"{NAMES[axis]} {self._typed.text}{_CARET}" if axis >= 0 else f"{self._typed.text}{_CARET}"

    def _enter(self) -> None:
        if self._typed is not None and self._typed.problem:
            self._hint(self._typed.problem)
            return
        self.commit()

    def _type(self, drag: Drag, name: str) -> None:
        if self._typed is None:
            lengths = self._hold.words.unit if self._hold is not None and drag.unit == "m" else None
            self._typed = Typed(drag.unit or "", lengths)
        if name in LETTERS or name == "backspace":
            self._typed.take(name)
        if not self._typed.text:
            self._typed = None
            drag.type(None)
        elif self._typed.amount is not None:
            drag.type(self._typed.amount)
        if self._pointer is not None:
            self.move(self._pointer)

    def _keep_to(self, name: str) -> None:
        """Go on along one axis, or without one; the same key again gives the hand all of them."""
        if self._hold is None or self._pointer is None or self._tool == "scale":
            return
        axis = AXES[name.removeprefix("shift+")]
        kind: Kind = "plane" if name.startswith("shift+") else "axis"
        kind = "ring" if self._tool == "rotate" else kind
        made = Handle(kind, axis)
        handle = None if made == self.handle and not self.keyed else made
        typed = self._typed.amount if self._typed is not None else None
        copies = self._drag if isinstance(self._drag, CopyDrag) else None
        drag = _drag(self._tool, self._hold, handle, copies)
        self._drag, self.handle = drag, handle
        if typed is not None:
            drag.edit(self._pointer)
            drag.type(typed)
        self.move(self._pointer)

    def _settled(self) -> None:
        """The gesture has ended, by whatever."""
        self._drag = self._hold = self._typed = self._pointer = self.handle = None
        self.keyed = False


def _drag(tool: str, hold: Hold, handle: Handle | None, copies: CopyDrag | None = None) -> Drag:
    if not hold.copies:
        return _plain(tool, hold, handle)
    add = copies.add if copies is not None else duplicate(hold.scene, hold.nodes)
    scene = add(hold.scene)
    fresh = {node.id for node in add.nodes}
    made = tuple(node.id for node in add.nodes if node.parent not in fresh)
    inner = _plain(tool, dataclasses.replace(hold, scene=scene, nodes=made), handle)
    return CopyDrag(add, made, inner)


def _plain(tool: str, hold: Hold, handle: Handle | None) -> Drag:
    if tool == "rotate":
        return TurnDrag(hold, handle)
    if tool == "scale":
        return SizeDrag(hold, handle)
    return MoveDrag(hold, handle)
