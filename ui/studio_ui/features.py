"""Features of the window: what brings handlers of actions and the conditions they depend on."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Protocol, TypeVar

Handler = Callable[[], object]
Condition = Callable[[], bool]
_T = TypeVar("_T")


class Feature(Protocol):
    """Something the window is put together from."""

    def handlers(self) -> Mapping[str, Handler]:
        """What is done, by action id."""
        ...

    def conditions(self) -> Mapping[str, Condition]:
        """What `ActionSpec.enabled` and `ActionSpec.checked` ask, by name."""
        ...


def gather(features: Iterable[Feature]) -> tuple[dict[str, Handler], dict[str, Condition]]:
    """The handlers and conditions of all features; ValueError when two bring the same one."""
    handlers: dict[str, Handler] = {}
    conditions: dict[str, Condition] = {}
    for feature in features:
        _merge(handlers, feature.handlers(), feature)
        _merge(conditions, feature.conditions(), feature)
    return handlers, conditions


def _merge(into: dict[str, _T], more: Mapping[str, _T], feature: Feature) -> None:
    twice = into.keys() & more.keys()
    if twice:
        raise ValueError(f"{type(feature).__name__} brings {', '.join(sorted(twice))} a second time")
    into.update(more)
