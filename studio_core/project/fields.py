"""How each kind of field is written as JSON and read back strictly.

A codec is found from the field's type hint once, when the module is loaded; a hint without a codec is a
TypeError there, so that a new field cannot be forgotten by the project file.
"""

from __future__ import annotations

import dataclasses
import math
import types
from collections.abc import Callable, Mapping
from typing import Any, Literal, Protocol, TypeVar, Union, get_args, get_origin, get_type_hints

import numpy as np

from studio_core.arrays import frozen_map
from studio_core.errors import ProjectError
from studio_core.params import Value, nearest, param_infos
from studio_core.scene.geometry import Geometry, Image, Table

Dataclass = TypeVar("Dataclass")


class Heavy(Protocol):
    """Where arrays go to and come from, as JSON."""

    def geometry_json(self, geometry: Geometry) -> Any:
        """References to a mesh's arrays."""

    def image_json(self, image: Image) -> Any:
        """Reference to a picture's pixels."""

    def table_json(self, table: Table) -> Any:
        """Reference to a table's numbers, and its name."""

    def geometry(self, value: Any, part: str) -> Geometry:
        """The mesh behind the references."""

    def image(self, value: Any, part: str) -> Image:
        """The picture behind the reference."""

    def table(self, value: Any, part: str) -> Table:
        """The table behind the reference."""


@dataclasses.dataclass(frozen=True)
class Codec:
    """`write(value, heavy, part) -> JSON` and `read(JSON, heavy, part) -> value`; both raise ProjectError."""

    write: Callable[[Any, Any, str], Any]
    read: Callable[[Any, Any, str], Any]


def wrong(part: str, wanted: str) -> ProjectError:
    """The error for a value that is not what the field holds."""
    return ProjectError(f"{part} is not {wanted}")


def _finite(number: Any, part: str) -> float:
    made = float(number)
    if not math.isfinite(made):
        raise wrong(part, "a finite number")
    return made


def _write_number(value: Any, heavy: Heavy, part: str) -> float:
    if not isinstance(value, int | float | np.integer | np.floating):
        raise wrong(part, "a number")
    return _finite(value, part)


def _read_number(value: Any, heavy: Heavy, part: str) -> float:
    if type(value) is not float:
        raise wrong(part, "a number")
    return _finite(value, part)


def _integer(value: Any, heavy: Heavy, part: str) -> int:
    if isinstance(value, bool) or not isinstance(value, int | np.integer) or abs(int(value)) >= 1 << 63:
        raise wrong(part, "a whole number")
    return int(value)


def _flag(value: Any, heavy: Heavy, part: str) -> bool:
    if not isinstance(value, bool | np.bool_):
        raise wrong(part, "true or false")
    return bool(value)


def _text(value: Any, heavy: Heavy, part: str) -> str:
    if not isinstance(value, str):
        raise wrong(part, "a text")
    return str(value)


NUMBER = Codec(_write_number, _read_number)
INTEGER, FLAG, TEXT = (Codec(check, check) for check in (_integer, _flag, _text))
GEOMETRY = Codec(lambda v, heavy, _: heavy.geometry_json(v), lambda v, heavy, part: heavy.geometry(v, part))
IMAGE = Codec(lambda v, heavy, _: heavy.image_json(v), lambda v, heavy, part: heavy.image(v, part))

TABLE = Codec(lambda v, heavy, _: heavy.table_json(v), lambda v, heavy, part: heavy.table(v, part))


def _write_value(value: Any, heavy: Heavy, part: str) -> Any:
    if isinstance(value, str):
        return str(value)
    if isinstance(value, bool | np.bool_):
        return bool(value)
    if isinstance(value, int | np.integer):
        return _integer(value, heavy, part)
    if isinstance(value, tuple | list) and len(value) == 3:
        return [_write_number(number, heavy, part) for number in value]
    return _write_number(value, heavy, part)


def _read_value(value: Any, heavy: Heavy, part: str) -> Any:
    if isinstance(value, str | bool):
        return value
    if isinstance(value, int):
        return _integer(value, heavy, part)
    if isinstance(value, list) and len(value) == 3:
        return tuple(_read_number(number, heavy, part) for number in value)
    return _read_number(value, heavy, part)


VALUE = Codec(_write_value, _read_value)


def optional(inner: Codec) -> Codec:
    """`inner` or None."""
    return Codec(
        lambda v, heavy, part: None if v is None else inner.write(v, heavy, part),
        lambda v, heavy, part: None if v is None else inner.read(v, heavy, part),
    )


