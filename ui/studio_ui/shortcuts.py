"""The keys of the actions: those of the catalogue, and what a person has made of them."""

from __future__ import annotations

from collections.abc import Mapping

from PySide6.QtCore import Qt
from PySide6.QtGui import QKeySequence

from studio_core.signal import Signal
from studio_ui.actions.catalogue import specs
from studio_ui.settings import Settings

_KEPT = "shortcuts"
_TAKEN = {
    "Esc": "Esc cancels what is under way",
    "Tab": "Tab goes from control to control",
    "Shift+Tab": "Shift+Tab goes from control to control",
    "Shift+Backtab": "Shift+Tab goes from control to control",
    "Return": "Enter takes what was typed",
    "Enter": "Enter takes what was typed",
    "Space": "Space presses buttons",
    "Shift+F10": "Shift+F10 opens the context menu",
    "Menu": "This key opens the context menu",
}
"""Keys that no action can have, and why. In Qt's portable spelling."""
_CANVAS = ("Tab",)
"""Of these, what actions of the picture alone can have: F6 goes on from there."""
_MODIFIERS = (Qt.Key.Key_Control, Qt.Key.Key_Shift, Qt.Key.Key_Alt, Qt.Key.Key_Meta, Qt.Key.Key_AltGr)


class Shortcuts:
    """Keys by action id, in Qt's portable spelling (`Ctrl+Shift+P`); empty where there is none.

    No two actions have the same key, wherever they work: Qt would run neither. What a person chose comes
    before the catalogue, also before keys that a later version gives to something new.
    """

    def __init__(self, settings: Settings, defaults: Mapping[str, str] | None = None) -> None:
        self.changed: Signal[[]] = Signal()
        self._settings = settings
        given = {spec.id: spec.shortcut for spec in specs()} if defaults is None else defaults
        self._canvas = {spec.id for spec in specs() if spec.canvas}
        self._defaults = {name: portable(keys) for name, keys in given.items()}
        stored = settings.get(_KEPT, {})
        self._own: dict[str, str] = {}
        for name, keys in stored.items():
            if name in self._defaults and isinstance(keys, str) and (not keys or portable(keys)):
                fresh = portable(keys)
                if not fresh or (fresh not in self._own.values() and not self.refuses(name, fresh)):
                    self._own[name] = fresh

    def of(self, name: str) -> str:
        """The key of an action."""
        if name in self._own:
            return self._own[name]
        usual = self._defaults[name]
        return "" if usual in self._own.values() else usual

    def default(self, name: str) -> str:
        """What the catalogue says."""
        return self._defaults[name]

    def is_own(self, name: str) -> bool:
        """Whether a person has changed it."""
        return self.of(name) != self._defaults[name]

    def holder(self, keys: str, *, but: str = "") -> str:
        """The action that has a key, other than `but`; empty when there is none."""
        keys = portable(keys)
        if not keys:
            return ""
        return next((name for name in self._defaults if name != but and self.of(name) == keys), "")

    def give(self, name: str, keys: str) -> None:
        """Give an action a key (or none), and take it from whatever had it. ValueError for keys refused."""
        fresh = portable(keys)
        if self.refuses(name, fresh) or (keys and not fresh):
            raise ValueError(self.refuses(name, fresh) or f"{keys} is no key")
        loser = self.holder(fresh, but=name)
        if loser:
            self._own[loser] = ""
        self._own[name] = fresh
        self._keep()

    def refuses(self, name: str, keys: str) -> str:
        """Why an action cannot have a key; empty when it can."""
        return "" if keys in _CANVAS and name in self._canvas else _TAKEN.get(keys, "")

    def reset(self, name: str) -> None:
        """The key of the catalogue again, taken from whatever has it now."""
        self.give(name, self._defaults[name])

    def reset_all(self) -> None:
        """Every key as in the catalogue."""
        self._own.clear()
        self._keep()

    def _keep(self) -> None:
        """Remember what differs from the catalogue."""
        now = {name: self.of(name) for name in self._defaults}
        self._own = {name: keys for name, keys in now.items() if keys != self._defaults[name]}
        self._settings.set(_KEPT, dict(self._own) or None)
        self.changed.emit()


def portable(keys: str) -> str:
    """One key in Qt's portable spelling; empty when it is none."""
    sequence = QKeySequence(keys, QKeySequence.SequenceFormat.PortableText)
    if sequence.count() != 1 or sequence[0].key() in (Qt.Key.Key_unknown, *_MODIFIERS):
        return ""
    return sequence.toString(QKeySequence.SequenceFormat.PortableText)


def shown(keys: str) -> str:
    """The key as this system writes it."""
    return QKeySequence(keys).toString(QKeySequence.SequenceFormat.NativeText)
