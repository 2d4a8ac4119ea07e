"""What was computed for an object, kept as long as the object lives and found by its identity.

Scene values are compared by content and materials cannot be hashed at all, so neither a dict nor a
WeakKeyDictionary will do.
"""

from __future__ import annotations

import weakref
from collections.abc import Callable
from typing import Any, Generic, TypeVar

T = TypeVar("T")


class Memo(Generic[T]):
    """Remembers `make(obj)` for every living object. Threads may share it: at worst a value is made twice."""

    def __init__(self, make: Callable[[Any], T]) -> None:
        self._make = make
        self._known: dict[int, tuple[weakref.ref[Any], T]] = {}

    def __call__(self, obj: object) -> T:
        """`make(obj)`, computed once."""
        found = self._known.get(id(obj))
        if found is not None and found[0]() is obj:
            return found[1]
        made = self._make(obj)
        self.remember(obj, made)
        return made

    def known(self, obj: object) -> T | None:
        """What is remembered of `obj`."""
        found = self._known.get(id(obj))
        return found[1] if found is not None and found[0]() is obj else None

    def remember(self, obj: object, made: T) -> None:
        """Take `made`, computed elsewhere, for `make(obj)`."""
        key, known = id(obj), self._known

        def forget(dead: weakref.ref[Any]) -> None:
            entry = known.get(key)
            if entry is not None and entry[0] is dead:
                del known[key]

        known[key] = (weakref.ref(obj, forget), made)

    def __len__(self) -> int:
        return len(self._known)
