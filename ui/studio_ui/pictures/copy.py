"""The picture as it is shown, onto the clipboard."""

from __future__ import annotations

import numpy as np
from PySide6.QtGui import QImage

from studio_core.kernels.tonemap import tonemap
from studio_ui.feed import Shown


def shown_image(shown: Shown, exposure: float, kind: str) -> QImage:
    """The picture in its own pixels, without handles and outlines."""
    pixels = np.ascontiguousarray(tonemap(shown.picture.linear, exposure, kind))
    height, width, _ = pixels.shape
    return QImage(pixels.data, width, height, 3 * width, QImage.Format.Format_RGB888).copy()
