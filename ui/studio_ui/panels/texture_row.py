"""A picture on a parameter of a material: what it is, another one, none, and how it lies."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from PySide6.QtCore import QSize, Qt
from PySide6.QtGui import QImage, QPixmap
from PySide6.QtWidgets import QLabel, QToolButton, QVBoxLayout, QWidget

from studio_core.scene.geometry import Image, Texture
from studio_core.scene.pattern import UnitLengths
from studio_ui.panels.grow_button import GrowButton
from studio_ui.panels.panel import row
from studio_ui.panels.pattern_row import PatternRow

_ICON = QSize(40, 26)


class TextureRow(QWidget):
    """`ask()` wants another picture, `put(texture)` is an edit; None takes the picture away.

    `lay(texture)` is one too, of all pictures that lie as this one does; `grow(times)` makes these larger.
    `pattern` says how it lies; whoever makes the row puts it below, where it has all of the width.
    """

    def __init__(
        self,
        label: str,
        tool: Callable[[str, str], QToolButton],
        ask: Callable[[], object],
        put: Callable[[Texture | None], object],
        lay: Callable[[Texture], object],
        grow: Callable[[int], object],
        told: str = "",
    ) -> None:
        super().__init__()
        self._texture: Texture | None = None
        self.picture = QLabel()
        self.text = QLabel()
        self.text.setProperty("role", "dim")
        self.text.setMinimumWidth(24)  # what narrow panels cut off is in the tip
        load = tool("open", told or f"Picture for {label.lower()}, which it is multiplied with")
        load.clicked.connect(lambda: ask())
        self.remove = tool("cancel", "Take the picture away")
        self.remove.clicked.connect(lambda: put(None))
        self.pattern = PatternRow(tool, lay)
        self.grow = GrowButton(tool, grow)
        column = QVBoxLayout(self)
        column.setContentsMargins(0, 0, 0, 0)
        column.setSpacing(2)
        column.addLayout(row(self.picture, self.text, load, self.grow.button, self.remove, stretch=1))

    def show_texture(self, texture: Texture | None, lengths: UnitLengths | None) -> None:
        """What lies there now, on surfaces with such lengths."""
        if texture is None or self._texture is None or texture.image is not self._texture.image:
            self.picture.setVisible(texture is not None)
            if texture is not None:
                self.picture.setPixmap(small_pixmap(texture.image))
        self._texture = texture
        self.remove.setEnabled(texture is not None)
        self.pattern.setVisible(texture is not None)
        self.grow.show_texture(texture)
        if texture is None:
            self.text.setText("No picture")
            return
        height, width = texture.image.pixels.shape[:2]
        self.text.setText(f"{width} × {height}")
        self.text.setToolTip(f"{width} × {height} pixels")
        self.pattern.show_texture(texture, lengths)


def small_pixmap(image: Image) -> QPixmap:
    """The picture as it is displayed, small."""
    step = max(1, min(image.pixels.shape[0] // _ICON.height(), image.pixels.shape[1] // _ICON.width()))
    pixels = image.pixels[::step, ::step]
    if pixels.shape[2] != 3:
        pixels = pixels[..., [0, 0, 0]] if pixels.shape[2] == 1 else pixels[..., :3]
    if pixels.dtype != np.uint8:
        from studio_core.kernels.tonemap import tonemap

        kind = "srgb" if image.encoding == "linear" else "raw"
        pixels = tonemap(pixels, kind=kind)
    pixels = np.ascontiguousarray(pixels)
    height, width = pixels.shape[:2]
    made = QImage(pixels.tobytes(), width, height, 3 * width, QImage.Format.Format_RGB888)
    keep, smooth = Qt.AspectRatioMode.KeepAspectRatio, Qt.TransformationMode.SmoothTransformation
    return QPixmap.fromImage(made.scaled(_ICON, keep, smooth))
