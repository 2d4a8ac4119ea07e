"""Values that are made once for what they are made from."""

from __future__ import annotations

import operator
from collections.abc import Callable
from typing import Generic, TypeVar

T = TypeVar("T")


class Kept(Generic[T]):
    """The last value, for as long as the very same objects are asked for."""

    def __init__(self) -> None:
        self._key: tuple[object, ...] | None = None
        self._value: T | None = None

    def __call__(self, make: Callable[[], T], *key: object) -> T:
        """The value made from `key`; `make` is called where one of it is another object than last time."""
        known = self._key
        same = known is not None and len(known) == len(key) and all(map(operator.is_, known, key))
        if not same or self._value is None:
            self._key = self._value = None  # if making fails, nothing is kept
            self._value = make()
            self._key = key
        return self._value
