"""What the mouse does in the picture: choose, look around, move, turn, scale.

A click chooses; a drag of a gizmo's handle, or of what is chosen, edits it; with the select tool a drag
draws a band around what is to be chosen. Every other drag looks around, so that furniture is not moved by
accident.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

import numpy as np
from PySide6.QtCore import Qt

from studio_core.document import Document
from studio_core.scene.arranging import roots
from studio_core.scene.diff import Changes
from studio_core.scene.nodes import Environment, NodeId, Scene
from studio_core.scene.room import Room
from studio_core.session import Session
from studio_core.signal import Signal
from studio_ui.canvas.drags import Hold, LightDrag, Words, called
from studio_ui.canvas.gizmos import CLOSE, REACH, Frame, Gizmo, Handle, Kind, meaning
from studio_ui.canvas.glyphs import glyphs
from studio_ui.canvas.holding import AXES, Holding
from studio_ui.canvas.looking import Looking
from studio_ui.canvas.overlay import Band, Overlay
from studio_ui.canvas.projection import bounds, box_segments
from studio_ui.canvas.selecting import Selecting
from studio_ui.canvas.viewport import Pointer, Viewport
from studio_ui.editing import Editing
from studio_ui.feed import PictureFeed
from studio_ui.forms.number_style import number_style
from studio_ui.objects.magnet import Magnet

CLICK = 4.0  # logical pixels that a click may slip
GIZMOS = ("move", "rotate", "scale")
TOOLS = ("select", *GIZMOS, "stroke")


class CanvasTool(Protocol):
    """A tool of its own: it takes what it wants of the hand, the rest is as with the others."""

    def pointer(self, pointer: Pointer) -> bool:
        """The mouse did something; whether that was for this tool."""
        ...

    def wheel(self, pointer: Pointer, steps: float) -> bool:
        """The wheel was turned; whether that was for this tool."""
        ...

    def marks(self) -> Overlay:
        """What lies over the picture while it is used."""
        ...

    def leave(self) -> None:
        """The mouse has left the picture, or another tool is used."""
        ...


class CanvasTools:
    """Sits between a viewport, the session and the document. `own` are tools of their own, by name."""

    def __init__(
        self,
        viewport: Viewport,
        document: Document,
        session: Session,
        editing: Editing,
        feed: PictureFeed,
        magnet: Magnet,
        hint: Callable[[str], None] = lambda text: None,
    ) -> None:
        self.tool = "move"
        self.own: dict[str, CanvasTool] = {}
        self.tool_changed: Signal[[str]] = Signal()
        self.looking = Looking(viewport, document, session, feed)
        self.holding = Holding(editing, session, hint)
        self.selecting = Selecting(viewport, document, session, hint)
        self._viewport, self._document, self._session = viewport, document, session
        self._editing, self._magnet, self._hint = editing, magnet, hint
        self._press: Pointer | None = None
        self._last = Pointer("move", 0.5, 0.5)
        self._mode = ""  # "", click, look, hold, band
        self._lit: Handle | None = None  # under the mouse, or pressed
        self._banding = False  # the next drag draws a band
        self._shape = Qt.CursorShape.ArrowCursor
        self._placed: tuple[object, Frame | None] | None = None
        viewport.want_keys(self._wants)
        self._off = [
            viewport.pointer.connect(self._on_pointer),
            viewport.wheel.connect(self._on_wheel),
            viewport.key.connect(self._on_key),
            viewport.left.connect(self._on_left),
            document.changed.connect(self._on_document),
            session.changed.connect(lambda _: self.refresh()),
            session.selected.connect(self.refresh),
            editing.settled.connect(self._on_settled),
            magnet.changed.connect(self.refresh),
        ]

    def close(self) -> None:
        """Stop listening."""
        self.looking.close()
        self.holding.close()
        for off in self._off:
            off()

    def use(self, tool: str) -> None:
        """Choose a tool of `TOOLS`."""
        if tool != self.tool:
            if self._other is not None:
                self._other.leave()
            self.tool = tool
            self._lit = None
            self.tool_changed.emit(tool)
            self.refresh()

    @property
    def _other(self) -> CanvasTool | None:
        """The tool in use, if it is one of its own."""
        return self.own.get(self.tool)

    def band(self) -> None:
        """The next drag chooses what lies in a rectangle, whatever the tool."""
        self._banding = True
        self._hint("Drag to the right around what is to be chosen; to the left: whatever is touched")

    def refresh(self) -> None:
        """Outline, lines and gizmo as scene, selection and view are now."""
        scene, view = self._document.scene, self._session.view
        chosen = [n for n in self._session.selection if n in scene.nodes]
        self._viewport.set_selection(below for node in chosen for below in scene.subtree(node))
        boxes = None
        found = bounds(scene, chosen) if self._mode in ("hold", "look") and chosen else None
        if found is not None:
            boxes = box_segments(*found)
        self._viewport.set_guides(view, glyphs(scene, view, chosen), boxes, self._overlay())
        grabs = self._lit is not None or self.holding.active
        shape = Qt.CursorShape.CrossCursor if self._other is not None else Qt.CursorShape.ArrowCursor
        shape = Qt.CursorShape.PointingHandCursor if grabs else shape
        if shape is not self._shape:
            self._shape = shape
            self._viewport.widget.setCursor(shape)

    def gizmo(self) -> Gizmo | None:
        """The handles of the tool in use, on what is chosen."""
        frame = self.holding.frame or self._frame()
        if self.tool not in GIZMOS or frame is None:
            return None
        return Gizmo(self.tool, frame, self._session.view, self._size())

    def cancel(self) -> bool:
        """Esc: put back what is held or looked at, drop the band, leave the group, or choose nothing."""
        if self.holding.active:
            self.holding.cancel()
            return True
        if self._mode == "look":
            self._mode = ""
            self.looking.cancel()
            self.refresh()
            return True
        if self._editing.cancel_any():
            return True
        if self.looking.walking.active:
            self.looking.walking.stop()
            return True
        if self._mode == "band" or self._banding:
            self._mode, self._banding = "", False
            self.refresh()
            return True
        if self.selecting.leave():
            return True
        self._session.select([])
        return False

    # events

    def _on_pointer(self, pointer: Pointer) -> None:
        self._last = pointer
        other = self._other if self._press is None and not self._banding else None
        if self.holding.keyed:
            self._follow_without_button(pointer)
        elif other is not None and other.pointer(pointer):
            self.refresh()
        elif pointer.kind == "press":
            self._pressed(pointer)
        elif pointer.kind == "double":
            self._pressed(pointer)
            if self._lit is None and self.selecting.enter(pointer):
                self._mode = ""
        elif pointer.kind == "move" and self._press is not None:
            self._moved(pointer)
        elif pointer.kind == "move":
            self._light(pointer)
        elif pointer.kind == "release" and self._press is not None:
            self._released(pointer)

    def _follow_without_button(self, pointer: Pointer) -> None:
        if pointer.kind == "move":
            self.holding.move(pointer)
        elif pointer.kind == "press" and pointer.button == "right":
            self.holding.cancel()
        elif pointer.kind == "press":
            self.holding.commit()

    def _pressed(self, pointer: Pointer) -> None:
        self._press, self._mode = pointer, "click"
        plain = pointer.button == "left" and not self._banding
        self._lit = self._handle_at(pointer) if plain else None

    def _handle_at(self, pointer: Pointer) -> Handle | None:
        gizmo = self.gizmo()
        if gizmo is None:
            return None
        over = self.selecting.held(pointer) is not None
        return gizmo.pick(pointer.x, pointer.y, CLOSE if over else REACH)

    def _light(self, pointer: Pointer) -> None:
        """The handle under the mouse."""
        lit = self._handle_at(pointer)
        if lit != self._lit:
            self._lit = lit
            if lit is not None:
                self._hint(meaning(lit, self._magnet.local_axes))
            self.refresh()

    def _moved(self, pointer: Pointer) -> None:
        assert self._press is not None
        if self._mode == "click" and _slip(self._press, pointer) > CLICK:
            self._start(self._press)
        if self._mode == "look":
            self.looking.move(pointer)
        elif self._mode == "hold":
            self.holding.move(pointer)
        elif self._mode == "band":
            self.refresh()

    def _start(self, press: Pointer) -> None:
        """A click has become a drag."""
        looks = self.looking.mode_of(press)
        if self._take(press):
            self._mode = "hold"  # the window holds for every gesture that edits
        elif self._editing.busy:
            self._mode = ""
        elif press.button == "left" and not press.alt and (self._bands() or looks is None):
            self._mode = "band"
        elif looks is not None:
            self._mode = "look"
            self.looking.start(looks, press)
        else:
            self._mode = ""
        self.refresh()

    def _bands(self) -> bool:
        return self._banding or self.tool == "select"

    def _take(self, press: Pointer) -> bool:
        """Take hold of what was pressed, if that is meant."""
        scene = self._document.scene
        if self.looking.turns_light(press):
            environment = next((e for e in scene.of(Environment) if scene.shown(e.id)), None)
            return environment is not None and self.holding.take(LightDrag(environment, press))
        if press.button != "left" or self._bands():
            return False
        if self._lit is None:
            picked = self.selecting.held(press)
            if picked is None or isinstance(scene[picked], Room):  # is all around: by its arrows only
                return False
            point = self.looking.touched(press.x, press.y)
            if point is None or self._viewport.glyph_at(press.x, press.y) is not None:
                point = np.array(scene.world(picked).translation)
        else:
            point = None
        hold = self._hold(press, point)
        return hold is not None and self.holding.start(self.tool, hold, self._lit)

    def _hold(self, press: Pointer, point: np.ndarray | None = None) -> Hold | None:
        scene, frame = self._document.scene, self._frame()
        nodes = roots(scene, self._session.selection)
        if frame is None or not nodes:
            return None
        style = number_style(self._viewport.widget)
        return Hold(
            scene,
            nodes,
            self._session.view,
            frame,
            press,
            frame.pivot if point is None else point,
            self._magnet.snap,
            press.alt,
            not self._magnet.local_axes,
            called(scene, nodes),
            Words(style.length, style.decimal_mark),
        )

    def _released(self, pointer: Pointer) -> None:
        mode, self._mode = self._mode, ""
        press, self._press = self._press, None
        if mode == "click" and press is not None and press.button == "left" and self._lit is None:
            self.selecting.click(pointer)
        elif mode == "hold":
            self.holding.commit()
        elif mode == "look":
            self.looking.end()
        elif mode == "band" and press is not None:
            self.selecting.catch(press, pointer)
        self._banding = False
        self.refresh()

    def _on_wheel(self, pointer: Pointer, steps: float) -> None:
        if self._other is not None and self._other.wheel(pointer, steps):
            self.refresh()
        elif not self.holding.active:
            self.looking.wheel(pointer, steps)

    def _on_left(self) -> None:
        if self._other is not None:
            self._other.leave()
            self.refresh()
        if self._lit is not None and self._press is None:
            self._lit = None
            self.refresh()

    def _wants(self, key: str) -> bool:
        return self.holding.wants(key) or self.looking.walking.wants(key)

    def _on_key(self, key: str, pressed: bool) -> None:
        if key == "focus":  # the hand has gone elsewhere
            self.looking.walking.stand()
            if self.holding.keyed:
                self.holding.commit()
        if self.looking.walking.key(key, pressed) or not pressed:
            return
        if self.holding.key(key):
            self.refresh()
        elif key == "escape":
            self.cancel()
        elif key.removeprefix("shift+") in AXES and self._press is None:
            self._key_axis(key)

    def _key_axis(self, key: str) -> None:
        """An axis key: from now on the mouse, or what is typed, moves what is chosen along it."""
        hold = self._hold(self._last) if self.tool in GIZMOS else None
        if hold is None:
            return
        kinds: dict[str, Kind] = {"move": "axis", "rotate": "ring", "scale": "size"}
        kind = "plane" if key.startswith("shift+") and self.tool == "move" else kinds[self.tool]
        handle = Handle(kind, AXES[key.removeprefix("shift+")])
        if self.holding.start(self.tool, hold, handle, keyed=True):
            self._hint("Move the mouse or type an amount; a click or Enter keeps it, Esc does not")

    def _on_settled(self) -> None:
        """What was held is held no more, by whatever."""
        if self._mode == "hold":
            self._mode = ""
        self._lit = None
        self.refresh()

    def _on_document(self, before: Scene, after: Scene, changes: Changes) -> None:
        self.selecting.follow(after)
        self.refresh()

    # what lies over the picture

    def _overlay(self) -> Overlay:
        if self._mode == "band" and self._press is not None:
            start, end = (self._press.x, self._press.y), (self._last.x, self._last.y)
            return Overlay((Band(start, end, whole=end[0] >= start[0]),))
        if self._other is not None:
            return self._other.marks()
        gizmo = self.gizmo()
        if self.holding.active:
            return self.holding.marks(gizmo)
        return gizmo.marks(self._lit) if gizmo is not None else Overlay()

    def _frame(self) -> Frame | None:
        """Where the gizmo stands; asked for often, made anew for another scene or selection."""
        scene, selection = self._document.scene, self._session.selection
        key = (scene, selection, self._magnet.local_axes)
        if self._placed is None or not _same(self._placed[0], key):
            nodes = roots(scene, selection)
            self._placed = key, Frame.of(scene, nodes, local=key[2]) if nodes else None
        return self._placed[1]

    def _size(self) -> tuple[float, float]:
        widget = self._viewport.widget
        return float(max(widget.width(), 1)), float(max(widget.height(), 1))


def _same(known: object, key: tuple[Scene, tuple[NodeId, ...], bool]) -> bool:
    assert isinstance(known, tuple)
    return known[0] is key[0] and known[1:] == key[1:]


def _slip(a: Pointer, b: Pointer) -> float:
    return float(np.hypot((a.x - b.x) * a.pixels[0], (a.y - b.y) * a.pixels[1]))
