"""Last step: the room's light all around and as a cube, its numbers, and where it goes."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
from PySide6.QtWidgets import QHeaderView, QMenu, QPushButton, QTreeWidget, QTreeWidgetItem

from studio_core.capturing.artifacts import Captured
from studio_core.capturing.edits import use_capture
from studio_core.imaging.cubemap import Faces
from studio_core.shading.job import Job
from studio_ui.ask import Ask, Filter
from studio_ui.capture.desk import CaptureDesk
from studio_ui.capture.preview.picture import Shown
from studio_ui.capture.steps.calibration import unresolved_marks
from studio_ui.capture.steps.step import StepForm, direction_text
from studio_ui.capture.telling import Line, report_lines
from studio_ui.context import Context
from studio_ui.panels.panel import heading, note, row

AROUND, CUBE = "All around", "Cube"
_PICTURES = Filter("Light", (".exr", ".hdr"))
_CUBES = {
    "Six files…": "six",
    "Strip…": "strip",
    "Cross…": "cross",
    "Vertical cross…": "vertical cross",
    "OpenEXR cube…": "openexr",
}


class ResultStep(StepForm):
    """Save it, or light the scene with it."""

    id = "result"

    def __init__(self, context: Context, desk: CaptureDesk, ask: Ask, beside: Callable[[str], Path]) -> None:
        super().__init__(context, desk)
        self._ask, self._beside = ask, beside
        self.use = QPushButton("Use in scene")
        self.use.setToolTip("Light the scene with it; an environment that is there keeps its rotation")
        self.use.setDefault(True)
        self.use.clicked.connect(self.light)
        self.save = QPushButton("Save…")
        self.save.setToolTip("The picture all around, as EXR (with what was not resolved) or HDR")
        self.save.clicked.connect(self.save_around)
        self.cube = QPushButton("Save cube map")
        self.cube.setToolTip("Six faces, a strip or a cross")
        menu = QMenu(self.cube)
        for text, layout in _CUBES.items():
            menu.addAction(text, lambda layout=layout: self.save_cube(layout))
        self.cube.setMenu(menu)
        self.column.addLayout(row(self.use, self.save, self.cube))
        self.lit = note("")
        self.column.addWidget(self.lit)
        self.notes = note("")
        self.column.addWidget(self.notes)
        self.column.addWidget(heading("In numbers"))
        self.table = QTreeWidget()
        self.table.setAccessibleName("Report")
        self.table.setHeaderLabels(["What", "Value"])
        self.table.setMinimumHeight(240)
        self.table.header().setSectionResizeMode(0, QHeaderView.ResizeMode.ResizeToContents)
        self.column.addWidget(self.table)
        self._captured: Captured | None = None
        self._cross: Faces | None = None

    def show_now(self) -> None:
        """The newest result."""
        captured = self.desk.state.captured
        ready = captured is not None and "captured" in self.desk.fresh
        for button in (self.use, self.save, self.cube):
            button.setEnabled(ready)
        capture, scene = self.desk.capture, self.context.document.scene
        lit = scene.nodes.get(capture.environment) if capture is not None and capture.environment else None
        if lit is None:
            self.lit.setText("Nothing is lit by it yet.")
        elif captured is not None and getattr(lit, "image", None) is captured.environment:
            self.lit.setText(f"{lit.name} lights the scene with this.")
        else:
            self.lit.setText(f"{lit.name} was lit by an earlier state of this capture.")
        if captured is self._captured:
            return
        self._captured, self._cross = captured, None
        self.table.clear()
        self.notes.setText("\n".join(dict.fromkeys(captured.notes)) if captured is not None else "")
        if captured is not None:
            self.table.addTopLevelItems([_item(line) for line in report_lines(captured.report)])

    def pictures(self) -> list[str]:
        """Around, and the cube."""
        return [AROUND, CUBE] if self.desk.state.captured is not None else []

    def picture(self, name: str) -> Shown | None:
        """The very array that is saved; the cube unfolded."""
        captured = self.desk.state.captured
        if captured is None:
            return None
        if name == CUBE:
            if self._cross is None:
                self._cross = unfolded(captured.faces)
            return Shown("cube", f"Cube of {captured.faces.shape[1]}", self._cross)
        pixels = captured.environment.pixels
        marks = self.marks((captured,), lambda: unresolved_marks(captured))
        return Shown("finished", AROUND, pixels, marks, say=direction_text(pixels.shape))

    def light(self) -> None:
        """Light the scene with it."""
        capture, captured = self.desk.capture, self.desk.state.captured
        if capture is not None and captured is not None:
            self.context.editing.apply(use_capture(self.context.document.scene, capture.id, captured))
            self.show_now()

    def save_around(self) -> None:
        """Ask for a file and write it."""
        captured = self.desk.state.captured
        path = self._ask.save_file("Save the room's light", self._suggested(".exr"), [_PICTURES])
        if captured is None or path is None:
            return
        scale = captured.calibration.luminance_scale

        def write(job: Job) -> None:
            from studio_core.imaging.environment_out import write_environment

            pixels = captured.environment.pixels
            write_environment(path, pixels, unresolved=captured.unresolved, luminance_scale=scale)

        self.context.tasks.run(f"Saving {path.name}", write, lambda _: self._said(path))

    def save_cube(self, layout: str) -> None:
        """Ask for a file, or a folder for six, and write it."""
        captured = self.desk.state.captured
        if captured is None:
            return
        if layout == "six":
            path = self._ask.folder("Folder for the six faces")
        else:
            filters = [Filter("Cube", (".exr",))] if layout == "openexr" else [_PICTURES]
            path = self._ask.save_file("Save cube map", self._suggested("-cube.exr"), filters)
        if path is None:
            return
        target, scale = path, captured.calibration.luminance_scale

        def write(job: Job) -> None:
            from studio_core.imaging.environment_out import write_cube

            write_cube(target, captured.faces, layout, luminance_scale=scale)

        self.context.tasks.run(f"Saving {target.name}", write, lambda _: self._said(target))

    def _suggested(self, ending: str) -> Path:
        name = self.desk.capture.name if self.desk.capture is not None else "Capture"
        return self._beside(".exr").with_name(f"{name}{ending}")

    def _said(self, path: Path) -> None:
        self.context.journal.write(f"Saved {path.name}.")


def unfolded(faces: Faces) -> Faces:
    """The faces as a cross lying on its side, the front in the middle."""
    from studio_core.imaging.cubemap import joined, to_opengl

    return np.ascontiguousarray(joined(to_opengl(faces), "cross"))


def _item(line: Line) -> QTreeWidgetItem:
    made = QTreeWidgetItem([line.name, line.value])
    made.setToolTip(1, line.value)
    made.addChildren([_item(below) for below in line.below])
    return made
