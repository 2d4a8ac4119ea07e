"""The ball: scene-linear pixels as the view shows light, another material in its right half."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import numpy.typing as npt
from PySide6.QtCore import QPointF, QRect, QRectF, QSize, Qt
from PySide6.QtGui import QColor, QImage, QPainter, QPaintEvent, QPen, QResizeEvent
from PySide6.QtWidgets import QSizePolicy, QWidget

from studio_core.kernels.tonemap import tonemap
from studio_core.params import Colour
from studio_ui.look.theme import DARK, Theme
from studio_ui.material_view.work import Linear

_CHECKS = 8  # pixels of the pattern behind what is transparent


class BallView(QWidget):
    """`resized()`: a ball of `pixels` is wanted."""

    def __init__(self) -> None:
        super().__init__()
        self.theme = DARK
        self.resized: Callable[[], object] = lambda: None
        self._images: tuple[QImage | None, QImage | None] = (None, None)
        self._clear = False
        self.setAccessibleName("Ball")
        self.setMinimumSize(60, 60)
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Expanding)

    @property
    def pixels(self) -> int:
        """Of the device, across the ball, in even steps: 48 to 248."""
        across = (min(self.width(), self.height()) - 8) * self.devicePixelRatioF()
        return int(min(max(across, 48), 248)) // 8 * 8

    def set_theme(self, theme: Theme) -> None:
        """Another ground."""
        self.theme = theme
        self.update()

    def show_balls(
        self, own: Linear | None, other: Linear | None, gain: Colour, exposure: float, tone: str
    ) -> None:
        """Pixels (S, S, 4) at unit gain of the light; None shows nothing."""
        made = [as_image(ball, gain, exposure, tone) if ball is not None else None for ball in (own, other)]
        self._images = (made[0], made[1])
        self._clear = any(ball is not None and float(ball[..., 3].max()) < 1 for ball in (own, other))
        self.update()

    @property
    def image(self) -> QImage | None:
        """The material's own ball as it is shown."""
        return self._images[0]

    def sizeHint(self) -> QSize:
        """A square."""
        return QSize(150, 150)

    def resizeEvent(self, event: QResizeEvent) -> None:
        """Another ball is wanted."""
        super().resizeEvent(event)
        self.resized()

    def paintEvent(self, event: QPaintEvent) -> None:
        """Ground, ball, and the other's half."""
        painter = QPainter(self)
        painter.setRenderHints(QPainter.RenderHint.Antialiasing | QPainter.RenderHint.SmoothPixmapTransform)
        painter.setPen(Qt.PenStyle.NoPen)
        painter.setBrush(QColor(self.theme.base))
        painter.drawRoundedRect(self.rect(), 4, 4)
        side = min(self.width(), self.height()) - 8
        place = QRectF((self.width() - side) / 2, (self.height() - side) / 2, side, side)
        if self._clear:
            self._checks(painter, place.toRect())
        own, other = self._images
        if own is not None:
            painter.drawImage(place, own)
        if other is not None:
            middle = place.center().x()
            painter.setClipRect(QRectF(middle, 0, self.width(), self.height()))
            painter.setBrush(QColor(self.theme.base))
            painter.drawRect(QRectF(middle, place.top() - 2, place.width(), place.height() + 4))
            if self._clear:
                self._checks(painter, place.toRect())
            painter.drawImage(place, other)
            painter.setClipping(False)
            painter.setPen(QPen(QColor(self.theme.accent), 1))
            painter.drawLine(QPointF(middle, place.top()), QPointF(middle, place.bottom()))
        painter.end()

    def _checks(self, painter: QPainter, place: QRect) -> None:
        raised = QColor(self.theme.raised)
        for row, y in enumerate(range(place.top(), place.bottom(), _CHECKS)):
            for column, x in enumerate(range(place.left(), place.right(), _CHECKS)):
                if (row + column) % 2:
                    painter.fillRect(x, y, _CHECKS, _CHECKS, raised)


def as_image(ball: npt.NDArray[np.float32], gain: Colour, exposure: float, tone: str) -> QImage:
    """What a display is sent of scene-linear pixels (S, S, 4)."""
    colour = tonemap(ball[..., :3] * np.asarray(gain, np.float32), exposure, tone)
    alpha = np.rint(ball[..., 3:] * 255).astype(np.uint8)
    bytes_ = np.ascontiguousarray(np.concatenate([colour, alpha], axis=2))
    height, width = bytes_.shape[:2]
    return QImage(bytes_.tobytes(), width, height, 4 * width, QImage.Format.Format_RGBA8888).copy()


__all__ = ["BallView", "as_image"]