def choice(options: tuple[Any, ...]) -> Codec:
    """One of some texts."""

    def check(value: Any, heavy: Heavy, part: str) -> Any:
        if not isinstance(value, str) or value not in options:
            raise wrong(part, f"one of {', '.join(options)}")
        return value

    return Codec(check, check)


def many(inner: Codec, length: int | None) -> Codec:
    """A tuple of `length` values, or of any number."""

    def fits(value: Any, part: str) -> None:
        if not isinstance(value, list | tuple) or (length is not None and len(value) != length):
            raise wrong(part, "a list" if length is None else f"a list of {length}")

    def write(value: Any, heavy: Heavy, part: str) -> Any:
        fits(value, part)
        return [inner.write(v, heavy, part) for v in value]

    def read(value: Any, heavy: Heavy, part: str) -> Any:
        fits(value, part)
        return tuple(inner.read(v, heavy, part) for v in value)

    return Codec(write, read)


def mapping(inner: Codec) -> Codec:
    """Values by name."""

    def write(value: Any, heavy: Heavy, part: str) -> Any:
        if not isinstance(value, Mapping) or not all(isinstance(key, str) for key in value):
            raise wrong(part, "a list of named values")
        return {key: inner.write(v, heavy, f"{part} ▸ {key}") for key, v in value.items()}

    def read(value: Any, heavy: Heavy, part: str) -> Any:
        if not isinstance(value, dict):
            raise wrong(part, "a list of named values")
        return frozen_map({key: inner.read(v, heavy, f"{part} ▸ {key}") for key, v in value.items()})

    return Codec(write, read)


class Record:
    """The codec of a dataclass: every field by name, nothing else.

    Fields that follow from others (`init=False`) are made again when it is read. A missing field takes its
    default (files of this format from before the field was added); an unknown one is refused, for leaving
    it out would lose what a newer program saved. A number out of its parameter's range is brought into it:
    the project opens, and kernels get what they are made for.
    """

    def __init__(self, cls: type[Any]) -> None:
        hints = get_type_hints(cls)
        self.cls = cls
        kept = [f for f in dataclasses.fields(cls) if f.init]
        self.fields = {f.name: codec_for(hints[f.name]) for f in kept}
        missing = dataclasses.MISSING
        self.ranges = param_infos(cls)
        self.needed = {f.name for f in kept if f.default is missing and f.default_factory is missing}

    def write(self, value: Any, heavy: Any, part: str) -> dict[str, Any]:
        """JSON object of an instance."""
        if type(value) is not self.cls:
            raise wrong(part, f"a {self.cls.__name__}")
        return {
            name: codec.write(getattr(value, name), heavy, f"{part} ▸ {name}")
            for name, codec in self.fields.items()
        }

    def read(self, value: Any, heavy: Any, part: str) -> Any:
        """The instance of a JSON object."""
        if not isinstance(value, dict):
            raise wrong(part, f"a {self.cls.__name__}")
        for name in value:
            if name not in self.fields:
                raise ProjectError(f"{part} has the unknown field {name[:40]!r}; a newer Lucarne may know it")
        for name in self.needed:
            if name not in value:
                raise ProjectError(f"{part} lacks the field {name!r}")
        made = {name: self.fields[name].read(v, heavy, f"{part} ▸ {name}") for name, v in value.items()}
        made |= {name: nearest(info, made[name]) for name, info in self.ranges.items() if name in made}
        try:
            return self.cls(**made)
        except (ValueError, TypeError) as error:
            raise ProjectError(f"{part} is damaged: {error}") from None


_ATOMS: dict[Any, Codec] = {
    float: NUMBER,
    int: INTEGER,
    bool: FLAG,
    str: TEXT,
    Geometry: GEOMETRY,
    Image: IMAGE,
    Table: TABLE,
}


def codec_for(hint: Any) -> Codec:
    """The codec of a type hint; TypeError when there is none."""
    if hint in _ATOMS:
        return _ATOMS[hint]
    if hint == Value:
        return VALUE
    origin, args = get_origin(hint), get_args(hint)
    if origin in (Union, types.UnionType) and len(args) == 2 and args[1] is type(None):
        return optional(codec_for(args[0]))
    if origin is tuple:
        if args[-1] is Ellipsis:
            return many(codec_for(args[0]), None)
        if len(set(args)) == 1:
            return many(codec_for(args[0]), len(args))
    if origin is Literal:
        return choice(args)
    if isinstance(origin, type) and issubclass(origin, Mapping) and args[0] is str:
        return mapping(codec_for(args[1]))
    if dataclasses.is_dataclass(hint) and isinstance(hint, type):
        record = Record(hint)
        return Codec(record.write, record.read)
    raise TypeError(f"the project file cannot hold a field of type {hint}")
