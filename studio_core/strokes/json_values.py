"""Values of JSON that people write, checked strictly: each mistake is one sentence that names its place."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from studio_core.errors import InputError
from studio_core.params import ParamInfo, check, param_infos
from studio_core.scene.transform import Vec3

F64 = npt.NDArray[np.float64]
I64 = npt.NDArray[np.int64]

LARGEST = 1e30


def known(value: Any, names: Iterable[str], part: str) -> dict[str, Any]:
    """An object that has no other names."""
    names = tuple(names)
    if not isinstance(value, dict):
        raise InputError(f"{part}: expected an object with names, such as {', '.join(names[:3])}")
    for name in value:
        if name not in names:
            raise InputError(f"{part}: there is no {name[:40]!r} here; known: {', '.join(names)}")
    return value


def parameters(owner: type, values: Mapping[str, Any], part: str) -> dict[str, Any]:
    """Values in the ranges of a dataclass's parameters, of the types that JSON has for them."""
    infos = param_infos(owner)
    return {name: parameter(value, infos[name], f"{part}, {name}") for name, value in values.items()}


def parameter(value: Any, info: ParamInfo, part: str) -> Any:
    """One of them."""
    if info.kind in ("number", "integer") and type(value) not in (int, float):
        raise InputError(f"{part}: expected a number")
    if info.kind in ("text", "choice") and not isinstance(value, str):
        raise InputError(f"{part}: expected a text")
    return check(part, info, value)


def flag(value: Any, part: str) -> bool:
    """True or false."""
    if not isinstance(value, bool):
        raise InputError(f"{part}: expected true or false")
    return value


def entries(value: Any, most: int, part: str) -> list[Any]:
    """A list that is not empty."""
    if not isinstance(value, list) or not 1 <= len(value) <= most:
        raise InputError(f"{part}: expected a list of 1 to {most}")
    return value


def numbers(value: Any, most: int, widths: tuple[int, ...], part: str) -> F64:
    """(N, K) from a list of lists that all have one of the lengths `widths`."""
    rows = entries(value, most, part)
    width = len(rows[0]) if isinstance(rows[0], list) else 0
    if width not in widths:
        raise InputError(f"{part}: expected {' or '.join(map(str, widths))} numbers in each entry")
    for row in rows:
        fits = isinstance(row, list) and len(row) == width
        if not fits or not all(type(one) in (int, float) for one in row):
            raise InputError(f"{part}: expected {width} numbers in each entry")
    made = np.array(rows, np.float64)
    if (np.abs(made) > LARGEST).any():
        raise InputError(f"{part}: numbers of that size cannot be used")
    return made


def vector(value: Any, part: str) -> Vec3:
    """Three numbers."""
    x, y, z = (float(one) for one in numbers([value], 1, (3,), part)[0])
    return (x, y, z)


def counts(value: Any, size: int, most: int, part: str) -> I64:
    """(size,) whole numbers below `most`."""
    if not isinstance(value, list) or len(value) != size:
        raise InputError(f"{part}: expected {size} whole numbers, one a place")
    if not all(type(one) is int and 0 <= one < most for one in value):
        raise InputError(f"{part}: expected whole numbers from 0 to {most - 1}")
    return np.array(value, np.int64)


__all__ = ["counts", "entries", "flag", "known", "numbers", "parameter", "parameters", "vector"]
