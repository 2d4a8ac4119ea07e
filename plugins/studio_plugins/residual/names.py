"""What the names of a set of photographs tell: where each lamp was, and how long each exposure.

One name alone is often ambiguous (`cloth-60`: sixty, or minus sixty; `12`: a direction, or the twelfth
picture), a set is less so: a hyphen that some names lack is a sign, numbers that just count are no
directions, and a small number that runs through the same values under every lamp tells exposures apart.
Folders count as part of the name: `-60/IMG_4711.jpg`, `m60/3.jpg`.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import PurePosixPath
from typing import Any

_START = r"(?:(?<=^)|(?<=[\W_]))"
_AFTER = r"(?=[\W_]|$)"
_NUMBER = r"\d+(?:\.\d+)?"
_TIME = rf"1[_-]\d+(?:\.\d+)?|{_NUMBER}"  # 1-60: a sixtieth
_SHUTTER = re.compile(
    rf"{_START}(?:t|time|exp|exposure|shutter)[_=]?({_TIME})(ms|sec|s)?{_AFTER}", re.IGNORECASE
)
_SECONDS = re.compile(rf"{_START}({_TIME})(ms|sec|s){_AFTER}", re.IGNORECASE)
_EVS = (
    re.compile(rf"{_START}ev[_=]?([-+mp]?)({_NUMBER}){_AFTER}", re.IGNORECASE),
    re.compile(rf"([-+])({_NUMBER})_?ev{_AFTER}", re.IGNORECASE),
)
_SIGNED = re.compile(
    rf"(?:{_START}(?P<word>[a-z]+?)?[_=]?)?"
    rf"(?P<sign>[-+\u2212]*|(?<![a-z])(?:minus|plus|neg|pos|m|p|n)[_-]?)"
    rf"(?P<number>{_NUMBER})(?:deg|°)?",
    re.IGNORECASE,
)
_AZIMUTHS = {"az", "azi", "azimuth", "a", "phi", "light", "lamp", "angle", "rot"}
_HEIGHTS = {"el", "elev", "elevation", "height", "h", "e", "alt"}
_MINUS = {"minus", "neg", "m", "n"}
_MOST_SHOTS = 12


@dataclass(frozen=True)
class Told:
    """Of one name: `azimuth` and `height` in degrees (None without azimuth), the `seconds` or the `ev` of
    its exposure, and its `number` among the exposures of its light."""

    azimuth: float | None = None
    height: float = 0.0
    seconds: float | None = None
    ev: float | None = None
    number: int | None = None


@dataclass(frozen=True)
class _Number:
    """A number in a name: the word before it, hyphens and signs before it, its digits."""

    word: str
    sign: str
    value: float
    glued: bool  # a hyphen right after a letter or digit

    @property
    def hyphens(self) -> int:
        return len(self.sign) if set(self.sign) == {"-"} else 0


_Found = dict[tuple[int, int, str], _Number]
"""Numbers by where they stand: folder from the end, place within it (from its end), word before."""


def told_by(names: Sequence[str]) -> list[Told]:
    """What each of the names (with folders, `/` between) tells, in the light of all others."""
    some = [_exposure(name) for name in names]
    counted = _counted([one.seconds for one, _, plain in some if plain])
    shots = []
    for one, _, plain in some:
        again = counted and plain and one.seconds is not None
        shots.append(replace(one, seconds=None, number=int(one.seconds or 0)) if again else one)
    numbers = [_numbers(rest) for _, rest, _ in some]
    azimuths, heights, running = _angles(numbers)
    made = []
    for i, one in enumerate(shots):
        number = one.number if one.number is not None else running[i]
        made.append(replace(one, azimuth=azimuths[i], height=heights[i] or 0.0, number=number))
    return made


def structure(name: str) -> frozenset[tuple[int, int, str]]:
    """Where numbers stand in a name: alike for all pictures of a set, not for what else lies there."""
    return frozenset(_numbers(_exposure(name)[1]))


def _exposure(name: str) -> tuple[Told, str, bool]:
    """The exposure, the name without it, and whether it might be a mere count (`exp3`)."""
    path = PurePosixPath(name.replace("\\", "/"))
    rest = path.with_suffix("").as_posix() if re.fullmatch(r"\.[A-Za-z]\w*", path.suffix) else path.as_posix()
    for form in _EVS:
        found = form.search(rest)
        if found:
            ev = float(found[2]) * (-1 if found[1].lower() in ("-", "m") else 1)
            return Told(ev=ev), _without(rest, found), False
    found = _SHUTTER.search(rest)
    if found:
        plain = found[2] is None and found[1].isdigit()
        return Told(seconds=_time(found[1], found[2])), _without(rest, found), plain
    found = _SECONDS.search(rest)
    if found:
        return Told(seconds=_time(found[1], found[2])), _without(rest, found), False
    return Told(), rest, False


def _time(text: str, unit: str | None) -> float:
    number, _, under = text.replace("_", "-").partition("-")
    return float(number) / (float(under or 1) or 1.0) / (1000 if (unit or "").lower() == "ms" else 1)


def _without(text: str, found: re.Match[str]) -> str:
    return text[: found.start()] + text[found.end() :]


def _counted(seconds: Sequence[float | None]) -> bool:
    """Whether times are only 1, 2, 3 …: which exposure it is, not how long."""
    values = {s for s in seconds if s is not None}
    return len(values) > 2 and values in (set(range(len(values))), set(range(1, len(values) + 1)))


def _numbers(text: str) -> _Found:
    """The numbers of a name."""
    made: _Found = {}
    for level, part in enumerate(reversed(text.split("/"))):
        matches = list(_SIGNED.finditer(part))
        unnamed = 0
        for found in reversed(matches):
            word, sign = (found["word"] or "").lower(), found["sign"].lower().rstrip("_-") or found["sign"]
            if word in _MINUS | {"plus", "pos", "p"} and not sign:
                word, sign = "", word
            known = word if word in _AZIMUTHS | _HEIGHTS | {"l", "r", "left", "right"} else ""
            side = known in ("l", "r", "left", "right")
            before = part[found.start("sign") - 1 : found.start("sign")]
            glued = bool(before) and (before.isalnum() and not known)
            key = (level, unnamed, "side" if side else known)
            sign = ("minus" if known in ("l", "left") else "plus") if side and not sign else sign
            made[key] = _Number(known, sign, float(found["number"]), glued)
            unnamed += known == "" or side
    return made


def _angles(
    names: Sequence[_Found],
) -> tuple[list[float | None], list[float | None], list[int | None]]:
    """Azimuth and height of each name, and which of its light's exposures it is."""
    empty: list[Any] = [None] * len(names)
    left = [dict(name) for name in names]
    azimuths = _taken(left, _AZIMUTHS)
    heights = _taken(left, _HEIGHTS)
    running: list[int | None] = list(empty)
    if heights is not None and _is_count(heights) and len(set(heights)) < len(heights):
        running = [None if h is None else int(h) for h in heights]  # `e1` … `e5`: exposures
        heights = None
    bare = [key for key in dict.fromkeys(k for name in left for k in name) if all(key in n for n in left)]
    columns = {key: _signed([name[key] for name in left]) for key in bare}
    if azimuths is None and (len(names) > 1 or len(bare) == 1):
        signed = [key for key in bare if columns[key][1] and _within(columns[key][0], 180)]
        even = [key for key in bare if _directions(columns[key][0], len(names))]
        chosen = sorted(signed or even, key=lambda key: (key[0], -key[1]))[:2]
        if chosen:
            azimuths = list(columns[chosen[0]][0])
        if len(chosen) == 2 and heights is None and _within(columns[chosen[1]][0], 90):
            heights = list(columns[chosen[1]][0])
        bare = [key for key in bare if key not in chosen[: 1 if heights is None else 2]]
    if running == empty:
        counts = [columns[key][0] for key in bare if _is_count(columns[key][0])]
        running = next(([int(v) for v in c] for c in counts if len(set(c)) < len(c)), running)
    if azimuths is not None:
        azimuths = [None if a is None or not -180 <= a <= 360 else a - 360 * (a > 180) for a in azimuths]
    if heights is not None:
        heights = [None if h is None or abs(h) > 90 else h for h in heights]
    return azimuths or list(empty), heights or list(empty), running


