"""How long exact tracing will take, judged by how long it took: whether a quick picture is worth it."""

from __future__ import annotations

LEAST = 64
"""Vertices of which something can be learnt."""
_MOST = 4.0


class Forecast:
    """Seconds for vertices of which nothing is known, and for such that something moved for."""

    def __init__(self, new: float = 1.2e-3, known: float = 1.5e-4) -> None:
        self._new, self._known = new, known

    def __call__(self, new: int, known: int) -> float:
        """Seconds for so many vertices."""
        return new * self._new + known * self._known

    def learn(self, new: int, known: int, seconds: float) -> None:
        """So many took so long: what is expected comes half way towards it."""
        if new + known < LEAST:
            return
        expected = self(new, known)
        off = min(max(seconds / expected, 1 / _MOST), _MOST)
        share = new * self._new / expected
        self._new *= off ** (share / 2)
        self._known *= off ** ((1 - share) / 2)
