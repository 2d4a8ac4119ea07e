"""How many pixels a picture has while somebody drags: as many as the last ones left time for."""

from __future__ import annotations

LEVELS = (130_000, 260_000, 520_000)
"""Pixels of moving pictures: 480×270, 680×382, 960×540 in a wide canvas."""
SLOW, QUICK = 0.080, 0.035
"""Seconds of a picture above which fewer pixels are tried, and below which more: a step doubles the pixels
and so at most doubles the time, which stays under SLOW; nothing swings."""
HELPED = 0.85
"""Of the time before, what halving the pixels must come under; otherwise it was not the pixels."""
KEPT = 0.050
"""Seconds of a moving picture above which it no longer has all the pixels and samples of rest."""
ALIKE = 3
"""Pictures in a row that must agree: other pixels cost every ray anew, and jump before the eye."""


class Pace:
    """Chooses a level by the seconds that moving pictures took.

    The first picture of a motion is left out: it follows one of other pixels, so nothing is kept for it.
    Where nothing has to be traced, pictures are `kept` as they are at rest: for as long as they come quickly,
    or come no quicker with fewer pixels.
    """

    def __init__(self, level: int = 1) -> None:
        self._level = level
        self._lowest = 0  # what lies under it was tried, and did not help
        self._before: float | None = None  # seconds until the step down that is being tried
        self._recent: list[float] = []
        self._kept: list[float] = []
        self._first = True
        self._given_up: float | None = None  # seconds of kept pictures, until others were better
        self._helpless = False  # others were not

    @property
    def pixels(self) -> int:
        """Most pixels that the next moving picture may have."""
        return LEVELS[self._level]

    @property
    def keeps(self) -> bool:
        """Whether the next moving picture may have the pixels and samples of rest, if they were traced."""
        return self._given_up is None

    def rest(self) -> None:
        """The motion has ended: what follows is another one."""
        self._restart()
        self._given_up = None

    def took(self, seconds: float, *, kept: bool = False) -> None:
        """A moving picture was made in so many seconds, `kept` with the pixels and samples of rest."""
        if kept:
            self._took_kept(seconds)
            return
        if self._first:
            self._first = False
            return
        self._recent = [*self._recent[1 - ALIKE :], seconds]
        if len(self._recent) < ALIKE:
            return
        quickest, slowest = min(self._recent), max(self._recent)
        if self._given_up is not None and not self._helpless:
            self._helpless = quickest > HELPED * self._given_up
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

    def _took_kept(self, seconds: float) -> None:
        self._kept = [*self._kept[1 - ALIKE :], seconds]
        if len(self._kept) < ALIKE:
            return
        quickest, slowest = min(self._kept), max(self._kept)
        if slowest < KEPT:
            self._helpless = False
        elif quickest > KEPT and not self._helpless:
            self._given_up = quickest
            self._restart()

    def _step(self, by: int) -> None:
        self._level += by
        self._restart()

    def _restart(self) -> None:
        self._recent.clear()
        self._kept.clear()
        self._first = True
