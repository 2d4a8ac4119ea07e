"""Forms made from parameter metadata: ranges, units and labels are data, so nothing here knows a model."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import Any

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QFormLayout, QLabel, QToolButton, QWidget

from studio_core.params import ParamInfo, Value
from studio_ui.forms.fields import FIELDS, Field, NumberField, tip
from studio_ui.forms.reset_button import ResetButton, beside
from studio_ui.forms.sinks import Sink
from studio_ui.forms.spin import ScrubLabel
from studio_ui.look.theme import GAP
from studio_ui.panels.panel import heading

_LABEL = 92  # pixels


class ParamForm(QWidget):
    """A row for every parameter; `show_values` follows the scene without telling the sink.

    Advanced ones are below the others, folded up behind `more` until it is pressed.
    """

    def __init__(
        self,
        infos: Mapping[str, ParamInfo],
        sink: Sink,
        skip: tuple[str, ...] = (),
        *,
        unfolded: bool = False,
        defaults: Mapping[str, Value] | None = None,
        special: Mapping[str, type[Field]] | None = None,
        sections: Mapping[str, tuple[str, ...]] | None = None,
    ) -> None:
        """With `defaults`, what differs from them has a button that brings them back.

        `special` has other controls by parameter; `sections` are names under headings, below the others.
        """
        super().__init__()
        self._defaults, self._special = defaults or {}, special or {}
        self._rows: dict[str, tuple[QFormLayout, QWidget]] = {}
        self._resets: dict[str, ResetButton] = {}
        self.fields: dict[str, Field] = {}
        self.more: QToolButton | None = None
        layout = form_layout(self)
        shown = {name: info for name, info in infos.items() if name not in skip}
        apart = {name for names in (sections or {}).values() for name in names}
        for name, info in shown.items():
            if not info.advanced and name not in apart:
                self._add(layout, name, info, sink)
        for title, names in (sections or {}).items():
            there = [name for name in names if name in shown]
            if there:
                layout.addRow(heading(title))
            for name in there:
                self._add(layout, name, shown[name], sink)
        folded = {name: info for name, info in shown.items() if info.advanced and name not in apart}
        if folded:
            inside = QWidget()
            rows = form_layout(inside)
            for name, info in folded.items():
                self._add(rows, name, info, sink)
            self.more = fold(inside, "More", "What seldom needs to be changed", unfolded)
            layout.addRow(self.more)
            layout.addRow(inside)

    def _add(self, layout: QFormLayout, name: str, info: ParamInfo, sink: Sink) -> None:
        made = self._special.get(name, FIELDS[info.kind])
        self.fields[name] = field = made(name, info, sink)
        default = self._defaults.get(name)
        shown: QWidget = field
        if default is not None and info.kind != "text":
            self._resets[name] = reset = ResetButton(info.label, lambda: sink.apply(name, default))
            shown = beside(field, reset)
        self._rows[name] = (layout, shown)
        layout.addRow(form_label(info.label, tip(info), field), shown)

    def show_row(self, name: str, visible: bool) -> None:
        """Leave a parameter out, or have it again; one without a field is none."""
        if name in self._rows:
            layout, shown = self._rows[name]
            layout.setRowVisible(shown, visible)

    def show_values(self, values: Mapping[str, Any], mixed: Collection[str] = ()) -> None:
        """What the scene has now, of `mixed` ones the last; names without a field are left alone."""
        for name, value in values.items():
            if name not in self.fields:
                continue
            if name in mixed:
                self.fields[name].show_mixed(value)
            else:
                self.fields[name].show_value(value)
            if name in self._resets:
                self._resets[name].offer(name in mixed or value != self._defaults[name])


def fold(inside: QWidget, text: str, tool_tip: str, unfolded: bool = False) -> QToolButton:
    """A button that shows and hides `inside`."""
    button = QToolButton()
    button.setText(text)
    button.setToolTip(tool_tip)
    button.setCheckable(True)
    button.setAutoRaise(True)
    button.setProperty("role", "fold")
    button.setToolButtonStyle(Qt.ToolButtonStyle.ToolButtonTextBesideIcon)

    def turn(open_: bool) -> None:
        button.setArrowType(Qt.ArrowType.DownArrow if open_ else Qt.ArrowType.RightArrow)
        inside.setVisible(open_)

    button.toggled.connect(turn)
    button.setChecked(unfolded)
    turn(unfolded)
    return button


def form_layout(parent: QWidget) -> QFormLayout:
    """Labels left, controls as wide as they can."""
    layout = QFormLayout(parent)
    layout.setContentsMargins(0, 0, 0, 0)
    layout.setHorizontalSpacing(GAP + 2)
    layout.setVerticalSpacing(GAP)
    layout.setFieldGrowthPolicy(QFormLayout.FieldGrowthPolicy.AllNonFixedFieldsGrow)
    layout.setLabelAlignment(Qt.AlignmentFlag.AlignLeft | Qt.AlignmentFlag.AlignVCenter)
    return layout


def form_label(text: str, tool_tip: str = "", field: QWidget | None = None) -> QLabel:
    """A row's label: all as wide, so that forms line up; that of a number can be dragged."""
    label = ScrubLabel(text, field.spin) if isinstance(field, NumberField) else QLabel(text)
    form_label_like(label, tool_tip)
    return label


def form_label_like(label: QLabel, tool_tip: str) -> None:
    """Make a label look like all others in forms."""
    label.setProperty("role", "dim")
    label.setFixedWidth(_LABEL)
    label.setMinimumHeight(26)
    label.setWordWrap(True)
    label.setToolTip(tool_tip)
