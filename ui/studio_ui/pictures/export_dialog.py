"""File ▸ Export picture: one picture in any size."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from PySide6.QtGui import QImage
from PySide6.QtWidgets import QCheckBox, QLineEdit, QToolButton, QWidget

from studio_core.scene.nodes import Camera
from studio_ui.ask import Filter
from studio_ui.forms.fields import Combo
from studio_ui.panels.panel import row
from studio_ui.pictures.dialog import PictureDialog
from studio_ui.pictures.forms import LookForm, SizeForm, form_in, labelled, named
from studio_ui.pictures.order import HERE, PictureOrder, duration, guessed
from studio_ui.pictures.work import unused

if TYPE_CHECKING:
    from studio_ui.pictures.feature import PictureOut

FILTERS = (Filter("PNG picture, as shown", (".png",)), Filter("OpenEXR, linear light", (".exr",)))


class ExportDialog(PictureDialog):
    """One picture."""

    title = "Export picture"

    def __init__(self, parent: QWidget | None, owner: PictureOut) -> None:
        super().__init__(parent, owner)
        self._owner, self._confirmed = owner, Path()
        memory = owner.memory
        self.camera = Combo()
        self.camera.addItem("What the window shows", HERE)
        for camera in owner.context.document.scene.of(Camera):
            self.camera.addItem(camera.name, camera.id)
        self.size_form = SizeForm(owner.window_size(), memory.size())
        self.look_form = LookForm(*memory.look())
        self.measure = QCheckBox("Measure the error")
        self.measure.setToolTip("By brute force at 256 places; it is written into the file")
        self.path = QLineEdit(str(owner.free_path(self.look_form.kind_().suffix)))
        self.browse = QToolButton()
        self.browse.setText("…")
        self.browse.setToolTip("Choose a folder and a name")
        self.browse.setAccessibleName("Choose a folder and a name")
        top = QWidget()
        form = form_in(top)
        labelled(form, "Camera", self.camera, "Whose picture it is")
        name = QWidget()
        name.setLayout(row(self.path, self.browse, stretch=0))
        bottom = QWidget()
        below = form_in(bottom)
        below.addRow(named(""), self.measure)
        labelled(below, "Save as", name, "Where the picture is put when it is whole")
        self.path.setAccessibleName("Save as")
        for part in (top, self.size_form, self.look_form, bottom):
            self.form_column.addWidget(part)
        self.form_column.addStretch(1)
        self.resize(940, 560)
        self.browse.clicked.connect(self._browse)
        self.size_form.changed.connect(self._changed)
        self.look_form.changed.connect(self._changed)
        self.camera.currentIndexChanged.connect(self._changed)
        self._changed()

    def order(self) -> PictureOrder | None:
        """What is asked for; a file that is there is asked about."""
        path = self._path()
        if path.exists() and path != self._confirmed:
            self._browse()
            path = self._path()
            if path.exists() and path != self._confirmed:
                return None
        look = self._owner.look(self.size_form, self.look_form, measure=self.measure.isChecked())
        self._owner.memory.keep(self.size_form, self.look_form)
        return PictureOrder(self.camera.currentData(), path, look)

    def finished_well(self, text: str) -> None:
        """The next picture has a name of its own."""
        self.path.setText(str(unused(self._path())))
        super().finished_well(text)

    def estimate(self) -> str:
        """By the last picture of that quality."""
        look = self._owner.look(self.size_form, self.look_form)
        seconds = guessed(look, self._owner.memory.past)
        if seconds is None:
            return "How long it takes is known after the first one."
        return f"About {duration(seconds)}, judging by the last one."

    def _path(self) -> Path:
        path = Path(self.path.text().strip() or "picture").expanduser()
        suffix = self.look_form.kind_().suffix
        return path if path.suffix.lower() == suffix else path.with_name(path.name + suffix)

    def _browse(self) -> None:
        chosen = self._owner.ask.save_file("Export picture", self._path(), FILTERS)
        if chosen is not None:
            self.path.setText(str(chosen))
            self.look_form.show_suffix(chosen.suffix.lower())
            self._confirmed = self._path()

    def _changed(self) -> None:
        path, suffix = Path(self.path.text()), self.look_form.kind_().suffix
        if path.suffix.lower() in (".png", ".exr") and path.suffix.lower() != suffix:
            self.path.setText(str(path.with_suffix(suffix)))
        if self.task is None:
            here = self.camera.currentData() == HERE
            image = self._owner.framed(self.size_form.size_()) if here else QImage()
            self.preview.show_image(image, "" if here else "The preview comes with the picture.")
            self.tell(self.estimate())
