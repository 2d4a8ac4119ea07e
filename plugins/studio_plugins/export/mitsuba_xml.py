"""Mitsuba's scene format: elements with typed, named properties."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any
from xml.etree.ElementTree import Element, SubElement

import numpy as np
import numpy.typing as npt


def number(value: float) -> str:
    """Enough digits for a float32."""
    return f"{float(value):.9g}"


def put(
    parent: Element, tag: str, kind: str | None = None, *, name: str | None = None, key: str | None = None
) -> Element:
    """A new object under `parent`: `<tag type=kind name=name id=key>`."""
    given = {"type": kind, "name": name, "id": key}
    return SubElement(parent, tag, {k: v for k, v in given.items() if v is not None})


def prop(parent: Element, tag: str, name: str, value: object) -> None:
    """`<tag name=… value=…>`; booleans and numbers in Mitsuba's spelling."""
    if isinstance(value, bool):
        text = "true" if value else "false"
    elif isinstance(value, float | np.floating):
        text = number(float(value))
    else:
        text = str(value)
    SubElement(parent, tag, {"name": name, "value": text})


def rgb(parent: Element, name: str, colour: Sequence[float] | npt.NDArray[Any]) -> None:
    """Three linear components."""
    SubElement(parent, "rgb", {"name": name, "value": " ".join(number(c) for c in colour)})


def vector(parent: Element, name: str, values: Sequence[float] | npt.NDArray[Any]) -> None:
    """Three plain numbers."""
    axes = {axis: number(v) for axis, v in zip("xyz", values, strict=True)}
    SubElement(parent, "vector", {"name": name, **axes})


def ref(parent: Element, key: str, name: str | None = None) -> None:
    """A use of the object with that id."""
    SubElement(parent, "ref", {"id": key} if name is None else {"id": key, "name": name})


def matrix(parent: Element, name: str, values: npt.NDArray[np.float64]) -> None:
    """`<transform>` holding one 4×4 matrix for column vectors."""
    held = SubElement(parent, "transform", {"name": name})
    SubElement(held, "matrix", {"value": " ".join(number(v) for v in values.reshape(-1))})
