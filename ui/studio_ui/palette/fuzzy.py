"""How well a few letters fit a text: each must occur, in order; word starts and runs count more."""

from __future__ import annotations

import unicodedata
from dataclasses import dataclass

_START, _RUN, _FIRST = 8.0, 8.0, 4.0
_GAP = 0.15  # for each letter passed over


@dataclass(frozen=True)
class Match:
    """`score` is larger for a better fit; `at` are the positions of the letters that were found."""

    score: float
    at: tuple[int, ...]


def match(query: str, text: str) -> Match | None:
    """How well `query` fits `text`; None when it does not. Every word of the query is looked for anywhere.

    Capitals and accents do not count. No letters fit everything with a score of 0.
    """
    plain = folded(text)
    score, at = 0.0, set[int]()
    for word in folded(query).split():
        found = _word(word, plain)
        if found is None:
            return None
        score += found.score
        at |= set(found.at)
    return Match(score, tuple(sorted(at)))


def folded(text: str) -> str:
    """Small letters without accents, as many as before."""
    if text.isascii():
        return text.lower()
    return "".join(unicodedata.normalize("NFD", letter)[0].casefold()[:1] or letter for letter in text)


def _word(word: str, text: str) -> Match | None:
    """The best way to find the letters of a word in order, by dynamic programming over positions.

    `best[i]` is the best score of the letters so far with the last one at position i, and where they are.
    """
    at = -1
    for letter in word:  # most texts are out of the question
        at = text.find(letter, at + 1)
        if at < 0:
            return None
    best: dict[int, tuple[float, tuple[int, ...]]] = {}
    for number, letter in enumerate(word):
        now: dict[int, tuple[float, tuple[int, ...]]] = {}
        for i, found in enumerate(text):
            if found != letter:
                continue
            start = _START if i == 0 or not text[i - 1].isalnum() else 0.0
            if number == 0:
                now[i] = (1 + start + (_FIRST if i == 0 else 0.0) - _GAP * min(i, 20), (i,))
                continue
            ways = [
                (score + 1 + (_RUN if i == j + 1 else start - _GAP * (i - j)), (*at, i))
                for j, (score, at) in best.items()
                if j < i
            ]
            if ways:
                now[i] = max(ways, key=lambda way: way[0])
        best = now
    if not best:
        return None
    score, at = max(best.values(), key=lambda way: way[0])
    return Match(score - 0.02 * len(text), at)
