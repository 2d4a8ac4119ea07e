"""The canvas without OpenGL: a tone-mapped picture and lines over it, drawn by QPainter."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import numpy.typing as npt
from PySide6.QtCore import QEvent, QLineF, QPointF, QRectF, QSize, Qt
from PySide6.QtGui import (
    QColor,
    QFocusEvent,
    QFont,
    QImage,
    QKeyEvent,
    QMouseEvent,
    QPainter,
    QPaintEvent,
    QPen,
    QResizeEvent,
    QWheelEvent,
)
from PySide6.QtWidgets import QSizePolicy, QWidget

from studio_core.kernels.tonemap import tonemap
from studio_core.scene.nodes import NodeId
from studio_core.session import View
from studio_core.shading.artifacts import Picture
from studio_core.signal import Signal
from studio_ui.canvas.glyphs import Glyph
from studio_ui.canvas.projection import project, project_segments
from studio_ui.canvas.viewport import Button, Pointer, Probe
from studio_ui.feed import Freshness
from studio_ui.theme import DARK, Theme

_BUTTONS: dict[Qt.MouseButton, Button] = {
    Qt.MouseButton.LeftButton: "left",
    Qt.MouseButton.MiddleButton: "middle",
    Qt.MouseButton.RightButton: "right",
}
_KEYS = {Qt.Key.Key_Escape: "escape", Qt.Key.Key_R: "r"}
_NEAR_GLYPH = 14.0  # logical pixels
_NO_VIEW = View()


class RasterViewport(QWidget):
    """Satisfies `canvas.viewport.Viewport`."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.widget: QWidget = self
        self.pointer: Signal[[Pointer]] = Signal()
        self.wheel: Signal[[Pointer, float]] = Signal()
        self.key: Signal[[str, bool]] = Signal()
        self.left: Signal[[]] = Signal()
        self.resized: Signal[[int, int]] = Signal()
        self.freshness = Freshness.NONE
        self._theme = DARK
        self._picture: Picture | None = None
        self._view = _NO_VIEW  # of the picture
        self._image: QImage | None = None
        self._outline: QImage | None = None
        self._exposure, self._tonemap = 0.0, "srgb"
        self._selection: frozenset[NodeId] = frozenset()
        self._guide_view = _NO_VIEW
        self._glyphs: list[Glyph] = []
        self._boxes: npt.NDArray[np.float64] | None = None
        self._message = ""
        self._held: Button = "none"
        self.setMouseTracking(True)
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Expanding)
        self.setMinimumSize(240, 160)
        self.setAccessibleName("Picture")

    # what is shown

    def set_picture(self, picture: Picture | None, view: View | None) -> None:
        """Another picture, and the view it was made for."""
        self._picture, self._view = picture, view or _NO_VIEW
        self._develop()
        self._trace()

    def set_freshness(self, state: Freshness) -> None:
        """Mark the picture."""
        self.freshness = state
        self.update()

    def set_display(self, exposure: float, tonemap: str) -> None:
        """Exposure in EV and the view transform."""
        if (exposure, tonemap) != (self._exposure, self._tonemap):
            self._exposure, self._tonemap = exposure, tonemap
            self._develop()

    def set_selection(self, nodes: Iterable[NodeId]) -> None:
        """Meshes to be outlined, and glyphs to be lit."""
        made = frozenset(nodes)
        if made != self._selection:
            self._selection = made
            self._trace()

    def set_guides(
        self, view: View, glyphs: Iterable[Glyph], boxes: npt.NDArray[np.float64] | None = None
    ) -> None:
        """Lines over the picture as the present view sees them."""
        self._guide_view, self._glyphs, self._boxes = view, list(glyphs), boxes
        self.update()

    def set_message(self, text: str) -> None:
        """A line over an empty canvas."""
        self._message = text
        self.update()

    def set_theme(self, theme: Theme) -> None:
        """Colours around and over the picture."""
        self._theme = theme
        self._trace()

    def grab_image(self) -> QImage:
        """The canvas as it is seen."""
        return self.grab().toImage()

    def _develop(self) -> None:
        self._image = None
        if self._picture is not None:
            pixels = tonemap(self._picture.linear, self._exposure, self._tonemap)
            height, width = pixels.shape[:2]
            image = QImage(pixels.data, width, height, 3 * width, QImage.Format.Format_RGB888)
            self._image = image.convertToFormat(QImage.Format.Format_RGB32)  # owns its pixels
        self.update()

    def _trace(self) -> None:
        """The outline of the selected meshes, in the picture's pixels."""
        self._outline = None
        if self._picture is not None and self._selection:
            chosen = np.array([n in self._selection for n in self._picture.nodes] + [False])
            mask = chosen[self._picture.node]
            if mask.any():
                self._outline = _image(outline(mask), QColor(self._theme.accent))
        self.update()

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

    def probe(self, x: float, y: float) -> Probe | None:
        """What the shown picture has at a point of the canvas."""
        if self._picture is None:
            return None
        room, place = self.target(), QPointF(x * self.width(), y * self.height())
        height, width = self._picture.linear.shape[:2]
        column = int((place.x() - room.left()) / room.width() * width)
        row = int((place.y() - room.top()) / room.height() * height)
        if not (0 <= column < width and 0 <= row < height):
            return None
        index = int(self._picture.node[row, column])
        red, green, blue = (float(c) for c in self._picture.linear[row, column])
        node = self._picture.nodes[index] if index >= 0 else None
        return Probe(node, float(self._picture.distance[row, column]), (red, green, blue))

    def glyph_at(self, x: float, y: float) -> NodeId | None:
        """The lamp or camera drawn near a point of the canvas."""
        best, found = _NEAR_GLYPH, None
        size = np.array([self.width(), self.height()])
        for glyph in self._glyphs:
            away = (project(self._guide_view, glyph.anchor)[0] - (x, y)) * size
            distance = float(np.hypot(*away))
            if distance < best:
                best, found = distance, glyph.node
        return found

    # painting

    def paintEvent(self, event: QPaintEvent) -> None:
        """The picture, then lines, then the badge."""
        painter = QPainter(self)
        painter.fillRect(self.rect(), QColor(self._theme.canvas))
        room = self.target()
        if self._image is not None:
            painter.setRenderHint(QPainter.RenderHint.SmoothPixmapTransform)
            painter.drawImage(room, self._image)
            if self._outline is not None:
                painter.drawImage(room, self._outline)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        for glyph in self._glyphs:
            lit = glyph.node in self._selection
            self._wires(
                painter, glyph.segments, QColor(self._theme.accent if lit else "#f2f2f0"), 2 if lit else 1
            )
            spot = project(self._guide_view, glyph.anchor)[0]
            if np.isfinite(spot).all():
                painter.setBrush(QColor(self._theme.accent if lit else "#f2f2f0"))
                painter.drawEllipse(QPointF(spot[0] * self.width(), spot[1] * self.height()), 3, 3)
                painter.setBrush(Qt.BrushStyle.NoBrush)
        if self._boxes is not None:
            self._wires(painter, self._boxes, QColor(self._theme.accent), 1.5)
        if self._message:
            self._say(painter)
        self._badge(painter)
        painter.end()

    def _wires(
        self, painter: QPainter, segments: npt.NDArray[np.float64], colour: QColor, width: float
    ) -> None:
        flat = project_segments(self._guide_view, segments) * (self.width(), self.height())
        flat = flat[(np.abs(flat) < 1e5).all(axis=(1, 2))]
        lines = [QLineF(*start, *end) for start, end in flat.tolist()]
        painter.setPen(QPen(QColor(0, 0, 0, 120), width + 2))
        painter.drawLines(lines)
        painter.setPen(QPen(colour, width))
        painter.drawLines(lines)

    def _say(self, painter: QPainter) -> None:
        font = QFont(self.font())
        font.setPointSizeF(font.pointSizeF() * 1.25)
        painter.setFont(font)
        painter.setPen(QColor(self._theme.dim))
        flags = Qt.AlignmentFlag.AlignCenter | Qt.TextFlag.TextWordWrap
        painter.drawText(QRectF(self.rect()).adjusted(40, 40, -40, -40), int(flags), self._message)

    def _badge(self, painter: QPainter) -> None:
        """A small mark in the corner unless the picture is up to date."""
        if self.freshness in (Freshness.CURRENT, Freshness.NONE) or self._picture is None:
            return
        colours = {
            Freshness.STALE: self._theme.accent,
            Freshness.REFINING: "#8fb8d8",
            Freshness.FAILED: self._theme.problem,
        }
        text = self.freshness.value
        painter.setFont(self.font())
        width = painter.fontMetrics().horizontalAdvance(text) + 34
        box = QRectF(self.width() - width - 12, 12, width, 24)
        painter.setPen(Qt.PenStyle.NoPen)
        painter.setBrush(QColor(20, 20, 20, 175))
        painter.drawRoundedRect(box, 12, 12)
        painter.setBrush(QColor(colours[self.freshness]))
        painter.drawEllipse(QPointF(box.left() + 14, box.center().y()), 4, 4)
        painter.setPen(QColor("#ececea"))
        painter.drawText(box.adjusted(24, 0, -8, 0), int(Qt.AlignmentFlag.AlignVCenter), text)

    # the hand

    def sizeHint(self) -> QSize:
        """Some room to start with."""
        return QSize(960, 600)

    def resizeEvent(self, event: QResizeEvent) -> None:
        """Device pixels are what a picture is made for."""
        ratio = self.devicePixelRatioF()
        self.resized.emit(round(self.width() * ratio), round(self.height() * ratio))

    def mousePressEvent(self, event: QMouseEvent) -> None:
        """Remember the button until it is released."""
        if self._held == "none" or event.buttons() == event.button():  # a release may have been missed
            self._held = _BUTTONS.get(event.button(), "none")
            self._send("press", event)

    def mouseMoveEvent(self, event: QMouseEvent) -> None:
        """With what is held."""
        self._send("move", event)

    def mouseReleaseEvent(self, event: QMouseEvent) -> None:
        """Only of the button that was pressed first."""
        if _BUTTONS.get(event.button()) == self._held:
            self._send("release", event)
            self._held = "none"

    def mouseDoubleClickEvent(self, event: QMouseEvent) -> None:
        """A second press at the same place."""
        self._held = _BUTTONS.get(event.button(), "none")
        self._send("double", event)

    def wheelEvent(self, event: QWheelEvent) -> None:
        """Steps of a wheel, or of a touchpad."""
        steps = event.angleDelta().y() / 120 or event.pixelDelta().y() / 60
        if steps:
            self.wheel.emit(self._pointer("move", event.position(), event.modifiers()), steps)
        event.accept()

    def leaveEvent(self, event: QEvent) -> None:
        """Nothing is under the mouse any more."""
        self.left.emit()

    def keyPressEvent(self, event: QKeyEvent) -> None:
        """Keys that are held; the others are actions of the window."""
        self._key(event, True)

    def keyReleaseEvent(self, event: QKeyEvent) -> None:
        """The end of it."""
        self._key(event, False)

    def focusOutEvent(self, event: QFocusEvent) -> None:
        """Keys that are still held count as released."""
        self.key.emit("r", False)
        super().focusOutEvent(event)

    def _key(self, event: QKeyEvent, pressed: bool) -> None:
        name = _KEYS.get(Qt.Key(event.key()))
        if name is not None and not event.modifiers() and not event.isAutoRepeat():
            self.key.emit(name, pressed)
        elif name is None:
            event.ignore()

    def _send(self, kind: str, event: QMouseEvent) -> None:
        self.pointer.emit(self._pointer(kind, event.position(), event.modifiers()))

    def _pointer(self, kind: str, at: QPointF, keys: Qt.KeyboardModifier) -> Pointer:
        return Pointer(
            kind,  # type: ignore[arg-type]
            at.x() / max(self.width(), 1),
            at.y() / max(self.height(), 1),
            self._held,
            bool(keys & Qt.KeyboardModifier.ShiftModifier),
            bool(keys & Qt.KeyboardModifier.ControlModifier),
            bool(keys & Qt.KeyboardModifier.AltModifier),
            (self.width(), self.height()),
        )


def outline(mask: npt.NDArray[np.bool_]) -> npt.NDArray[np.bool_]:
    """(H, W) pixels just outside the mask, two wide in large pictures, and its own rim at the border."""
    grown = mask.copy()
    for _ in range(2 if mask.shape[1] > 700 else 1):
        wide = grown.copy()
        wide[1:] |= grown[:-1]
        wide[:-1] |= grown[1:]
        wide[:, 1:] |= grown[:, :-1]
        wide[:, :-1] |= grown[:, 1:]
        grown = wide
    return grown & ~mask


def _image(mask: npt.NDArray[np.bool_], colour: QColor) -> QImage:
    pixels = np.where(mask, np.uint32(colour.rgba()), np.uint32(0)).astype(np.uint32)
    height, width = pixels.shape
    image = QImage(pixels.data, width, height, 4 * width, QImage.Format.Format_ARGB32_Premultiplied)
    return image.copy()
