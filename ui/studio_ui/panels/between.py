"""A part of the shading panel: light between surfaces, its method, and which light is looked at."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from PySide6.QtCore import QSignalBlocker
from PySide6.QtWidgets import QCheckBox, QFormLayout, QVBoxLayout, QWidget

from studio_core.contract import IndirectMethod
from studio_core.errors import PluginError
from studio_core.params import Value, defaults, param_infos
from studio_core.session import ALL, DIRECT, INDIRECT, SHARE
from studio_ui.context import Context, Subscriptions
from studio_ui.feed import Shown
from studio_ui.forms.fields import Combo
from studio_ui.forms.param_form import ParamForm, form_label, form_layout
from studio_ui.forms.sinks import PlainSink
from studio_ui.look.theme import GAP
from studio_ui.panels.panel import clear, heading, note
from studio_ui.views.between import KIND, Between

SHOWN = {
    ALL: "All light",
    DIRECT: "Straight from lamps and sky",
    INDIRECT: "From other surfaces",
    SHARE: "Share from other surfaces",
}
"""Which light is looked at, in words."""
BOUNCES = "bounces"
SETTLES = ("settle", "converged")
"""Flags of methods that make their number of bounces idle."""
_WORDS = {
    "rays": "rays from every point",
    "lobe_rays": "more where it is glossy",
    "inner_rays": "from hidden points",
    "functions": "functions of glossy surfaces",
    "paths a vertex": "paths from every point",
    "bounces": "bounces",
    "rounds": "rounds over all surfaces",
    "lobe_error": "error of the sharpest gloss as a source",
    "N": "functions of an object's light (N)",
    "K": "functions of a surface's gloss (K)",
    "shells": "shells around every object",
}
"""What is told of a method's facts; others are told by their names."""


class BetweenSection(QWidget):
    """Follows the session; all it changes is the session."""

    def __init__(self, context: Context) -> None:
        super().__init__()
        self._context, self._between = context, Between(context)
        self.form: ParamForm | None = None
        self.box, self.combo, self.shown = QCheckBox(), Combo(), Combo()
        self.box.setAccessibleName("Light between surfaces")
        self.box.setToolTip("Light goes on from surface to surface: colours tint what stands beside them")
        self.combo.setAccessibleName("Method of light between surfaces")
        self.shown.setAccessibleName("Light shown")
        for light, words in SHOWN.items():
            self.shown.addItem(words, light)
        self.facts, self.notes = note(""), note("")
        self._names: tuple[str, ...] = ()
        self._built: tuple[object, ...] | None = None
        column = QVBoxLayout(self)
        column.setContentsMargins(0, GAP, 0, 0)
        column.setSpacing(GAP)
        column.addWidget(heading("Light between surfaces"))
        rows = QWidget()
        self._rows: QFormLayout = form_layout(rows)
        self._rows.addRow(form_label("On", self.box.toolTip()), self.box)
        self._rows.addRow(form_label("Method", "How it is computed"), self.combo)
        self._own = QVBoxLayout()
        self._own.setSpacing(GAP)
        below = QWidget()
        form_layout(below).addRow(form_label("Look at", "Which light the picture shows"), self.shown)
        column.addWidget(rows)
        column.addLayout(self._own)
        for widget in (self.notes, below, self.facts):
            column.addWidget(widget)
        self.box.toggled.connect(self._between.bounce)
        self.combo.activated.connect(lambda index: context.session.bounce(True, self._names[index]))
        self.shown.activated.connect(lambda index: self._between.show(self.shown.itemData(index)))
        self._subscriptions = Subscriptions()
        self._subscriptions.add(
            context.warmed.connect(self.refresh),
            context.session.changed.connect(lambda _: self.refresh()),
            context.feed.shown.connect(self._told),
        )
        self.refresh()

    def close_panel(self) -> None:
        """Stop listening."""
        self._subscriptions.close()

    def refresh(self) -> None:
        """What the session has now."""
        session, warm, on = self._context.session, self._context.warm, self._between.on
        method = self._method(session.indirect) if on else None
        self._offer(warm)
        with QSignalBlocker(self.box):
            self.box.setChecked(on)
        self.box.setEnabled(warm and bool(self._names))
        self.combo.setCurrentIndex(self._names.index(session.indirect) if on else -1)
        self._rows.setRowVisible(self.combo, on)
        self.shown.setCurrentIndex(self.shown.findData(session.light))
        self._build(method)
        self.notes.setText(str(getattr(method, "notes", "")))
        self.notes.setVisible(bool(self.notes.text()))
        if self.form is not None and method is not None:
            values = {**defaults(method.Params), **session.indirect_params.get(session.indirect, {})}
            self.form.show_values(values)
            self.form.show_row(BOUNCES, not any(values.get(name) is True for name in SETTLES))
        self._told(self._context.feed.last)

    def _offer(self, warm: bool) -> None:
        """The methods that there are, by their labels once they are loaded."""
        found = tuple((name, self._label(name)) for name in self._between.methods)
        if found != tuple((self.combo.itemData(i), self.combo.itemText(i)) for i in range(len(found))) or (
            len(found) != self.combo.count()
        ):
            self._names = tuple(name for name, _ in found)
            with QSignalBlocker(self.combo):
                self.combo.clear()
                for name, label in found:
                    self.combo.addItem(label, name)
        self.combo.setEnabled(warm)

    def _build(self, method: IndirectMethod | None) -> None:
        """The method's own parameters."""
        wanted = None if method is None else (method, self._context.session.indirect)
        if wanted == self._built:
            return
        self._built = wanted
        unfolded = self.form is not None and self.form.more is not None and self.form.more.isChecked()
        clear(self._own)
        self.form = None
        if method is not None:
            self.form = ParamForm(param_infos(method.Params), PlainSink(self._set), unfolded=unfolded)
            self._own.addWidget(self.form)

    def _method(self, name: str) -> IndirectMethod | None:
        if not self._context.warm:
            return None
        try:
            made: IndirectMethod = self._context.host.get(KIND, name)
        except PluginError:
            return None
        return made

    def _label(self, name: str) -> str:
        method = self._method(name)
        return name if method is None else method.label

    def _set(self, name: str, value: Value) -> None:
        session = self._context.session
        known: Mapping[str, Any] = session.indirect_params.get(session.indirect, {})
        session.bounce(params={**known, name: value})

    def _told(self, shown: Shown | None) -> None:
        facts = {} if shown is None else shown.picture.radiance.facts
        self.facts.setText(told_facts(facts))
        self.facts.setVisible(bool(facts))


def told_facts(facts: Mapping[str, float]) -> str:
    """What a method tells of itself, in a line."""
    parts = []
    for name, value in facts.items():
        if name.startswith("bytes"):
            kept = name.removeprefix("bytes").strip(" _").replace("_", " ")
            parts.append(f"{value / 1e6:,.1f} MB {kept or 'in memory'}")
        elif name.endswith("error"):
            parts.append(f"{100 * value:.0f} % {_WORDS.get(name, name.replace('_', ' '))}")
        else:
            parts.append(f"{value:,.6g} {_WORDS.get(name, name.replace('_', ' '))}")
    return ", ".join(parts)


__all__ = ["SHOWN", "BetweenSection", "told_facts"]
