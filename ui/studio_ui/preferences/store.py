"""The values of the preferences: read from the settings, checked, followed."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from studio_core.errors import InputError
from studio_core.params import Value, check
from studio_ui.preferences.catalogue import ALL, BY_NAME
from studio_ui.settings import Settings


class Preferences:
    """Values by name. What does not fit (a damaged file, an older version) is the default."""

    def __init__(self, settings: Settings) -> None:
        self._settings = settings
        self._bound: dict[str, list[Callable[[Any], object]]] = {}
        self._known = {preference.name: self.get(preference.name) for preference in ALL}
        self._off = settings.changed.connect(self._changed)

    def close(self) -> None:
        """Stop following."""
        self._off()

    def get(self, name: str) -> Any:
        """The value, of the preference's own type."""
        preference = BY_NAME[name]
        stored = self._settings.get(name)
        if stored is None or isinstance(stored, bool) != isinstance(preference.default, bool):
            return preference.default
        try:
            return check(name, preference.info, stored)
        except InputError:
            return preference.default

    def set(self, name: str, value: Value) -> None:
        """Another value, at once. InputError when it does not fit."""
        preference = BY_NAME[name]
        fit = check(name, preference.info, value)
        self._settings.set(name, None if fit == preference.default else fit)

    def is_default(self, name: str) -> bool:
        """Whether it is as at the first start."""
        return bool(self.get(name) == BY_NAME[name].default)

    def reset(self, name: str) -> None:
        """As at the first start."""
        self._settings.set(name, None)

    def bind(self, name: str, apply: Callable[[Any], object]) -> Callable[[], None]:
        """Call `apply(value)` when it changes; what is returned ends that."""
        told = self._bound.setdefault(BY_NAME[name].name, [])
        told.append(apply)
        return lambda: told.remove(apply) if apply in told else None

    def _changed(self, name: str) -> None:
        if name not in BY_NAME:
            return
        value = self.get(name)
        if value != self._known[name]:
            self._known[name] = value
            for apply in list(self._bound.get(name, ())):
                apply(value)
