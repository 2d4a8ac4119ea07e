"""Which part of a picture is seen, and how large: points of the widget and of the picture, and back."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

LARGEST = 32.0  # widget pixels of one of the picture
_MARGIN = 0.98  # of the widget that a fitted picture takes
_LEAST = 48.0  # widget pixels of a picture that stay in sight

Pair = tuple[float, float]


@dataclass(frozen=True)
class Sight:
    """The picture's point (x, y) is in the widget's middle; `scale` widget pixels are one of the picture."""

    x: float
    y: float
    scale: float

    def to_widget(self, x: float, y: float, size: Pair) -> Pair:
        """Where a point of the picture is seen."""
        return (x - self.x) * self.scale + size[0] / 2, (y - self.y) * self.scale + size[1] / 2

    def to_picture(self, x: float, y: float, size: Pair) -> Pair:
        """Which point of the picture is seen there."""
        return (x - size[0] / 2) / self.scale + self.x, (y - size[1] / 2) / self.scale + self.y

    def zoomed(self, factor: float, at: Pair, size: Pair, picture: Pair) -> Sight:
        """Nearer or further; what is under the widget's point `at` stays there."""
        least = min(fitted(size, picture).scale, 1.0) / 4
        scale = min(max(self.scale * factor, least), LARGEST)
        x, y = self.to_picture(*at, size)
        made = Sight(x - (at[0] - size[0] / 2) / scale, y - (at[1] - size[1] / 2) / scale, scale)
        return made.held(size, picture)

    def moved(self, dx: float, dy: float, size: Pair, picture: Pair) -> Sight:
        """The picture shifted by widget pixels."""
        return replace(self, x=self.x - dx / self.scale, y=self.y - dy / self.scale).held(size, picture)

    def held(self, size: Pair, picture: Pair) -> Sight:
        """So that some of the picture stays in the widget."""
        spare = [s / 2 / self.scale - min(_LEAST, s / 2) / self.scale for s in size]
        x = min(max(self.x, -spare[0]), picture[0] + spare[0])
        y = min(max(self.y, -spare[1]), picture[1] + spare[1])
        return replace(self, x=x, y=y)


def fitted(size: Pair, picture: Pair) -> Sight:
    """All of the picture, as large as the widget lets it be."""
    scale = _MARGIN * min(max(size[0], 1) / picture[0], max(size[1], 1) / picture[1])
    return Sight(picture[0] / 2, picture[1] / 2, min(scale, LARGEST))


@dataclass(frozen=True)
class Part:
    """Rows `top` … `bottom` and columns `left` … `right` of the picture halved `level` times."""

    level: int
    left: int
    top: int
    right: int
    bottom: int


def part_seen(
    sight: Sight, size: Pair, picture: tuple[int, int], ratio: float, block: int = 64
) -> Part | None:
    """What has to be shown: at least a sample for each of the display's pixels, whole blocks of samples.

    `ratio`: pixels of the display in one of the widget. None where nothing of the picture is seen.
    """
    fine = sight.scale * ratio
    level = max(0, math.floor(math.log2(1 / fine))) if fine < 1 else 0
    step = 1 << level
    wide, high = max(1, picture[0] // step), max(1, picture[1] // step)
    x0, y0 = sight.to_picture(0, 0, size)
    x1, y1 = sight.to_picture(*size, size)
    left = max(0, math.floor(x0 / step) // block * block)
    top = max(0, math.floor(y0 / step) // block * block)
    right = min(wide, -(-math.ceil(x1 / step) // block) * block)
    bottom = min(high, -(-math.ceil(y1 / step) // block) * block)
    if right <= left or bottom <= top:
        return None
    return Part(level, left, top, right, bottom)
