"""Choosing in the picture: by clicks, by a band, by going into groups and out of them."""

from __future__ import annotations

from collections.abc import Callable

from studio_core.document import Document
from studio_core.scene.arranging import is_locked
from studio_core.scene.nodes import NodeId, Scene
from studio_core.session import Session
from studio_ui.canvas.picking import caught, is_held, joined, owner
from studio_ui.canvas.viewport import Pointer, Viewport


class Selecting:
    """Reads the viewport, writes the session. `entered` is the group whose parts are chosen."""

    def __init__(
        self, viewport: Viewport, document: Document, session: Session, hint: Callable[[str], None]
    ) -> None:
        self.entered: NodeId | None = None
        self._viewport, self._document, self._session, self._hint = viewport, document, session, hint

    @property
    def _scene(self) -> Scene:
        return self._document.scene

    def pick(self, pointer: Pointer, deep: bool = False) -> NodeId | None:
        """What a click there means: the topmost group of what is seen, or a part of the entered one."""
        glyph = self._viewport.glyph_at(pointer.x, pointer.y)
        probe = self._viewport.probe(pointer.x, pointer.y)
        node = glyph if glyph is not None else probe.node if probe is not None else None
        if node is None or node not in self._scene.nodes or is_locked(self._scene, node):
            return None
        return node if deep else owner(self._scene, node, self.entered)

    def held(self, pointer: Pointer) -> NodeId | None:
        """What is there, if it is chosen."""
        picked = self.pick(pointer)
        held = picked is not None and is_held(self._scene, picked, self._session.selection)
        return picked if held else None

    def click(self, pointer: Pointer) -> None:
        """Choose what is there; with Ctrl or Shift beside what is chosen, or no more."""
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

    def enter(self, pointer: Pointer) -> bool:
        """Go one group further in; whether there is something."""
        scene = self._scene
        node = self.pick(pointer, deep=True)
        if node is None:
            return False
        above = [n.id for n in scene.ancestors(node)]
        inside = above.index(self.entered) if self.entered in above else len(above)
        self.entered = above[inside - 1] if inside > 0 and above else None
        self._session.select([owner(scene, node, self.entered)])
        if self.entered is not None:
            self._hint(f"Parts of {scene[self.entered].name} can be chosen; Esc leaves it")
        return True

    def leave(self) -> bool:
        """Out of the entered group, which is chosen then; whether there was one."""
        if self.entered is None:
            return False
        entered, self.entered = self.entered, None
        self._session.select([entered] if entered in self._scene.nodes else [])
        return True

    def catch(self, press: Pointer, pointer: Pointer) -> None:
        """Choose what a band holds: to the right what lies in it, to the left what it touches."""
        counts = self._viewport.seen_in((press.x, press.y), (pointer.x, pointer.y))
        found = caught(self._scene, counts, self.entered, whole=pointer.x >= press.x)
        more = press.ctrl or press.shift or pointer.ctrl or pointer.shift
        self._session.select(joined(self._session.selection, found) if more else found)

    def follow(self, after: Scene) -> None:
        """The scene is another one: an entered group may be gone."""
        if self.entered is not None and self.entered not in after.nodes:
            self.entered = None
