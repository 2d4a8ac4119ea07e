"""What all canvases keep and answer alike: the picture, what lies over it, and what is under the mouse."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np
import numpy.typing as npt
from PySide6.QtCore import QPointF, QRectF, QSizeF
from PySide6.QtGui import QImage, QPainter
from PySide6.QtWidgets import QWidget

from studio_core.scene.nodes import NodeId, Scene
from studio_core.scene.transform import vec3
from studio_core.session import View
from studio_core.shading.artifacts import Picture
from studio_ui.canvas.glyphs import Glyph
from studio_ui.canvas.hand import Hand
from studio_ui.canvas.legend import paint_legend
from studio_ui.canvas.overlay import NOTHING, Overlay, glyph_near, guides
from studio_ui.canvas.overlay_painter import paint_badge, paint_message, paint_overlay
from studio_ui.canvas.projection import eye_of, project, ray
from studio_ui.canvas.viewport import Probe
from studio_ui.feed import Freshness
from studio_ui.look.theme import DARK, Theme

NO_VIEW = View()


class BaseViewport(Hand):
    """A `canvas.viewport.Viewport` but for drawing: `_picture_changed` and `_look_changed` are told of."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.freshness = Freshness.NONE
        self._theme = DARK
        self._picture: Picture | None = None
        self._scene = Scene()
        self._view = NO_VIEW  # of the picture
        self._exposure, self._tonemap = 0.0, "srgb"
        self._selection: frozenset[NodeId] = frozenset()
        self._guide_view: View | None = None
        self._glyphs: list[Glyph] = []
        self._boxes: npt.NDArray[np.float64] | None = None
        self._overlay = NOTHING
        self._message = ""
        self._grid = False

    # what is shown

    def set_picture(self, picture: Picture | None, view: View | None) -> None:
        """Another picture, and the view it was made for."""
        self._picture, self._view = picture, view or NO_VIEW
        self._picture_changed()

    def set_scene(self, scene: Scene) -> None:
        """What the scene has come to."""
        self._scene = scene

    def set_freshness(self, state: Freshness) -> None:
        """Mark the picture."""
        self.freshness = state
        self._marks_changed()

    def set_display(self, exposure: float, tonemap: str) -> None:
        """Exposure in EV and the view transform."""
        if (exposure, tonemap) != (self._exposure, self._tonemap):
            self._exposure, self._tonemap = exposure, tonemap
            self._display_changed()

    def set_selection(self, nodes: Iterable[NodeId]) -> None:
        """Meshes to be outlined, and glyphs to be lit."""
        made = frozenset(nodes)
        if made != self._selection:
            self._selection = made
            self._selection_changed()
            self._marks_changed()

    def set_guides(
        self,
        view: View,
        glyphs: Iterable[Glyph],
        boxes: npt.NDArray[np.float64] | None = None,
        overlay: Overlay = NOTHING,
    ) -> None:
        """Marks over the picture as the present view sees them."""
        self._guide_view, self._glyphs, self._boxes, self._overlay = view, list(glyphs), boxes, overlay
        self._marks_changed()

    def set_message(self, text: str) -> None:
        """A line over an empty canvas."""
        self._message = text
        self._marks_changed()

    def set_grid(self, shown: bool) -> None:
        """Lines on the ground."""
        if shown != self._grid:
            self._grid = shown
            self._display_changed()

    def set_theme(self, theme: Theme) -> None:
        """Colours around and over the picture."""
        self._theme = theme
        self._selection_changed()
        self._marks_changed()

    def grab_image(self) -> QImage:
        """The canvas as it is seen."""
        return self.grab().toImage()

    def release(self) -> None:
        """Hold on to no picture."""
        self._picture = None

    def _picture_changed(self) -> None:
        self.update()

    def _display_changed(self) -> None:
        self.update()

    def _selection_changed(self) -> None:
        self.update()

    def _marks_changed(self) -> None:
        self.update()

    def _rim(self, across: int) -> int:
        """Pixels of an outline, of a picture with so many across: two logical ones in a large canvas."""
        return max(1, round((2 if self.width() > 700 else 1) * across / max(self.width(), 1)))

    def _paint_marks(self, painter: QPainter) -> None:
        """What lies over the picture."""
        size = QSizeF(self.size())
        overlay = guides(self._glyphs, self._boxes, self._selection) + self._overlay
        paint_overlay(painter, size, self._guide_view or self._view, overlay, self._theme)
        if self._message:
            paint_message(painter, size, self._message, self._theme)
        if self._picture is not None:
            paint_badge(painter, size, self.freshness, self._theme)
            if self._picture.share is not None:
                paint_legend(painter, size)

    # where things are

    def target(self) -> QRectF:
        """The rectangle that the picture fills, logical pixels: all of the width or all of the height."""
        if self._picture is None:
            return QRectF(self.rect())
        height, width = self._picture.linear.shape[:2]
        room = QRectF(self.rect())
        if abs(width * room.height() - height * room.width()) <= 0.02 * width * room.height():
            return room
        shrink = min(room.width() / width, room.height() / height)
        size = (width * shrink, height * shrink)
        return QRectF((room.width() - size[0]) / 2, (room.height() - size[1]) / 2, *size)

    def placed(self) -> tuple[float, float, float, float]:
        """Where the picture lies on the canvas: left, top, right, bottom, 0…1 from the top left."""
        room, width, height = self.target(), max(self.width(), 1), max(self.height(), 1)
        return (
            room.left() / width,
            room.top() / height,
            (room.left() + room.width()) / width,
            (room.top() + room.height()) / height,
        )

    def probe(self, x: float, y: float) -> Probe | None:
        """What the shown picture has at a point of the canvas."""
        if self._picture is None:
            return None
        room, place = self.target(), QPointF(x * self.width(), y * self.height())
        height, width = self._picture.linear.shape[:2]
        across, down = (place.x() - room.left()) / room.width(), (place.y() - room.top()) / room.height()
        column, row = int(across * width), int(down * height)
        if not (0 <= column < width and 0 <= row < height):
            return None
        index = int(self._picture.node[row, column])
        red, green, blue = (float(c) for c in self._picture.linear[row, column])
        share = None if self._picture.share is None else float(self._picture.share[row, column])
        node = self._picture.nodes[index] if index >= 0 else None
        distance = float(self._picture.distance[row, column])
        point = None
        if np.isfinite(distance):
            point = vec3(eye_of(self._view) + ray(self._view, across, down) * distance)
        return Probe(node, distance, (red, green, blue), point, share)

    def glyph_at(self, x: float, y: float) -> NodeId | None:
        """The lamp or camera drawn near a point of the canvas."""
        view = self._guide_view or self._view
        return glyph_near(self._glyphs, view, x, y, (self.width(), self.height()))

    def seen_in(
        self, start: tuple[float, float], end: tuple[float, float]
    ) -> Mapping[NodeId, tuple[int, int]]:
        """By node: pixels between two points of the canvas, and all its pixels; a lamp or camera is one."""
        low, high = np.minimum(start, end), np.maximum(start, end)
        made: dict[NodeId, tuple[int, int]] = {}
        if self._picture is not None:
            index, names, room = self._picture.node, self._picture.nodes, self.target()
            corner, size = (room.left(), room.top()), (room.width(), room.height())
            pixels = np.array(index.shape[::-1])
            places = [(at * (self.width(), self.height()) - corner) / size * pixels for at in (low, high)]
            (left, top), (right, bottom) = (np.clip(np.rint(at), 0, pixels).astype(int) for at in places)
            inside, whole = (
                np.bincount(part.ravel() + 1, minlength=len(names) + 1)
                for part in (index[top:bottom, left:right], index)
            )
            made = {n: (int(inside[i]), int(whole[i])) for i, n in enumerate(names, 1) if whole[i]}
        view = self._guide_view or self._view
        for glyph in self._glyphs:
            at = project(view, glyph.anchor)[0]
            if np.isfinite(at).all():
                made[glyph.node] = int(((at >= low) & (at <= high)).all()), 1
        return made
