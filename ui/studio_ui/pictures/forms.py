"""Fields that both export dialogs have: size, samples, quality, what kind of file."""

from __future__ import annotations

from collections.abc import Callable

from PySide6.QtCore import QSignalBlocker, Signal
from PySide6.QtWidgets import QCheckBox, QFormLayout, QHBoxLayout, QLabel, QVBoxLayout, QWidget

from studio_core.params import ParamInfo
from studio_ui.forms.fields import Combo
from studio_ui.forms.spin import Spin
from studio_ui.look.theme import GAP
from studio_ui.panels.panel import note
from studio_ui.pictures.order import KINDS, MOST_PIXELS, PRESETS, QUALITIES, SAMPLES, Kind, Size

_WINDOW, _CUSTOM = "As the window", "Other"

LABELS, FIELDS = 108, 26  # pixels: width of labels, height of fields


def labelled(form: QFormLayout, text: str, field: QWidget, tip: str = "") -> None:
    """A row of a form; what it means is told on both sides."""
    label = named(text)
    label.setToolTip(tip)
    field.setToolTip(tip)
    field.setAccessibleName(text)
    label.setBuddy(field)
    form.addRow(label, field)


def named(text: str, height: int = FIELDS) -> QLabel:
    """A label as wide as those of the forms above and below, at the height of its field."""
    label = QLabel(text)
    label.setFixedWidth(LABELS)
    label.setMinimumHeight(height)
    return label


def form_in(owner: QWidget) -> QFormLayout:
    """A form without margins of its own."""
    form = QFormLayout(owner)
    form.setContentsMargins(0, 0, 0, 0)
    form.setSpacing(GAP)
    form.setFieldGrowthPolicy(QFormLayout.FieldGrowthPolicy.AllNonFixedFieldsGrow)
    return form


class SizeForm(QWidget):
    """Preset, width and height; `changed` when another size is meant."""

    changed = Signal()

    def __init__(self, window: Size, start: Size | None = None) -> None:
        super().__init__()
        self._dpi = 0.0
        self._upright = start is not None and start.height > start.width  # asked for
        self.preset = Combo()
        self.preset.addItem(f"{_WINDOW}  {window.width} × {window.height}", window)
        for label, size in PRESETS.items():
            self.preset.addItem(label, size)
        self.preset.addItem(_CUSTOM, None)
        self.width_, self.height_ = (_pixels(name) for name in ("Width", "Height"))
        self.linked = QCheckBox("Keep the shape")
        self.linked.setToolTip("Width and height change together")
        self.linked.setChecked(True)
        self.upright = QCheckBox("Upright")
        self.upright.setToolTip("Higher than wide")
        self.told = note("")
        form = form_in(self)
        labelled(form, "Size", self.preset, "Pixels of the picture, or a sheet of paper")
        sides = QHBoxLayout()
        sides.setSpacing(GAP)
        for field in (self.width_, QLabel("×"), self.height_):
            sides.addWidget(field, 0 if isinstance(field, QLabel) else 1)
        form.addRow(named("Pixels"), sides)
        checks = QHBoxLayout()
        checks.setSpacing(2 * GAP)
        checks.addWidget(self.linked)
        checks.addWidget(self.upright)
        checks.addStretch(1)
        form.addRow(named("", 0), checks)
        form.addRow(named("", 0), self.told)
        self.preset.currentIndexChanged.connect(self._chosen)
        self.width_.valueChanged.connect(lambda value: self._typed(self.width_, self.height_, value))
        self.height_.valueChanged.connect(lambda value: self._typed(self.height_, self.width_, value))
        self.upright.toggled.connect(self._turned)
        self.show_size(start or window)

    def size_(self) -> Size:
        """What is meant."""
        return Size(round(self.width_.value()), round(self.height_.value()), self._dpi)

    @property
    def as_window(self) -> bool:
        """Whether that is the window's size."""
        return self.preset.currentIndex() == 0

    def show_size(self, size: Size) -> None:
        """Without telling."""
        self._dpi = size.dpi
        self.width_.show_value(size.width)
        self.height_.show_value(size.height)
        self._shape = size.width / size.height
        with QSignalBlocker(self.preset), QSignalBlocker(self.upright):
            self.upright.setChecked(size.height > size.width)
            found = next((i for i in range(self.preset.count()) if self._means(i, size)), -1)
            self.preset.setCurrentIndex(found if found >= 0 else self.preset.count() - 1)
        self.told.setText(size.described())

    def _means(self, index: int, size: Size) -> bool:
        known = self.preset.itemData(index)
        return known is not None and size in (known, known.upright())

    def _chosen(self, index: int) -> None:
        size = self.preset.itemData(index)
        if size is not None:
            turn = self._upright and index > 0 and size.width > size.height
            self.show_size(size.upright() if turn else size)
            self.changed.emit()

    def _typed(self, this: Spin, other: Spin, value: float) -> None:
        if self.linked.isChecked():
            shape = self._shape if this is self.width_ else 1 / self._shape
            other.show_value(min(max(round(value / shape), 1), MOST_PIXELS))
            shape = self._shape
            self.show_size(Size(round(self.width_.value()), round(self.height_.value())))
            self._shape = shape  # not what rounding made of it
        else:
            self.show_size(Size(round(self.width_.value()), round(self.height_.value())))
        self.changed.emit()

    def _turned(self, upright: bool) -> None:
        self._upright, size = upright, self.size_()
        if (size.height > size.width) is not upright:
            self.show_size(size.upright())
            self.changed.emit()


