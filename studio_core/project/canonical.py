"""Canonical JSON: one text for one value, and a reader that trusts nothing.

Sorted keys, no spaces, ASCII only; floats by `repr`, so that they come back bit for bit.
"""

from __future__ import annotations

import hashlib
import json
import math
from typing import Any

from studio_core.errors import ProjectError

Json = None | bool | int | float | str | list[Any] | dict[str, Any]

MAX_TEXT = 4 << 20
MAX_DIGITS = 20


def dumps(value: Any, part: str) -> str:
    """Canonical text of `value`; ProjectError naming `part` when it holds what JSON cannot say."""
    try:
        text = json.dumps(value, sort_keys=True, separators=(",", ":"), allow_nan=False)
    except (TypeError, ValueError, RecursionError) as error:
        raise ProjectError(f"{part} cannot be saved: {error}") from None
    if len(text) > MAX_TEXT:
        raise ProjectError(f"{part} cannot be saved: it takes more than {MAX_TEXT >> 20} MB of text")
    return text


def text_hash(text: str) -> str:
    """Hex BLAKE2b-128 of a canonical text."""
    return hashlib.blake2b(text.encode("utf-8", "surrogatepass"), digest_size=16).hexdigest()


def loads(text: str, part: str, most: int = MAX_TEXT) -> Any:
    """The value of a JSON text; ProjectError naming `part` for anything a project never holds.

    Refused beyond what `json` refuses: NaN and infinities (also by overflow, 1e999), integers beyond
    20 digits, a key twice in one object, nesting beyond the interpreter's depth, texts over `most` (4 MB).
    """
    if len(text) > most:
        raise ProjectError(f"{part} is damaged: its text is too long")
    try:
        return json.loads(
            text,
            parse_float=_finite,
            parse_int=_short,
            parse_constant=_finite,
            object_pairs_hook=_unique,
        )
    except (ValueError, RecursionError) as error:
        cause = "nested too deeply" if isinstance(error, RecursionError) else str(error)
        raise ProjectError(f"{part} is damaged: {cause}") from None


def _finite(text: str) -> float:
    number = float(text)
    if not math.isfinite(number):
        raise ValueError(f"{text[:20]} is not a finite number")
    return number


def _short(text: str) -> int:
    if len(text) > MAX_DIGITS:
        raise ValueError(f"an integer of {len(text)} digits")
    return int(text)


def _unique(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    made = dict(pairs)
    if len(made) != len(pairs):
        raise ValueError("a key stands twice in one object")
    return made
