"""Three things to try on the first start; each is ticked off when it was done."""

from __future__ import annotations

from collections.abc import Callable

from PySide6.QtGui import QResizeEvent
from PySide6.QtWidgets import QFrame, QHBoxLayout, QLabel, QSizePolicy, QToolButton

from studio_core.scene.diff import Aspect, Changes
from studio_core.scene.nodes import Environment, Scene
from studio_core.strokes.stroke import Stroke
from studio_ui.context import Context, Subscriptions
from studio_ui.look.fitting import show_what_fits
from studio_ui.look.icons import icon
from studio_ui.look.role import set_role
from studio_ui.look.theme import Theme
from studio_ui.settings import Settings

Test = Callable[[Scene, Scene, Changes], bool]


def _moved(before: Scene, after: Scene, changes: Changes) -> bool:
    return bool(changes.aspects & Aspect.TRANSFORM)


def _light_turned(before: Scene, after: Scene, changes: Changes) -> bool:
    """A capture, or another picture, also changes the light."""
    pairs = ((before.nodes.get(light.id), light) for light in after.of(Environment))
    return any(
        isinstance(old, Environment) and old.image is new.image and old.azimuth != new.azimuth
        for old, new in pairs
    )


def _painted(before: Scene, after: Scene, changes: Changes) -> bool:
    return any(isinstance(after.nodes.get(node), Stroke) for node in changes.nodes)


STEPS: tuple[tuple[Test, str], ...] = (
    (_moved, "Click furniture, then drag it"),
    (_light_turned, "Shift+right-drag turns the light"),
    (_painted, "Press P, then paint light on something"),
)
_HEIGHT, _MARGIN, _GAP = 32, 10, 22


class HintBar(QFrame):
    """Above the picture, until everything was tried or it is closed; then never again."""

    def __init__(self, context: Context, settings: Settings) -> None:
        super().__init__()
        self.setObjectName("hints")
        self.setFixedHeight(_HEIGHT)
        self.setSizePolicy(QSizePolicy.Policy.Ignored, QSizePolicy.Policy.Fixed)  # a text resizes no picture
        self._settings, self._document = settings, context.document
        self._done: set[int] = set()
        self._labels = [QLabel() for _ in STEPS]
        layout = QHBoxLayout(self)
        layout.setContentsMargins(_MARGIN, 3, _MARGIN, 3)
        layout.setSpacing(_GAP)
        for label in self._labels:
            layout.addWidget(label)
        layout.addStretch(1)
        self._close = QToolButton()
        self._close.setAutoRaise(True)
        self._close.setToolTip("Close the hints")
        self._close.setAccessibleName("Close the hints")
        self._close.clicked.connect(self.dismiss)
        layout.addWidget(self._close)
        self._subscriptions = Subscriptions()
        self._subscriptions.add(context.editing.document.changed.connect(self._edited))
        self._write()
        self.setVisible(self._wanted())

    def handlers(self) -> dict[str, Callable[[], object]]:
        """By action id."""
        return {"help.hints": self.begin_again}

    def conditions(self) -> dict[str, Callable[[], bool]]:
        """By name."""
        return {"furnished": lambda: bool(self._document.scene.nodes)}

    def begin_again(self) -> None:
        """All three, as at the first start."""
        self._settings.set("hinted", None)
        self._done.clear()
        self._write()
        self.setVisible(self._wanted())

    def dismiss(self) -> None:
        """Never show them again."""
        self._settings.set("hinted", True)
        self.hide()

    def close_panel(self) -> None:
        """Stop listening."""
        self._subscriptions.close()

    def set_theme(self, theme: Theme) -> None:
        """The icon in the theme's colour."""
        self._close.setIcon(icon("cancel", theme.dim))

    def _wanted(self) -> bool:
        """There is something to try it on, and not everything was tried."""
        return bool(self._document.scene.nodes) and not self._settings.get("hinted", False)

    def _edited(self, before: Scene, after: Scene, changes: Changes) -> None:
        if self.isHidden() == self._wanted():
            self.setVisible(self._wanted())
        if not before.nodes or changes.aspects & Aspect.STRUCTURE:
            return  # another project, or something new in this one
        done = {index for index, (test, _) in enumerate(STEPS) if test(before, after, changes)}
        if done - self._done:
            self._done |= done
            self._write()
            if len(self._done) == len(STEPS):
                self.dismiss()

    def resizeEvent(self, event: QResizeEvent) -> None:
        """What comes next is told before what comes later."""
        super().resizeEvent(event)
        self._fit()

    def _fit(self) -> None:
        order = sorted(range(len(STEPS)), key=lambda i: i in self._done)
        room = self.width() - self._close.sizeHint().width() - 2 * _MARGIN
        show_what_fits(room, [self._labels[i] for i in order], _GAP)

    def _write(self) -> None:
        for index, (label, (_, text)) in enumerate(zip(self._labels, STEPS, strict=True)):
            done = index in self._done
            label.setText(f"✓  {text}" if done else f"{index + 1}  {text}")
            set_role(label, "dim" if done else "")
        self._fit()
