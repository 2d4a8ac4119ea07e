"""Forms made from parameter metadata: ranges, units and labels are data, so nothing here knows a model."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QFormLayout, QLabel, QWidget

from studio_core.params import ParamInfo
from studio_ui.fields import FIELDS, Field, tip
from studio_ui.sinks import Sink
from studio_ui.theme import GAP

_LABEL = 92  # pixels


class ParamForm(QWidget):
    """A row for every parameter; `show_values` follows the scene without telling the sink."""

    def __init__(self, infos: Mapping[str, ParamInfo], sink: Sink, skip: tuple[str, ...] = ()) -> None:
        super().__init__()
        self.fields: dict[str, Field] = {}
        layout = form_layout(self)
        for name, info in infos.items():
            if name not in skip:
                self.fields[name] = field = FIELDS[info.kind](name, info, sink)
                layout.addRow(form_label(info.label, tip(info)), field)

    def show_values(self, values: Mapping[str, Any]) -> None:
        """What the scene has now; names without a field are left alone."""
        for name, value in values.items():
            if name in self.fields:
                self.fields[name].show_value(value)


def form_layout(parent: QWidget) -> QFormLayout:
    """Labels left, controls as wide as they can."""
    layout = QFormLayout(parent)
    layout.setContentsMargins(0, 0, 0, 0)
    layout.setHorizontalSpacing(GAP + 2)
    layout.setVerticalSpacing(GAP)
    layout.setFieldGrowthPolicy(QFormLayout.FieldGrowthPolicy.AllNonFixedFieldsGrow)
    layout.setLabelAlignment(Qt.AlignmentFlag.AlignLeft | Qt.AlignmentFlag.AlignVCenter)
    return layout


def form_label(text: str, tool_tip: str = "") -> QLabel:
    """A row's label: all as wide, so that forms line up."""
    label = QLabel(text)
    label.setProperty("role", "dim")
    label.setFixedWidth(_LABEL)
    label.setMinimumHeight(26)
    label.setWordWrap(True)
    label.setToolTip(tool_tip)
    return label
