"""Forms made from parameter metadata: ranges, units and labels are data, so nothing here knows a model."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QFormLayout, QLabel, QToolButton, QWidget

from studio_core.params import ParamInfo
from studio_ui.fields import FIELDS, Field, NumberField, tip
from studio_ui.sinks import Sink
from studio_ui.spin import ScrubLabel
from studio_ui.theme import GAP

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
    ) -> None:
        super().__init__()
        self.fields: dict[str, Field] = {}
        self.more: QToolButton | None = None
        layout = form_layout(self)
        shown = {name: info for name, info in infos.items() if name not in skip}
        for name, info in shown.items():
            if not info.advanced:
                self._add(layout, name, info, sink)
        folded = {name: info for name, info in shown.items() if info.advanced}
        if folded:
            inside = QWidget()
            rows = form_layout(inside)
            for name, info in folded.items():
                self._add(rows, name, info, sink)
            self.more = _fold(inside, unfolded)
            layout.addRow(self.more)
            layout.addRow(inside)

    def _add(self, layout: QFormLayout, name: str, info: ParamInfo, sink: Sink) -> None:
        self.fields[name] = field = FIELDS[info.kind](name, info, sink)
        layout.addRow(form_label(info.label, tip(info), field), field)

    def show_values(self, values: Mapping[str, Any]) -> None:
        """What the scene has now; names without a field are left alone."""
        for name, value in values.items():
            if name in self.fields:
                self.fields[name].show_value(value)


def _fold(inside: QWidget, unfolded: bool) -> QToolButton:
    """A button that shows and hides `inside`."""
    button = QToolButton()
    button.setText("More")
    button.setToolTip("What seldom needs to be changed")
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
    label.setProperty("role", "dim")
    label.setFixedWidth(_LABEL)
    label.setMinimumHeight(26)
    label.setWordWrap(True)
    label.setToolTip(tool_tip)
    return label
