"""On the toolbar: through which camera, how bright, with which view transform."""

from __future__ import annotations

from PySide6.QtCore import QSignalBlocker
from PySide6.QtWidgets import QHBoxLayout, QLabel, QWidget

from studio_core.kernels.tonemap import KINDS, LABELS
from studio_core.params import ParamInfo
from studio_ui.context import Context, Subscriptions
from studio_ui.forms.fields import Combo, NumberField
from studio_ui.forms.sinks import Sink
from studio_ui.look.theme import GAP
from studio_ui.views.cameras import Cameras

_EXPOSURE = ParamInfo("number", "Exposure", "How bright the picture is shown", unit="EV", low=-16, high=16)
_FREE = "Free view"


class _Exposure(Sink):
    """A slider that changes how the picture is shown at once, without history."""

    def __init__(self, context: Context) -> None:
        self._session = context.session

    def begin(self, name: str) -> bool:
        return True

    def preview(self, name: str, value: object) -> None:
        self._session.display(exposure=round(float(value), 2))  # type: ignore[arg-type]

    def commit(self) -> None:
        return

    def cancel(self) -> None:
        return

    def apply(self, name: str, value: object) -> None:
        self.preview(name, value)


class ViewControls(QWidget):
    """Camera, exposure, view transform."""

    def __init__(self, context: Context, cameras: Cameras) -> None:
        super().__init__()
        self._context, self._seen = context, cameras
        self.camera, self.transform = Combo(), Combo()
        self.camera.setAccessibleName("Camera")
        self.transform.setAccessibleName("View transform")
        self.camera.setToolTip("Look through a camera of the scene")
        self.camera.setMinimumWidth(90)
        self.camera.setMinimumContentsLength(16)
        self.exposure = NumberField("exposure", _EXPOSURE, _Exposure(context))
        self.exposure.setMinimumWidth(130)
        self.exposure.setMaximumWidth(230)
        self.transform.setToolTip("How light becomes what the display shows")
        self.transform.setMinimumWidth(150)
        for kind in KINDS:
            self.transform.addItem(LABELS[kind], kind)
        self.transform.activated.connect(lambda i: context.session.display(tonemap=KINDS[i]))
        self.camera.activated.connect(self._look)
        layout = QHBoxLayout(self)
        layout.setContentsMargins(0, 0, 0, 0)
        layout.setSpacing(GAP)
        for label, widget in (("", self.camera), ("Exposure", self.exposure), ("", self.transform)):
            if label:
                text = QLabel(label)
                text.setProperty("role", "dim")
                layout.addWidget(text)
            layout.addWidget(widget)
        self._known: list[tuple[str, str]] = [("", "")]
        self._subscriptions = Subscriptions()
        self._subscriptions.add(
            context.document.changed.connect(lambda *_: self._cameras()),
            cameras.changed.connect(self._cameras),
            context.session.displayed.connect(self._display),
        )
        self._cameras()
        self._display()

    def close_panel(self) -> None:
        """Stop listening."""
        self._subscriptions.close()

    def _cameras(self) -> None:
        found = [(camera.id, camera.name) for camera in self._seen.all()]
        if found != self._known:
            self._known = found
            with QSignalBlocker(self.camera):
                self.camera.clear()
                self.camera.addItem(_FREE, "")
                for node, name in found:
                    self.camera.addItem(name, node)
        self._follow()

    def _follow(self) -> None:
        """Which camera, if any, is looked through."""
        known = [node for node, _ in self._known]
        at = known.index(self._seen.through) + 1 if self._seen.through in known else 0
        with QSignalBlocker(self.camera):
            self.camera.setCurrentIndex(at)

    def _look(self, index: int) -> None:
        node = self.camera.itemData(index)
        if node:
            self._seen.look(node)
        else:
            self._seen.leave()

    def _display(self) -> None:
        session = self._context.session
        self.exposure.show_value(session.exposure)
        with QSignalBlocker(self.transform):
            self.transform.setCurrentIndex(KINDS.index(session.tonemap))
