"""Second step: exposures become light; how the camera responded, and what no exposure resolved."""

from __future__ import annotations

import math

from PySide6.QtCore import Qt
from PySide6.QtGui import QBrush, QColor
from PySide6.QtWidgets import QTreeWidget, QTreeWidgetItem

from studio_core.capturing.artifacts import CaptureState, Motion
from studio_ui.capture.desk import CaptureDesk
from studio_ui.capture.preview.picture import Shown
from studio_ui.capture.steps.curve_plot import CurvePlot
from studio_ui.capture.steps.step import StepForm, named
from studio_ui.context import Context
from studio_ui.look.theme import Theme
from studio_ui.panels.panel import heading, note

_HEADS = ("Exposure", "Listed", "Measured", "Moved by")
_TIPS = (
    "From dark to bright",
    "EV as the photographs say",
    "EV as the pictures themselves show it",
    "How far the hand moved since the exposure that the others are laid on",
)


def exposure_rows(state: CaptureState) -> list[tuple[str, str, str, str, bool]]:
    """Name, listed, measured, motion, and whether listed and measured disagree, for every exposure."""
    rows = []
    for side, light in state.lights.items():
        found = light.exposures
        for index, (listed, solved) in enumerate(zip(found.listed, found.solved, strict=True)):
            motion = light.motions[index] if index < len(light.motions) else Motion()
            rows.append(
                (
                    f"{side.capitalize()} {index + 1}",
                    f"{listed:+.2f}",
                    f"{solved:+.2f}",
                    motion_text(motion),
                    index in found.wrong,
                )
            )
    return rows


def motion_text(motion: Motion) -> str:
    """Pixels and degrees, or that it could not be told."""
    if not motion.trusted:
        return "not aligned"
    shift, turn = math.hypot(motion.dx, motion.dy), math.hypot(motion.degrees, *motion.rotation)
    parts = ([f"{shift:.1f} px"] if shift else []) + ([f"{turn:.2f}°"] if turn else [])
    return ", ".join(parts) or "–"


class LightStep(StepForm):
    """Form, exposures, curve."""

    id = "light"

    def __init__(self, context: Context, desk: CaptureDesk) -> None:
        super().__init__(context, desk)
        self.column.addWidget(self.form("radiance"))
        self.column.addWidget(heading("Exposures"))
        self.table = QTreeWidget()
        self.table.setAccessibleName("Exposures, listed and measured")
        self.table.setHeaderLabels(list(_HEADS))
        for column, tip in enumerate(_TIPS):
            self.table.headerItem().setToolTip(column, tip)
        self.table.setRootIsDecorated(False)
        self.table.setMinimumHeight(130)
        self.column.addWidget(self.table)
        self.column.addWidget(heading("Response curve"))
        self.plot = CurvePlot()
        self.column.addWidget(self.plot)
        self.told = note("")
        self.column.addWidget(self.told)
        self._rows: object = None
        self._warning = ""

    def set_theme(self, theme: Theme) -> None:
        """Plot and warnings."""
        self.plot.set_theme(theme)
        self._warning, self._rows = theme.warning, None
        self._fill()

    def show_now(self) -> None:
        """Settings, exposures, curve."""
        super().show_now()
        self._fill()
        response = self.desk.state.response
        self.plot.show_response(response)
        if response is None:
            self.told.setText("")
        else:
            how = "Measured from the exposures" if response.measured else "Assumed"
            self.told.setText(f"{how}; {response.rms:.3f} stops RMS unexplained")

    def pictures(self) -> list[str]:
        """Sides."""
        return named(self.desk.state.lights)

    def picture(self, name: str) -> Shown | None:
        """Merged light, with what no exposure resolved."""
        return self.lens_shown(name.lower())

    def _fill(self) -> None:
        rows = exposure_rows(self.desk.state)
        if rows == self._rows:
            return
        self._rows = rows
        self.table.clear()
        for *texts, wrong in rows:
            item = QTreeWidgetItem(texts)
            for column in (1, 2):
                item.setTextAlignment(column, Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter)
            if wrong:
                item.setText(2, f"{texts[2]}  !")
                item.setToolTip(2, "More than 0.3 EV from what is listed")
                if self._warning:
                    item.setForeground(2, QBrush(QColor(self._warning)))
            self.table.addTopLevelItem(item)
        for column in range(len(_HEADS)):
            self.table.resizeColumnToContents(column)
