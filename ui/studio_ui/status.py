"""The status bar: what happens, what is under the mouse, how the picture was computed."""

from __future__ import annotations

import math
from collections.abc import Mapping

from PySide6.QtCore import QSize, Qt, QTimer
from PySide6.QtGui import QResizeEvent
from PySide6.QtWidgets import QLabel, QStatusBar, QWidget

from studio_core.scene.nodes import Scene
from studio_core.shading.artifacts import MeasuredError
from studio_ui.canvas.viewport import Probe
from studio_ui.feed import Freshness, Shown
from studio_ui.forms.number_style import number_style
from studio_ui.journal import Entry
from studio_ui.look.fitting import show_what_fits
from studio_ui.look.role import set_role

_SHOWN_MS = 9000
_GAP = 6  # pixels that Qt leaves between the parts
_MESSAGE, _PIXEL = 120, 200
"""Pixels that are kept for messages, and for what is under the mouse."""
_ERROR = "Relative error of the picture against brute force, measured at random places while nothing moves"
_VERTICES = "Points that were lit, of all shading vertices"
_DIRECTIONS = "Directions that light came from"
_TIME = "From the change to this picture"
_COUNTS = {
    "vertices": "shading vertices",
    "vertices_shaded": "shaded anew for this picture",
    "vertices_summed": "whose light was summed anew",
    "vertices_traced_to_lamps": "that looked anew at lamps and the sun",
    "skipped_vertices_unseen": "skipped, as the view does not show them",
    "nodes": "light nodes looked at",
    "rays": "rays, since the scene was opened",
    "packets": "packets of rays",
    "skipped_packets": "packets skipped, as nothing stands in their way",
    "objects_traced": "objects tried as occluders of a point",
    "skipped_objects_below_horizon": "objects skipped below a point's horizon",
}
"""What is told of `Radiance.counts`; others are told by their names."""


class StatusBar(QStatusBar):
    """Labels with a place of their own, so that nothing jumps."""

    def __init__(self) -> None:
        super().__init__()
        self.setSizeGripEnabled(False)
        self.setMinimumHeight(self.fontMetrics().height() + 14)  # no text resizes the picture
        self.message = QLabel()
        self.message.setTextFormat(self.message.textFormat().PlainText)
        self.message.setMinimumWidth(1)  # a long one widens no window
        self.pixel = QLabel()
        self.backend = QLabel()
        self.vertices = QLabel()
        self.directions = QLabel()
        self.time = QLabel()
        self.error = QLabel("error: not measured")
        self.error.setToolTip(_ERROR)
        self.vertices.setToolTip(_VERTICES)
        self.directions.setToolTip(_DIRECTIONS)
        self.time.setToolTip(_TIME)
        self.pixel.setToolTip("What is under the mouse: radiance (scene-linear red, green, blue)")
        self.addWidget(self.message, 1)
        for label in (self.pixel, self.backend, self.vertices, self.directions, self.time, self.error):
            self.addPermanentWidget(label)
        self._clear = QTimer(self)
        self._clear.setSingleShot(True)
        self._clear.timeout.connect(self.message.clear)

    def minimumSizeHint(self) -> QSize:
        """As narrow as the window becomes."""
        return QSize(0, super().minimumSizeHint().height())

    def resizeEvent(self, event: QResizeEvent) -> None:
        """Less is told where there is less room."""
        super().resizeEvent(event)
        self._fit()

    def tell(self, entry: Entry) -> None:
        """A line of the journal, for a while."""
        self.say(entry.text, "" if entry.level == "note" else entry.level)

    def say(self, text: str, role: str = "") -> None:
        """A message, for a while."""
        set_role(self.message, role)
        self.message.setText(text)
        self.message.setToolTip(text)
        self._clear.start(_SHOWN_MS)

    def show_backend(self, label: str) -> None:
        """Which backend computes."""
        self.backend.setText(label)
        self._fit()

    def show_picture(self, shown: Shown) -> None:
        """How the picture was computed."""
        radiance = shown.picture.radiance
        count, lit = len(radiance.valid), int(radiance.valid.sum())
        self.vertices.setText(f"{lit:,} of {count:,} vertices" if lit != count else f"{count:,} vertices")
        self.directions.setText(f"{radiance.directions:,} directions")
        self.time.setText(duration(shown.seconds))
        counts = counted(radiance.counts)
        self.vertices.setToolTip("\n".join([_VERTICES, *counts]))
        self.directions.setToolTip("\n".join([_DIRECTIONS, *counts]))
        self._fit()

    def forget_picture(self) -> None:
        """There is none any more."""
        for label in (self.vertices, self.directions, self.time, self.error):
            label.clear()
        self._fit()

    def show_freshness(self, state: Freshness) -> None:
        """How the picture stands to the scene."""
        self.time.setToolTip(f"{_TIME} ({state.value})")

    def show_error(self, error: MeasuredError | None, names: Mapping[str, str]) -> None:
        """How wrong the picture is; its layers by the lights' names in the tooltip."""
        if error is None:
            self.error.setText("error: not measured")
            self.error.setToolTip(_ERROR)
            return
        self.error.setText(f"error: {error.picture}")
        lines = [_ERROR, f"of the lit points alone: {error.vertices}"]
        if error.picture.p99:
            lines.append(f"one place in a hundred is off by more than {100 * error.picture.p99:.1f} %")
        if error.indirect is not None:
            lines.append(f"of light between surfaces alone: {error.indirect}")
        lines += [f"by {names.get(layer, layer)} alone: {part}" for layer, part in error.layers.items()]
        self.error.setToolTip("\n".join(lines))

    def show_probe(self, probe: Probe | None, scene: Scene) -> None:
        """What is under the mouse."""
        if probe is None:
            self.pixel.clear()
            return
        red, green, blue = probe.radiance
        node = scene.nodes.get(probe.node) if probe.node is not None else None
        name = node.name if node is not None else "background"
        far = math.isfinite(probe.distance)
        place = f", {number_style(self).text(probe.distance, 'm', 2)}" if far else ""
        told = f"{red:.3g} {green:.3g} {blue:.3g}"
        if probe.share is not None:
            told = "" if math.isnan(probe.share) else f"{probe.share:.0%} from other surfaces"
        self.pixel.setText(f"{name}{place}: {told}" if told else f"{name}{place}")

    def _fit(self) -> None:
        """The picture's numbers go first; a place stays for messages and for what is under the mouse."""
        lesser = (self.time, self.backend, self.vertices, self.directions)
        own = (self.message, self.pixel, *lesser)
        others = self.findChildren(QWidget, options=Qt.FindChildOption.FindDirectChildrenOnly)
        fixed = sum(w.sizeHint().width() + _GAP for w in others if w not in own and not w.isHidden())
        show_what_fits(self.width() - fixed - _MESSAGE - _PIXEL, lesser, _GAP)


def counted(counts: Mapping[str, int]) -> list[str]:
    """Lines for a tooltip: what was done for a picture, and what was skipped."""
    known = [f"{counts[name]:,} {text}" for name, text in _COUNTS.items() if name in counts]
    others = [f"{n:,} {name.replace('_', ' ')}" for name, n in counts.items() if name not in _COUNTS]
    return known + others


def duration(seconds: float) -> str:
    """In the unit a person would use."""
    return f"{seconds * 1000:.0f} ms" if seconds < 1 else f"{seconds:.1f} s"
