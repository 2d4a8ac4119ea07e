"""What the mouse does in the picture: choose, look around, move, turn.

A click chooses. A drag on what is chosen moves it (or turns it, with the turn tool or R held); any other left
drag looks around, so that furniture is not moved by accident.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from studio_core.document import Document
from studio_core.scene.arranging import is_locked, roots
from studio_core.scene.diff import Changes
from studio_core.scene.nodes import Environment, NodeId, Scene
from studio_core.session import Session
from studio_core.signal import Signal
from studio_ui.canvas.drags import Drag, LightDrag, MoveDrag, TurnDrag
from studio_ui.canvas.glyphs import glyphs
from studio_ui.canvas.looking import Looking
from studio_ui.canvas.projection import bounds, box_segments
from studio_ui.canvas.viewport import Pointer, Viewport
from studio_ui.editing import Editing
from studio_ui.feed import PictureFeed

CLICK = 4.0  # logical pixels that a click may slip
TOOLS = ("select", "move", "rotate")


class CanvasTools:
    """Sits between a viewport, the session and the document."""

    def __init__(
        self,
        viewport: Viewport,
        document: Document,
        session: Session,
        editing: Editing,
        feed: PictureFeed,
        hint: Callable[[str], None] = lambda text: None,
    ) -> None:
        self.tool = "move"
        self.tool_changed: Signal[[str]] = Signal()
        self.entered: NodeId | None = None  # the group whose parts are chosen
        self._viewport, self._document, self._session = viewport, document, session
        self.looking = Looking(viewport, document, session, feed)
        self._editing, self._hint = editing, hint
        self._press: Pointer | None = None
        self._mode = ""  # "", click, look, drag
        self._drag: Drag | None = None
        self._turning = False  # R is held
        self._off = [
            viewport.pointer.connect(self._on_pointer),
            viewport.wheel.connect(self._on_wheel),
            viewport.key.connect(self._on_key),
            document.changed.connect(self._on_document),
            session.changed.connect(lambda _: self.refresh()),
            session.selected.connect(self.refresh),
        ]

    def close(self) -> None:
        """Stop listening."""
        self.looking.close()
        for off in self._off:
            off()

    def use(self, tool: str) -> None:
        """Choose a tool of `TOOLS`."""
        if tool != self.tool:
            self.tool = tool
            self.tool_changed.emit(tool)

    def refresh(self) -> None:
        """Outline and lines as scene, selection and view are now."""
        scene, view = self._document.scene, self._session.view
        chosen = [n for n in self._session.selection if n in scene.nodes]
        self._viewport.set_selection(below for node in chosen for below in scene.subtree(node))
        boxes = None
        found = bounds(scene, chosen) if self._mode in ("drag", "look") and chosen else None
        if found is not None:
            boxes = box_segments(*found)
        self._viewport.set_guides(view, glyphs(scene, view, chosen), boxes)

    def pick(self, pointer: Pointer, deep: bool = False) -> NodeId | None:
        """What a click there means: the topmost group of what is seen, or a part of the entered one."""
        scene = self._document.scene
        glyph = self._viewport.glyph_at(pointer.x, pointer.y)
        probe = self._viewport.probe(pointer.x, pointer.y)
        node = glyph if glyph is not None else probe.node if probe is not None else None
        if node is None or node not in scene.nodes or is_locked(scene, node):
            return None
        return node if deep else owner(scene, node, self.entered)

    def cancel(self) -> bool:
        """Esc: roll a gesture back, else leave the entered group, else choose nothing."""
        if self._mode == "drag":
            self._mode, self._drag = "", None
            self._editing.cancel(self)
            self.refresh()
            return True
        if self._editing.cancel_any():
            return True
        if self.entered is not None:
            entered, self.entered = self.entered, None
            self._session.select([entered] if entered in self._document.scene.nodes else [])
            return True
        self._session.select([])
        return False

    # events

    def _on_pointer(self, pointer: Pointer) -> None:
        if pointer.kind == "press":
            self._pressed(pointer)
        elif pointer.kind == "double":
            self._pressed(pointer)
            self._enter(pointer)
        elif pointer.kind == "move" and self._press is not None:
            self._moved(pointer)
        elif pointer.kind == "release" and self._press is not None:
            self._released(pointer)

    def _pressed(self, pointer: Pointer) -> None:
        self._press = pointer
        self._mode = "click"

    def _enter(self, pointer: Pointer) -> None:
        scene = self._document.scene
        node = self.pick(pointer, deep=True)
        if node is None:
            return
        above = [n.id for n in scene.ancestors(node)]
        inside = above.index(self.entered) if self.entered in above else len(above)
        self.entered = above[inside - 1] if inside > 0 and above else None
        self._session.select([owner(scene, node, self.entered)])
        self._mode = ""
        if self.entered is not None:
            self._hint(f"Parts of {scene[self.entered].name} can be chosen; Esc leaves it")

    def _moved(self, pointer: Pointer) -> None:
        assert self._press is not None
        if self._mode == "click" and _slip(self._press, pointer) > CLICK:
            self._start(self._press)
        if self._mode == "look":
            self.looking.move(pointer)
        elif self._mode == "drag" and self._drag is not None:
            self._editing.preview(self, self._drag.edit(pointer))

    def _start(self, press: Pointer) -> None:
        """A click has become a drag."""
        self._drag = self._drag_for(press, self._document.scene)
        looks = self.looking.mode_of(press)
        if self._drag is None and looks is not None:
            self._mode = "look"
            self.looking.start(looks, press)
        elif self._drag is None:
            self._mode = ""
            return
        elif self._editing.begin(self, self._drag.label):
            self._mode = "drag"  # the window holds for every gesture that edits
        else:
            self._mode, self._drag = "", None
            return
        self.refresh()

    def _drag_for(self, press: Pointer, scene: Scene) -> Drag | None:
        if self.looking.turns_light(press):
            environment = next((e for e in scene.of(Environment) if scene.shown(e.id)), None)
            return LightDrag(environment, press) if environment is not None else None
        if press.button != "left" or press.alt or (self.tool == "select" and not self._turning):
            return None
        picked = self.pick(press)
        if picked is None or not _held(scene, picked, self._session.selection):
            return None
        nodes = roots(scene, self._session.selection)
        if not nodes:
            return None
        if self.tool == "rotate" or self._turning:
            return TurnDrag(scene, nodes, press)
        point = self.looking.touched(press.x, press.y)
        if point is None or self._viewport.glyph_at(press.x, press.y) is not None:
            point = np.array(scene.world(picked).translation)
        return MoveDrag(scene, nodes, self._session.view, point)

    def _released(self, pointer: Pointer) -> None:
        mode, self._mode = self._mode, ""
        press, self._press = self._press, None
        self._drag = None
        if mode == "click" and press is not None and press.button == "left":
            self._click(pointer)
        elif mode == "drag":
            self._editing.commit(self)
        elif mode == "look":
            self.looking.end()
        self.refresh()

    def _click(self, pointer: Pointer) -> None:
        picked = self.pick(pointer)
        chosen = self._session.selection
        if pointer.ctrl or pointer.shift:
            if picked is not None:
                rest = [n for n in chosen if n != picked]
                self._session.select(rest if picked in chosen else [*chosen, picked])
            return
        if self.entered is not None and picked is None:
            self.entered = None
        self._session.select([picked] if picked is not None else [])

    def _on_wheel(self, pointer: Pointer, steps: float) -> None:
        if self._mode != "drag":
            self.looking.wheel(pointer, steps)

    def _on_key(self, key: str, pressed: bool) -> None:
        if key == "escape" and pressed:
            self.cancel()
        elif key == "r":
            self._turning = pressed

    def _on_document(self, before: Scene, after: Scene, changes: Changes) -> None:
        if self.entered is not None and self.entered not in after.nodes:
            self.entered = None
        self.refresh()


def owner(scene: Scene, node: NodeId, entered: NodeId | None) -> NodeId:
    """The topmost group that holds a node; inside an entered group the part of it that holds the node."""
    chain = [node, *(above.id for above in scene.ancestors(node))]
    if entered in chain:
        index = chain.index(entered)
        return chain[index - 1] if index > 0 else node
    return chain[-1]


def _held(scene: Scene, picked: NodeId, selection: tuple[NodeId, ...]) -> bool:
    """Whether what was picked is, or hangs under, or holds something chosen."""
    chain = {picked, *(above.id for above in scene.ancestors(picked))}
    if chain & set(selection):
        return True
    return any(picked in {a.id for a in scene.ancestors(n)} for n in selection if n in scene.nodes)


def _slip(a: Pointer, b: Pointer) -> float:
    return float(np.hypot((a.x - b.x) * a.pixels[0], (a.y - b.y) * a.pixels[1]))
