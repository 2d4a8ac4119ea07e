"""Read-only arrays and maps: the building material of scene values."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from types import MappingProxyType
from typing import Any, TypeVar

import numpy as np
import numpy.typing as npt

K = TypeVar("K")
V = TypeVar("V")


def readonly(array: npt.ArrayLike, dtype: npt.DTypeLike, *tail: int) -> npt.NDArray[Any]:
    """A contiguous read-only array of `dtype` whose trailing shape is `tail` (-1: any length).

    An array that already is all of this is returned as it is, so that versions share it.
    Raises ValueError when the shape does not fit.
    """
    made = np.ascontiguousarray(array, dtype=dtype)
    if tail and (
        made.ndim != len(tail) or any(t not in (-1, s) for t, s in zip(tail, made.shape, strict=True))
    ):
        raise ValueError(f"expected an array of shape {tail}, got {made.shape}")
    if _can_change(made) and (made is array or made.base is not None):
        made = made.copy()
    made.flags.writeable = False
    return made


def _can_change(array: npt.NDArray[Any]) -> bool:
    """Whether somebody may write to these numbers, through this array or the one that owns them."""
    owner: object = array
    while isinstance(owner, np.ndarray):
        if owner.flags.writeable:
            return True
        owner = owner.base
    return False


def frozen_map(items: Mapping[K, V] | None = None) -> Mapping[K, V]:
    """A read-only copy of `items` that keeps their order."""
    return MappingProxyType(dict(items or {}))


def content_hash(*arrays: npt.NDArray[Any]) -> str:
    """Hex BLAKE2b-128 over shapes, dtypes and bytes: equal content gives equal text."""
    digest = hashlib.blake2b(digest_size=16)
    for array in arrays:
        digest.update(f"{array.dtype.str}{array.shape};".encode())
        digest.update(np.ascontiguousarray(array).data)
    return digest.hexdigest()
