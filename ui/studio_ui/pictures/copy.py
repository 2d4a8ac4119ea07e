"""The picture as it is shown: as it is, and as much of it as another picture will show."""

from __future__ import annotations

import numpy as np
from PySide6.QtGui import QColor, QImage, QPainter

from studio_core.kernels.tonemap import tonemap
from studio_ui.feed import Shown

GROUND = 34  # grey of what is not known yet


def shown_image(shown: Shown, exposure: float, kind: str) -> QImage:
    """The picture in its own pixels, without handles and outlines."""
    pixels = np.ascontiguousarray(tonemap(shown.picture.linear, *shown.picture.shown_with(exposure, kind)))
    height, width, _ = pixels.shape
    return QImage(pixels.data, width, height, 3 * width, QImage.Format.Format_RGB888).copy()


def framed(image: QImage, shape: float, share: float = 1.0) -> QImage:
    """The middle of a picture: `share` of its height, and `shape` times as wide as that.

    Where this reaches further than the picture, nothing is known yet.
    """
    height = max(1, round(image.height() * share))
    width = max(1, round(height * shape))
    made = QImage(width, height, QImage.Format.Format_RGB888)
    made.fill(QColor(GROUND, GROUND, GROUND))
    painter = QPainter(made)
    painter.drawImage((width - image.width()) // 2, (height - image.height()) // 2, image)
    painter.end()
    return made
