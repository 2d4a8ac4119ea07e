"""A canvas that can become another one while the program runs: it keeps what every canvas is told."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Any

import numpy as np
import numpy.typing as npt
from PySide6.QtCore import QRect
from PySide6.QtGui import QImage, QResizeEvent
from PySide6.QtWidgets import QVBoxLayout, QWidget

from studio_core.scene.nodes import NodeId, Scene
from studio_core.session import View
from studio_core.shading.artifacts import Picture
from studio_core.signal import Signal
from studio_ui.canvas.glyphs import Glyph
from studio_ui.canvas.overlay import NOTHING, Overlay
from studio_ui.canvas.viewport import Pointer, Probe, Viewport
from studio_ui.feed import Freshness
from studio_ui.look.theme import Theme

_SIGNALS = ("pointer", "wheel", "scroll", "pinch", "key", "left", "resized")


class SwitchViewport(QWidget):
    """Satisfies `canvas.viewport.Viewport` by handing everything on to `inner`."""

    def __init__(self, inner: Viewport, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.widget: QWidget = self
        self.pointer: Signal[[Pointer]] = Signal()
        self.wheel: Signal[[Pointer, float]] = Signal()
        self.scroll: Signal[[Pointer, float, float]] = Signal()
        self.pinch: Signal[[Pointer, float]] = Signal()
        self.key: Signal[[str, bool]] = Signal()
        self.left: Signal[[]] = Signal()
        self.resized: Signal[[int, int]] = Signal()
        self._told: dict[str, tuple[Any, ...]] = {}
        self._off: list[Callable[[], None]] = []
        self._above: list[tuple[QWidget, Callable[[QRect], QRect]]] = []
        layout = QVBoxLayout(self)
        layout.setContentsMargins(0, 0, 0, 0)
        self._layout = layout
        self.inner = inner
        self._put_in(inner)

    def use(self, viewport: Viewport) -> None:
        """Another canvas instead, told all that the last one was told; that one is deleted."""
        old = self.inner
        focused = old.widget.hasFocus()
        while self._off:
            self._off.pop()()
        self._layout.removeWidget(old.widget)
        self.inner = viewport
        self._put_in(viewport)
        for name, values in self._told.items():
            getattr(viewport, name)(*values)
        if focused:
            viewport.widget.setFocus()
        old.release()
        old.widget.hide()
        old.widget.deleteLater()

    def lay_over(self, widget: QWidget, place: Callable[[QRect], QRect]) -> None:
        """Keep a widget above whatever canvas there is, where `place` says for the canvas' rectangle."""
        widget.setParent(self)
        self._above.append((widget, place))
        widget.setGeometry(place(self.rect()))
        widget.raise_()

    def resizeEvent(self, event: QResizeEvent) -> None:
        """What lies above goes along."""
        super().resizeEvent(event)
        for widget, place in self._above:
            widget.setGeometry(place(self.rect()))

    def release(self) -> None:
        """Give everything back."""
        self.inner.release()
        self._told.clear()

    def _put_in(self, viewport: Viewport) -> None:
        for name in _SIGNALS:
            self._off.append(getattr(viewport, name).connect(getattr(self, name).emit))
        self._layout.addWidget(viewport.widget)
        self.setFocusProxy(viewport.widget)
        viewport.widget.show()
        for widget, _ in self._above:
            widget.raise_()

    def _tell(self, name: str, *values: Any) -> None:
        self._told[name] = values
        getattr(self.inner, name)(*values)

    # what every canvas is told

    def set_picture(self, picture: Picture | None, view: View | None) -> None:
        """Another picture, and the view it was made for."""
        self._tell("set_picture", picture, view)

    def set_scene(self, scene: Scene) -> None:
        """What the scene has come to."""
        self._tell("set_scene", scene)

    def set_freshness(self, state: Freshness) -> None:
        """Mark the picture."""
        self._tell("set_freshness", state)

    def set_display(self, exposure: float, tonemap: str) -> None:
        """Exposure in EV and the view transform."""
        self._tell("set_display", exposure, tonemap)

    def set_selection(self, nodes: Iterable[NodeId]) -> None:
        """Meshes to be outlined, and glyphs to be lit."""
        self._tell("set_selection", frozenset(nodes))

    def set_guides(
        self,
        view: View,
        glyphs: Iterable[Glyph],
        boxes: npt.NDArray[np.float64] | None = None,
        overlay: Overlay = NOTHING,
    ) -> None:
        """Marks over the picture as the present view sees them."""
        self._tell("set_guides", view, tuple(glyphs), boxes, overlay)

    def set_grid(self, shown: bool) -> None:
        """Lines on the ground."""
        self._tell("set_grid", shown)

    def set_message(self, text: str) -> None:
        """A line over an empty canvas."""
        self._tell("set_message", text)

    def set_theme(self, theme: Theme) -> None:
        """Colours around and over the picture."""
        self._tell("set_theme", theme)

    def want_keys(self, wanted: Callable[[str], bool]) -> None:
        """Keys that come before all shortcuts."""
        self._tell("want_keys", wanted)

    # what every canvas answers

    def placed(self) -> tuple[float, float, float, float]:
        """Where the picture lies on the canvas."""
        return self.inner.placed()

    def probe(self, x: float, y: float) -> Probe | None:
        """What the shown picture has at a point of the canvas."""
        return self.inner.probe(x, y)

    def glyph_at(self, x: float, y: float) -> NodeId | None:
        """The lamp or camera drawn near a point of the canvas."""
        return self.inner.glyph_at(x, y)

    def seen_in(
        self, start: tuple[float, float], end: tuple[float, float]
    ) -> Mapping[NodeId, tuple[int, int]]:
        """By node: pixels between two points of the canvas, and all its pixels."""
        return self.inner.seen_in(start, end)

    def grab_image(self) -> QImage:
        """The canvas as it is seen."""
        return self.inner.grab_image()
