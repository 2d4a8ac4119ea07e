"""File ▸ Export turntable or path: numbered pictures for a film."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from PySide6.QtCore import Qt
from PySide6.QtGui import QImage
from PySide6.QtWidgets import (
    QAbstractItemView,
    QCheckBox,
    QLineEdit,
    QListWidget,
    QListWidgetItem,
    QToolButton,
    QWidget,
)

from studio_core.params import ParamInfo
from studio_core.scene.bounds import exact_bounds
from studio_core.scene.nodes import Camera
from studio_core.scene.transform import Vec3, vec3
from studio_ui.forms.fields import Combo
from studio_ui.forms.spin import Spin
from studio_ui.panels.panel import note, row
from studio_ui.pictures.dialog import PictureDialog
from studio_ui.pictures.forms import LookForm, SizeForm, form_in, labelled, named
from studio_ui.pictures.order import HERE, SeriesOrder, duration, guessed
from studio_ui.pictures.work import unused

if TYPE_CHECKING:
    from studio_ui.pictures.feature import PictureOut

KINDS = {"turntable": "Camera goes around", "relight": "Light goes around", "path": "Path through cameras"}
FPS = 24


class SeriesDialog(PictureDialog):
    """Many pictures."""

    title = "Export turntable or path"

    def __init__(self, parent: QWidget | None, owner: PictureOut) -> None:
        super().__init__(parent, owner)
        self._owner = owner
        memory, scene = owner.memory, owner.context.document.scene
        cameras = list(scene.of(Camera))
        self.kind, self.camera, self.around = Combo(), Combo(), Combo()
        for key, label in KINDS.items():
            self.kind.addItem(label, key)
        self.camera.addItem("What the window shows", HERE)
        for camera in cameras:
            self.camera.addItem(camera.name, camera.id)
        self.around.addItem("What the camera looks at", None)
        found = exact_bounds(scene, owner.context.session.selection)
        if found is not None:
            self.around.addItem("What is chosen", vec3((found[0] + found[1]) / 2))
            self.around.setCurrentIndex(1)
        self.degrees = Spin(ParamInfo("number", "Turn", unit="°", low=-3600, high=3600), decimals=1)
        self.degrees.show_value(360.0)
        self.count = Spin(ParamInfo("integer", "Pictures", low=1, high=10_000))
        self.count.show_value(memory.count())
        self.rate = Spin(ParamInfo("integer", "Pictures a second", low=1, high=240))
        self.rate.show_value(FPS)
        self.length = Spin(ParamInfo("number", "Length", unit="s", low=0.01, high=1e5), decimals=2)
        self.path_list = _camera_list(cameras)
        self.closed, self.ease = QCheckBox("Back to the first camera"), QCheckBox("Start and stop slowly")
        self.even = QCheckBox("At even speed")
        self.even.setToolTip("Otherwise as many pictures between any two cameras")
        self.ease.setChecked(True)
        self.even.setChecked(True)
        self.size_form = SizeForm(owner.window_size(), memory.size())
        self.look_form = LookForm(*memory.look())
        start = owner.beside("")
        self.folder = QLineEdit(str(unused(start.with_name(f"{start.name} frames"))))
        self.name = QLineEdit(start.name)
        self.resume = QCheckBox("Keep pictures that are there")
        self.resume.setToolTip("To go on after an interruption; they should show the same scene")
        self._put_together()
        self._times()
        self._changed()

    def _put_together(self) -> None:
        turn, path = QWidget(), QWidget()
        turning, walking = form_in(turn), form_in(path)
        labelled(turning, "Camera", self.camera, "Where it starts")
        labelled(turning, "Around", self.around, "The vertical through this point is the axis")
        labelled(turning, "Turn", self.degrees, "360° for a film that repeats without a jump")
        labelled(walking, "Cameras", self.path_list, "Those with a tick, from the top down; drag to reorder")
        for check in (self.closed, self.ease, self.even):
            walking.addRow(named(""), check)
        self.pages = (turn, path)
        path.hide()
        top, times, files = QWidget(), QWidget(), QWidget()
        labelled(form_in(top), "Kind", self.kind, "What moves")
        timing = form_in(times)
        labelled(timing, "Pictures", self.count, "How many files are written")
        labelled(timing, "Pictures a second", self.rate, "Of the film that is made from them")
        labelled(timing, "Length", self.length, "Of that film")
        browse = QToolButton()
        browse.setText("…")
        browse.setToolTip("Choose a folder")
        browse.setAccessibleName("Choose a folder")
        browse.clicked.connect(self._browse)
        place = QWidget()
        place.setLayout(row(self.folder, browse, stretch=0))
        self.files_told = note("")
        below = form_in(files)
        labelled(below, "Folder", place, "It is made if it is not there")
        self.folder.setAccessibleName("Folder")
        labelled(below, "Name", self.name, "What the files begin with")
        below.addRow(named(""), self.files_told)
        below.addRow(named(""), self.resume)
        for part in (top, *self.pages, times, self.size_form, self.look_form, files):
            self.form_column.addWidget(part)
        self.form_column.addStretch(1)
        self.resize(980, 720)
        self.kind.currentIndexChanged.connect(self._kind)
        self.camera.currentIndexChanged.connect(lambda _: self._changed())
        self.count.valueChanged.connect(lambda _: self._times())
        self.rate.valueChanged.connect(lambda _: self._times())
        self.length.valueChanged.connect(self._length)
        for signal in (self.size_form.changed, self.look_form.changed, self.path_list.itemChanged):
            signal.connect(lambda *_: self._changed())
        self.resume.toggled.connect(lambda _: self._name_files())
        for edit in (self.folder, self.name):
            edit.textChanged.connect(lambda _: self._changed())

    def order(self) -> SeriesOrder | None:
        """What is asked for."""
        folder = Path(self.folder.text().strip()).expanduser()
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            self.tell(f"The folder {folder} cannot be made: {error.strerror or error}.", "problem")
            return None
        kind = self.kind.currentData()
        cameras = self._cameras() if kind == "path" else (self.camera.currentData(),)
        self._owner.memory.keep(self.size_form, self.look_form, count=self._count())
        around: Vec3 | None = self.around.currentData()
        return SeriesOrder(
            kind,
            cameras,
            self._path(folder),
            self._owner.look(self.size_form, self.look_form),
            self._count(),
            self.degrees.value(),
            None if around is None else vec3(around),
            self.closed.isChecked(),
            self.ease.isChecked(),
            self.even.isChecked(),
            self.resume.isChecked(),
        )

    def estimate(self) -> str:
        """By the last picture of that quality."""
        look, past = self._owner.look(self.size_form, self.look_form), self._owner.memory.past
        each = guessed(look, past, "each")
        if each is not None:
            return f"About {duration(each * self._count())}, judging by the last ones."
        one = guessed(look, past)
        if one is None:
            return "How long it takes is known after the first one."
        return f"Less than {duration(one * self._count())}, judging by the last picture."

    def _count(self) -> int:
        return round(self.count.value())

    def _cameras(self) -> tuple[str, ...]:
        items = [self.path_list.item(i) for i in range(self.path_list.count())]
        ticked = [item for item in items if item.checkState() is Qt.CheckState.Checked]
        return tuple(item.data(Qt.ItemDataRole.UserRole) for item in ticked)

    def _path(self, folder: Path) -> Path:
        name = "".join(c for c in self.name.text().strip() if c not in '/\\:*?"<>|') or "picture"
        return folder / f"{name}{self.look_form.kind_().suffix}"

    def _browse(self) -> None:
        chosen = self._owner.ask.folder("Folder for the pictures")
        if chosen is not None:
            self.folder.setText(str(chosen))

    def _kind(self) -> None:
        kind = self.kind.currentData()
        self.pages[0].setVisible(kind != "path")
        self.pages[1].setVisible(kind == "path")
        self.around.setEnabled(kind == "turntable")
        self._changed()

    def _times(self) -> None:
        self.length.show_value(self._count() / self.rate.value())
        self._changed()

    def _length(self, seconds: float) -> None:
        self.count.show_value(max(1, round(seconds * self.rate.value())))
        self._changed()

    def finished_well(self, text: str) -> None:
        """What is there now is said, too."""
        super().finished_well(text)
        self._name_files()

    def _name_files(self) -> None:
        path = self._path(Path(self.folder.text().strip()))
        first = path.with_name(f"{path.stem}_0001{path.suffix}")
        known = ""
        if first.expanduser().exists():
            fate = "kept" if self.resume.isChecked() else "replaced"
            known = f" Pictures of that name are there and will be {fate}."
        self.files_told.setText(f"{first.name} … {path.stem}_{self._count():04}{path.suffix}.{known}")

    def _changed(self) -> None:
        if self.task is not None:
            return
        self._name_files()
        few = self.kind.currentData() == "path" and len(self._cameras()) < 2
        self.export_button.setEnabled(not few)
        here = self.kind.currentData() != "path" and self.camera.currentData() == HERE
        image = self._owner.framed(self.size_form.size_()) if here else QImage()
        self.preview.show_image(image, "Small pictures appear here while they are made.")
        text = "A path needs two cameras or more: View ▸ New camera from view." if few else self.estimate()
        self.tell(text, "warning" if few else "dim")


def _camera_list(cameras: list[Camera]) -> QListWidget:
    made = QListWidget()
    made.setAccessibleName("Cameras of the path")
    made.setDragDropMode(QAbstractItemView.DragDropMode.InternalMove)
    made.setFixedHeight(110)
    made.setSpacing(2)
    for camera in cameras:
        item = QListWidgetItem(camera.name)
        item.setData(Qt.ItemDataRole.UserRole, camera.id)
        item.setFlags(item.flags() | Qt.ItemFlag.ItemIsUserCheckable)
        item.setCheckState(Qt.CheckState.Checked)
        made.addItem(item)
    return made
