"""The brush in the hand: what the mouse does in the picture while strokes are painted."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from PySide6.QtCore import QObject, QTimer

from studio_core.session import ALL
from studio_core.shading.artifacts import Picture
from studio_core.strokes.stroke import CLONE
from studio_ui.canvas.looking import Looking
from studio_ui.canvas.overlay import Overlay, Ring
from studio_ui.canvas.viewport import Pointer, Viewport
from studio_ui.context import Context, Subscriptions
from studio_ui.strokes.bench import Order
from studio_ui.strokes.brush_store import BrushStore
from studio_ui.strokes.sheet import Painted, Sheet
from studio_ui.strokes.work import StrokeWork

CLICK = 4.0  # logical pixels that a click may slip
_ASK_MS = 40  # between what is asked while the hand paints, at least
_SOURCE = 6.0  # logical pixels


class StrokeHand(QObject):
    """Satisfies `canvas.tools.CanvasTool`. `refresh` draws the marks again."""

    def __init__(
        self,
        context: Context,
        viewport: Viewport,
        looking: Looking,
        store: BrushStore,
        work: StrokeWork,
        hint: Callable[[str], object],
        refresh: Callable[[], object],
    ) -> None:
        super().__init__()
        self.sheet: Sheet | None = None
        self.also: Callable[[], Overlay] = Overlay
        """What else lies over the picture."""
        self._context, self._viewport, self._looking = context, viewport, looking
        self._store, self._work, self._hint, self._refresh = store, work, hint, refresh
        self._at: Pointer | None = None
        self._press: Pointer | None = None
        self._mode = ""  # "", paint, pick, look
        self._orders: dict[int, np.ndarray] = {}
        self._drawn: np.ndarray | None = None  # the mask of what the next picture shows
        self._gone: Sheet | None = None  # is in the document, and not in the picture yet
        self._soon = QTimer(self)
        self._soon.setSingleShot(True)
        self._soon.timeout.connect(self._show)
        self._subscriptions = Subscriptions()
        self._subscriptions.add(
            store.changed.connect(refresh),
            work.ended.connect(self._ended),
            work.shown.connect(self._shown),
            context.feed.shown.connect(lambda _: self._pictured()),
        )

    def close(self) -> None:
        """Stop listening."""
        self._soon.stop()
        self._subscriptions.close()

    # the mouse

    def pointer(self, pointer: Pointer) -> bool:
        """Paint, pick or look; whether it was for this tool."""
        if pointer.kind == "move" and self._press is None:
            self._at = pointer
            return pointer.button == "none"
        if pointer.kind in ("press", "double") and pointer.button == "left":
            self._at = self._press = pointer
            self._pressed(pointer)
            return True
        if self._press is None or pointer.button != "left":
            return False
        self._at = pointer
        if pointer.kind == "move":
            self._moved(pointer)
        elif pointer.kind == "release":
            self._released(pointer)
        return True

    def wheel(self, pointer: Pointer, steps: float) -> bool:
        """With Ctrl the brush's size; with Shift as well its hardness."""
        if not pointer.ctrl:
            return False
        (self._store.harder if pointer.shift else self._store.larger)(steps)
        return True

    def leave(self) -> None:
        """The mouse is elsewhere."""
        self._at = None

    def _pressed(self, pointer: Pointer) -> None:
        self._mode = ""
        if pointer.alt:
            self._mode = "pick"
        elif pointer.ctrl:
            self._source(pointer)
        else:
            self._begin(pointer)

    def _moved(self, pointer: Pointer) -> None:
        assert self._press is not None
        if self._mode == "paint" and self.sheet is not None:
            (self.sheet.line if pointer.shift else self.sheet.add)(*self.place(pointer))
            if not self._soon.isActive():
                self._soon.start(_ASK_MS)
        elif self._mode == "pick" and _slip(self._press, pointer) > CLICK:
            looks = self._looking.mode_of(self._press)
            self._mode = "look" if looks is not None else ""
            if looks is not None:
                self._looking.start(looks, self._press)
        if self._mode == "look":
            self._looking.move(pointer)

    def _released(self, pointer: Pointer) -> None:
        mode, self._mode, self._press = self._mode, "", None
        if mode == "paint":
            self._let_go()
        elif mode == "pick":
            self._pick(pointer)
        elif mode == "look":
            self._looking.end()

    def _pick(self, pointer: Pointer) -> None:
        probe = self._viewport.probe(pointer.x, pointer.y)
        if probe is not None:
            self._store.pick(probe.radiance)
            self._hint("Painting with the light that is seen there")

    def _source(self, pointer: Pointer) -> None:
        self._store.use(source=self.place(pointer))
        self._hint("Cloning takes from there")

    def place(self, pointer: Pointer) -> tuple[float, float]:
        """(x, y) of the picture's width and height."""
        left, top, right, bottom = self._viewport.placed()
        return (pointer.x - left) / max(right - left, 1e-9), (pointer.y - top) / max(bottom - top, 1e-9)

    # painting

    def _begin(self, pointer: Pointer) -> None:
        picture = self._paper()
        if picture is None:
            return
        setting = self._store.now
        if setting.tool == CLONE and setting.settings.source is None:
            self._hint("Ctrl+click where cloning is to take from")
            return
        sheet = Sheet(picture, self._context.document.scene, setting)
        sheet.add(*self.place(pointer))
        if self._work.begin(sheet.label):
            self.sheet, self._gone = sheet, None
            self._mode, self._drawn = "paint", None
            self._soon.start(_ASK_MS)

    def _paper(self) -> Picture | None:
        """The picture that is seen, if it can be painted on."""
        session, last = self._context.session, self._context.feed.last
        if last is None or session.light != ALL or last.picture.share is not None:
            self._hint("Look at all light to paint on it" if last is not None else "There is no picture yet")
            return None
        seen, view = session.view, last.view
        if (seen.transform, seen.fov) != (view.transform, view.fov):
            self._hint("The picture is on its way: paint when it has come")
            return None
        return last.picture

    def _show(self) -> None:
        if self.sheet is not None and self._mode == "paint" and not self._work.asking:
            self._work.show(self._order(self.sheet))
        elif self._mode == "paint":
            self._soon.start(_ASK_MS)

    def _order(self, sheet: Sheet) -> Order:
        painted: Painted = sheet.painted()
        order = Order(sheet.label, painted.edit, painted.node)
        self._orders = {id(order): painted.mask}
        return order

    def _let_go(self) -> None:
        self._soon.stop()
        if self.sheet is not None:
            self._work.finish(self._order(self.sheet))

    def _shown(self, order: Order) -> None:
        """The document has the answer: the next picture shows it."""
        answer = self._work.answer
        if answer is not None and any(r.meaning for f in answer.solution.findings for r in f.reasons[:1]):
            self._drawn = self._orders.get(id(order))

    def _pictured(self) -> None:
        if self.sheet is not None and self._drawn is not None:
            self.sheet.solved = self._drawn
        if self._drawn is not None or self._gone is not None:
            self._drawn = self._gone = None
            self._refresh()

    def _ended(self) -> None:
        """By the last answer, by Esc, or by another edit."""
        sheet, self.sheet = self.sheet, None
        if sheet is not None and sheet.node in self._context.document.scene.nodes and self._context.feed.busy:
            self._gone = sheet
        self._soon.stop()
        if self._mode == "paint":
            self._mode = ""
        self._refresh()

    # what lies over the picture

    def marks(self) -> Overlay:
        """What is painted, the circle that it is painted with, and where a clone takes from."""
        made, session = self.also(), self._context.session
        placed = self._viewport.placed()
        sheet = self.sheet or self._gone
        if sheet is not None:
            film = sheet.film(placed, session.exposure, session.tonemap)
            made += Overlay((film,)) if film is not None else Overlay()
        setting, left, top, right, bottom = self._store.now, *placed
        if self._at is not None:
            brush = setting.brush
            radius = brush.size / 2 * (bottom - top) * self._at.pixels[1]
            at = (self._at.x, self._at.y)
            made += Overlay((Ring(at, max(radius, 1.5)),))
            if 0.05 < brush.hardness < 0.95:
                made += Overlay((Ring(at, max(radius * brush.hardness, 1.0), width=0.5),))
        source = setting.settings.source
        if setting.tool == CLONE and source is not None:
            at = (left + (right - left) * source[0], top + (bottom - top) * source[1])
            made += Overlay((Ring(at, _SOURCE, "accent", 2.0),))
        return made


def _slip(a: Pointer, b: Pointer) -> float:
    return float(np.hypot((a.x - b.x) * a.pixels[0], (a.y - b.y) * a.pixels[1]))


__all__ = ["StrokeHand"]