def _pixels(name: str) -> Spin:
    made = Spin(ParamInfo("integer", name, unit="px", low=1, high=MOST_PIXELS))
    made.setToolTip(f"{name} in pixels, at most {MOST_PIXELS}")
    return made


class LookForm(QWidget):
    """Quality, samples and kind of file; `changed` when any is another one."""

    changed = Signal()

    def __init__(self, quality: str, samples: int, kind: int) -> None:
        super().__init__()
        self.quality, self.samples, self.kind = Combo(), Combo(), Combo()
        for key, label in QUALITIES.items():
            self.quality.addItem(label, key)
        for count, label in SAMPLES.items():
            self.samples.addItem(label, count)
        for one in KINDS:
            self.kind.addItem(one.label, one)
        self.alpha = QCheckBox("Transparent background")
        self.alpha.setToolTip("Nothing behind the furniture; shadows on photographed floors are kept")
        self.lights = QCheckBox("A layer for every light")
        self.lights.setToolTip("To mix the lights afterwards; they add up to the picture")
        column = QVBoxLayout(self)
        column.setContentsMargins(0, 0, 0, 0)
        column.setSpacing(GAP)
        rows = QWidget()
        form = form_in(rows)
        labelled(form, "Light", self.quality, "How finely light is summed and the shading mesh refined")
        labelled(form, "Samples", self.samples, "More make edges and textures smoother, and take longer")
        labelled(form, "File", self.kind, "PNG as the window shows it; OpenEXR holds the light itself")
        checks = QVBoxLayout()
        checks.setSpacing(GAP)
        checks.addWidget(self.alpha)
        checks.addWidget(self.lights)
        form.addRow(named(""), checks)
        column.addWidget(rows)
        self._choose(self.quality, lambda data: data == quality)
        self._choose(self.samples, lambda data: data == samples)
        self.kind.setCurrentIndex(kind if 0 <= kind < len(KINDS) else 0)
        for combo in (self.quality, self.samples, self.kind):
            combo.currentIndexChanged.connect(self._changed)
        self._changed()

    def kind_(self) -> Kind:
        """The kind of file."""
        made: Kind = self.kind.currentData()
        return made

    def show_suffix(self, suffix: str) -> None:
        """The first kind of that suffix, unless it has it already."""
        if suffix and suffix != self.kind_().suffix:
            self._choose(self.kind, lambda kind: kind.suffix == suffix)

    def _choose(self, combo: Combo, fits: Callable[..., bool]) -> None:
        found = [i for i in range(combo.count()) if fits(combo.itemData(i))]
        if found:
            combo.setCurrentIndex(found[0])

    def _changed(self) -> None:
        linear = self.kind_().suffix == ".exr"
        self.lights.setEnabled(linear)
        if not linear:
            self.lights.setChecked(False)
        self.changed.emit()
