"""How many pixels a picture has while somebody drags: as many as the last ones left time for."""

from __future__ import annotations

LEVELS = (130_000, 260_000, 520_000)
"""Pixels of moving pictures: 480×270, 680×382, 960×540 in a wide canvas."""
SLOW, QUICK = 0.080, 0.035
"""Seconds of a picture above which fewer pixels are tried, and below which more: a step doubles the pixels
and so at most doubles the time, which stays under SLOW; nothing swings."""
HELPED = 0.85
"""Of the time before, what halving the pixels must come under; otherwise it was not the pixels."""
ALIKE = 3
"""Pictures in a row that must agree: other pixels cost every ray anew, and jump before the eye."""


class Pace:
    """Chooses a level by the seconds that moving pictures took.

    The first picture of a motion is left out: it follows one of other pixels, so nothing is kept for it.
    """

    def __init__(self, level: int = 1) -> None:
        self._level = level
        self._lowest = 0  # what lies under it was tried, and did not help
        self._before: float | None = None  # seconds until the step down that is being tried
        self._recent: list[float] = []
        self._first = True

    @property
    def pixels(self) -> int:
        """Most pixels that the next moving picture may have."""
        return LEVELS[self._level]

    def rest(self) -> None:
        """The motion has ended: what follows is another one."""
        self._recent.clear()
        self._first = True

    def took(self, seconds: float) -> None:
        """A moving picture was made in so many seconds."""
        if self._first:
            self._first = False
            return
        self._recent = [*self._recent[1 - ALIKE :], seconds]
        if len(self._recent) < ALIKE:
            return
        quickest, slowest = min(self._recent), max(self._recent)
        before, self._before = self._before, None
        if before is not None and quickest > HELPED * before:
            self._lowest = self._level + 1
            self._step(1)
        elif quickest > SLOW and self._level > self._lowest:
            self._before = quickest
            self._step(-1)
        elif slowest < QUICK and self._level + 1 < len(LEVELS):
            self._step(1)
        elif slowest < SLOW:
            self._lowest = 0

    def _step(self, by: int) -> None:
        self._level += by
        self.rest()