def _taken(names: list[_Found], words: set[str]) -> list[float | None] | None:
    """The numbers after one of the words, which are removed, wherever they stand; None if no name has one."""
    made: list[float | None] = []
    for name in names:
        at = next((k for k in name if k[2] in words), None)
        one = name.pop(at) if at is not None else None
        made.append(None if one is None else -one.value if _is_minus(one.sign) else one.value)
    return made if any(v is not None for v in made) else None


def _is_minus(sign: str) -> bool:
    return sign in _MINUS or sign[-1:] in ("-", "\u2212")


def _signed(column: Sequence[_Number]) -> tuple[list[float], bool]:
    """The values, and whether signs tell (a hyphen that all have is none)."""
    hyphens = [one.hyphens for one in column]
    parts = len(column) > 1 and (any(one.glued for one in column) or min(hyphens) > 1)
    parting = min(hyphens) if parts else 0
    minus = [h > parting if h else _is_minus(one.sign) for h, one in zip(hyphens, column, strict=True)]
    plus = any(one.sign in ("+", "plus", "pos", "p") for one in column)
    values = [-one.value if m else one.value for one, m in zip(column, minus, strict=True)]
    return values, any(minus) or plus


def _within(values: Sequence[float], most: float) -> bool:
    return all(abs(v) <= most for v in values)


def _directions(values: Sequence[float], count: int) -> bool:
    """Whether unsigned numbers may be azimuths: several, round, and more than a count of the pictures."""
    different = sorted(set(values))
    if count == 1:
        return _within(values, 180)
    return len(different) > 1 and different[-1] <= 360 and all(v % 5 == 0 for v in different)


def _is_count(values: Sequence[float | None]) -> bool:
    different = {v for v in values if v is not None}
    first = min(different, default=-1)
    return 1 < len(different) <= _MOST_SHOTS and first in (0, 1) and different == {
        first + i for i in range(len(different))
    }  # fmt: skip
