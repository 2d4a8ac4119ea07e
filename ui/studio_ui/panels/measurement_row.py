"""What a material was measured as, and the chosen model fitted to it."""

from __future__ import annotations

from collections.abc import Callable

from PySide6.QtWidgets import QLabel, QPushButton, QVBoxLayout, QWidget

from studio_core.contract import Brdf
from studio_core.scene.geometry import Table
from studio_core.scene.nodes import Material
from studio_ui.panels.panel import row


def measurement_of(material: Material) -> Table | None:
    """The material's table of reflectances, if it has one."""
    return next((table for table in material.tables.values() if table.values.shape[3] == 3), None)


class MeasurementRow(QWidget):
    """The table's name; `fit()` is asked for where the model has values that could come near it."""

    def __init__(self, table: Table, model: Brdf | None, fit: Callable[[], object]) -> None:
        super().__init__()
        self.error = QLabel()
        self.error.setProperty("role", "dim")
        self.error.setWordWrap(True)
        self.error.hide()
        self.fit = QPushButton("Fit")
        self.fit.setToolTip("Find the values with which this kind comes nearest to the measurement")
        self.fit.setAccessibleName("Fit this kind to the measurement")
        self.fit.clicked.connect(lambda: fit())
        self.fit.setVisible(model is not None and not getattr(model, "tables", ()))
        column = QVBoxLayout(self)
        column.setContentsMargins(0, 0, 0, 0)
        column.setSpacing(2)
        column.addLayout(row(QLabel(table.name or "Measured"), self.fit, stretch=0))
        column.addWidget(self.error)

    def tell(self, text: str) -> None:
        """How near it came; nothing for an empty text."""
        self.error.setText(text)
        self.error.setVisible(bool(text))
