"""The canvas without OpenGL: a tone-mapped picture and marks over it, drawn by QPainter."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from PySide6.QtCore import QPointF
from PySide6.QtGui import QColor, QImage, QPainter, QPaintEvent
from PySide6.QtWidgets import QWidget

from studio_core.kernels.tonemap import tonemap
from studio_ui.canvas.base_viewport import BaseViewport
from studio_ui.canvas.grid import grid_strength
from studio_ui.canvas.viewport import GRID


class RasterViewport(BaseViewport):
    """Satisfies `canvas.viewport.Viewport`."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._image: QImage | None = None
        self._outline: QImage | None = None

    def _picture_changed(self) -> None:
        self._develop()
        self._trace()

    def _display_changed(self) -> None:
        self._develop()

    def _selection_changed(self) -> None:
        self._trace()

    def _develop(self) -> None:
        self._image = None
        if self._picture is not None:
            shown_with = self._picture.shown_with(self._exposure, self._tonemap)
            pixels = tonemap(self._picture.linear, *shown_with)
            if self._grid:
                strength = grid_strength(self._view.sized(*pixels.shape[1::-1]), self._picture.distance)
                colour = np.array(GRID, np.float32) * 255
                pixels = (pixels + strength[..., None] * (colour - pixels) + 0.5).astype(np.uint8)
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
                rim = self._rim(mask.shape[1])
                self._outline = _image(outline(mask, rim), QColor(self._theme.mark))
        self.update()

    def paintEvent(self, event: QPaintEvent) -> None:
        """The picture, then marks."""
        painter = QPainter(self)
        painter.fillRect(self.rect(), QColor(self._theme.canvas))
        painter.setRenderHint(QPainter.RenderHint.SmoothPixmapTransform)
        for image in (self._image, self._outline):
            if image is None:
                continue
            if (image.width(), image.height()) == self.device_size():  # pixel by pixel, at any scale
                image.setDevicePixelRatio(self.devicePixelRatioF())
                painter.drawImage(QPointF(), image)
            else:
                painter.drawImage(self.target(), image)
        self._paint_marks(painter)
        painter.end()


def outline(mask: npt.NDArray[np.bool_], rim: int = 1) -> npt.NDArray[np.bool_]:
    """(H, W) pixels just outside the mask, at most `rim` steps away."""
    grown = mask.copy()
    for _ in range(rim):
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
