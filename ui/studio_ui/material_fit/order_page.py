"""What is to be fitted: the folder, where its lamps were, what was photographed, what is asked of the fit."""

from __future__ import annotations

from pathlib import Path

from PySide6.QtCore import Signal
from PySide6.QtWidgets import QCheckBox, QFormLayout, QLabel, QLineEdit, QPushButton, QVBoxLayout, QWidget

from studio_core.fitting import HELD, NONE, SIZES, FitRequest
from studio_core.params import ParamInfo
from studio_ui.ask import Ask, Filter
from studio_ui.forms.fields import Combo
from studio_ui.forms.spin import Spin
from studio_ui.look.theme import GAP
from studio_ui.material_fit.words import HELD as HELD_WORDS
from studio_ui.panels.panel import note, row

_BALL, _FLAT = "A ball", "A flat piece"
_BY_NAMES, _FROM_FILE = "By file names, or a list in the folder", "From a file…"
_LISTS = Filter("Lists of lamps", (".lp", ".csv", ".txt", ".tsv"))
_USUAL_DISTANCE = {False: 12.0, True: 3.0}  # in radii, in widths
_INTRODUCTION = (
    "One place, one camera setting, one lamp at a time: a dozen photographs or more of a ball of the"
    " material, or of a flat piece, in a dark room. Where each lamp was is told by file names such as"
    " cloth_az-30_el15.jpg (0 is the camera, positive to its right), or by a list."
)


class OrderPage(QWidget):
    """`request()` is what the controls say; `ready` follows whether that is enough to begin."""

    ready = Signal(bool)

    def __init__(self, ask: Ask) -> None:
        super().__init__()
        self._ask = ask
        self._list: Path | None = None
        self.folder = QLineEdit()
        self.folder.setPlaceholderText("Folder of photographs")
        self.folder.setAccessibleName("Folder of photographs")
        self.folder.textChanged.connect(lambda text: self.ready.emit(bool(text.strip())))
        choose = QPushButton("Choose…")
        choose.setAccessibleName("Choose the folder of photographs")
        choose.clicked.connect(self.choose)
        self.sample = _combo("What was photographed", (_BALL, _FLAT))
        self.sample.setToolTip("A ball is seen from all sides at once; a flat piece shows more pattern")
        self.sample.currentIndexChanged.connect(lambda _: self._sample_chosen())
        self.lamps = _combo("Where the lamps were", (_BY_NAMES, _FROM_FILE))
        self.lamps.setToolTip("An .lp file, or a table of pictures with azimuth and height")
        self.lamps.activated.connect(self._lamps_chosen)
        self.near = QCheckBox("The camera stood near:")
        self.near.setToolTip("Otherwise it is taken as far away, as through a long lens")
        self.distance = Spin(ParamInfo("number", "Distance of the camera", low=0.2, high=1000.0), decimals=1)
        self.distance.setValue(_USUAL_DISTANCE[False])
        self.distance.setEnabled(False)
        self.near.toggled.connect(self.distance.setEnabled)
        self.unit = QLabel()
        self.size_ = _combo("Fineness of the map", [f"{size} × {size}" for size in SIZES])
        self.size_.setCurrentIndex(SIZES.index(256))
        self.size_.setToolTip("Spots of the material; finer than the photographs tells nothing more")
        self.held = _combo("Lamps held back", [HELD_WORDS[name] for name in HELD])
        self.held.setToolTip("The fit does not see them; then it is asked what they show")
        self.whole = QCheckBox("Then make the material of all lamps")
        self.held.currentIndexChanged.connect(lambda i: self.whole.setEnabled(HELD[i] != NONE))
        self.whole.setToolTip("The numbers stay those of lamps that were not seen. Takes a little longer.")
        self.whole.setChecked(True)
        form = QFormLayout()
        form.setHorizontalSpacing(2 * GAP)
        form.setVerticalSpacing(GAP + 2)
        form.addRow("Photographs", row(self.folder, choose, stretch=0))
        form.addRow("They show", self.sample)
        form.addRow("", row(self.near, self.distance, self.unit))
        form.addRow("Lamps", self.lamps)
        form.addRow("Map", self.size_)
        form.addRow("Hold back", self.held)
        form.addRow("", self.whole)
        column = QVBoxLayout(self)
        column.setContentsMargins(0, 0, 0, 0)
        column.setSpacing(2 * GAP)
        column.addWidget(note(_INTRODUCTION))
        column.addLayout(form)
        column.addStretch(1)
        self._sample_chosen()

    def choose(self) -> None:
        """Ask for the folder."""
        found = self._ask.folder("Photographs of a material")
        if found is not None:
            self.take(found)

    def take(self, folder: Path) -> None:
        """That folder."""
        self.folder.setText(str(folder))
        self.folder.setCursorPosition(0)

    def request(self) -> FitRequest | None:
        """None while there is no folder."""
        text = self.folder.text().strip()
        if not text:
            return None
        return FitRequest(
            folder=Path(text).expanduser(),
            lamps=self._list if self.lamps.currentIndex() else None,
            flat=self.flat,
            distance=self.distance.value() if self.near.isChecked() else None,
            size=SIZES[self.size_.currentIndex()],
            held=HELD[self.held.currentIndex()],
            whole=self.whole.isChecked(),
        )

    @property
    def flat(self) -> bool:
        """Whether it is a flat piece."""
        return self.sample.currentText() == _FLAT

    def _sample_chosen(self) -> None:
        self.unit.setText("widths of the picture away" if self.flat else "radii of the ball from its middle")
        if self.distance.value() == _USUAL_DISTANCE[not self.flat]:
            self.distance.setValue(_USUAL_DISTANCE[self.flat])

    def _lamps_chosen(self, index: int) -> None:
        """A list is asked for; without one, names tell."""
        if index == 0:
            return
        found = self._ask.open_files("Where the lamps were", [_LISTS])
        if found:
            self._list = found[0]
            self.lamps.setItemText(1, f"From {found[0].name}")
        elif self._list is None:
            self.lamps.setCurrentIndex(0)


def _combo(name: str, texts: tuple[str, ...] | list[str]) -> Combo:
    made = Combo()
    made.setAccessibleName(name)
    made.addItems(list(texts))
    made.setMinimumContentsLength(24)
    return made


__all__ = ["OrderPage"]
