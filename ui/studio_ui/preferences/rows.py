"""One page of preferences: a row for each, with its reset button and what it means."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

from PySide6.QtCore import QSignalBlocker, Qt
from PySide6.QtWidgets import QLabel, QSizePolicy, QVBoxLayout, QWidget

from studio_ui.forms.fields import FIELDS, Combo, Field
from studio_ui.forms.param_form import form_label, form_layout
from studio_ui.forms.reset_button import ResetButton, beside
from studio_ui.forms.sinks import PlainSink, Sink
from studio_ui.panels.panel import note
from studio_ui.preferences.catalogue import Preference
from studio_ui.preferences.store import Preferences

_LABEL, _FIELD = 170, 300
_TOP = 5  # pixels above a label, so that it stands beside its field


class _Choice(Field):
    """A choice whose values have names for people."""

    def __init__(self, preference: Preference, sink: Sink) -> None:
        super().__init__(preference.name, preference.info, sink)
        self.combo = Combo()
        self.combo.setAccessibleName(preference.info.label)
        for value, label in preference.labels.items():
            self.combo.addItem(label, value)
        self.row.addWidget(self.combo, 1)
        self.combo.activated.connect(lambda i: sink.apply(self.name, self.combo.itemData(i)))

    def show_value(self, value: Any) -> None:
        """What is kept."""
        with QSignalBlocker(self.combo):
            self.combo.setCurrentIndex(self.combo.findData(value))


class PreferenceRows(QWidget):
    """The preferences of one page; follows them, whoever changes them."""

    def __init__(self, preferences: Preferences, listed: Iterable[Preference]) -> None:
        super().__init__()
        self.fields: dict[str, Field] = {}
        self._preferences = preferences
        self._buttons: dict[str, ResetButton] = {}
        self._off: list[Callable[[], None]] = []
        column = QVBoxLayout(self)
        column.setContentsMargins(0, 0, 0, 0)
        rows = form_layout(inside := QWidget())
        column.addWidget(inside)
        column.addStretch(1)
        for preference in listed:
            self._add(rows, preference)

    def close_panel(self) -> None:
        """Stop following."""
        while self._off:
            self._off.pop()()

    def _add(self, rows: Any, preference: Preference) -> None:
        name, info = preference.name, preference.info
        sink = PlainSink(self._preferences.set)
        field = _Choice(preference, sink) if info.kind == "choice" else FIELDS[info.kind](name, info, sink)
        field.setFixedWidth(_FIELD)
        reset = ResetButton(info.label, lambda: self._preferences.reset(name))
        label = form_label(info.label, info.doc, field)
        label.setFixedWidth(_LABEL)
        label.setAlignment(Qt.AlignmentFlag.AlignLeft | Qt.AlignmentFlag.AlignTop)
        label.setContentsMargins(0, _TOP, 0, 0)
        told = info.doc + (" (from the next start on)" if preference.restart else "")
        cell = QWidget()
        column = QVBoxLayout(cell)
        column.setContentsMargins(0, 0, 0, 10)
        column.setSpacing(2)
        column.addWidget(beside(field, reset), 0, Qt.AlignmentFlag.AlignLeft)
        doc: QLabel = note(f"{told}.")
        doc.setSizePolicy(QSizePolicy.Policy.Ignored, QSizePolicy.Policy.Preferred)
        column.addWidget(doc)
        rows.addRow(label, cell)
        self.fields[name], self._buttons[name] = field, reset
        self._off.append(self._preferences.bind(name, lambda _: self._follow(name)))
        self._follow(name)

    def _follow(self, name: str) -> None:
        self.fields[name].show_value(self._preferences.get(name))
        self._buttons[name].offer(not self._preferences.is_default(name))
