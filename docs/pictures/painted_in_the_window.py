"""Photographs the stroke panel after a stroke in a colour of the picture; see `make.py`."""

from __future__ import annotations

import os
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class Painting:
    """Of a sample room: where the colour is taken and the path, in parts of the picture; the brush."""

    sample: str
    colour: tuple[float, float]
    path: tuple[tuple[float, float], ...]
    size: float
    indirect: bool = False


SOFA = Painting("living-room", (0.9, 0.51), ((0.47, 0.51), (0.49, 0.52), (0.51, 0.52)), 0.06)
TINT = Painting("red-cabinet", (0.09, 0.48), ((0.39, 0.44), (0.41, 0.5), (0.43, 0.57)), 0.26, True)


def photograph(painting: Painting, target: Path, size: tuple[int, int], patience: float) -> None:
    """A window of so many pixels, to a file; `patience` in seconds."""
    os.environ.setdefault("QT_QPA_PLATFORM", "offscreen")
    os.environ["LUCARNE_STATE"] = tempfile.mkdtemp(prefix="lucarne-pictures-")
    from PySide6.QtCore import QPoint, QRect, Qt
    from PySide6.QtTest import QTest
    from PySide6.QtWidgets import QApplication

    from studio.app import assemble
    from studio.samples import sample
    from studio_ui.feed import Freshness
    from studio_ui.settings import Settings, state_folder

    application = QApplication(sys.argv[:1])
    studio = assemble(settings=Settings(state_folder()))
    studio.window.resize(*size)
    studio.window.show()
    studio.window.files.open_copy(sample(painting.sample))
    feed = studio.context.feed

    def wait(for_what: Callable[[], bool]) -> None:
        until = time.monotonic() + patience
        while not for_what():
            if time.monotonic() > until:
                raise SystemExit("the stroke was not explained")
            application.processEvents()
            time.sleep(0.01)

    def rests() -> bool:
        return feed.state is Freshness.CURRENT and not feed.busy

    wait(lambda: studio.context.warm and feed.last is not None and rests())
    studio.window.actions_["tool.stroke"].trigger()
    canvas, desk, panel = (
        studio.window.viewport.inner,
        studio.window.strokes.desk(),
        studio.window.stroke_panel,
    )
    button, none = Qt.MouseButton.LeftButton, Qt.KeyboardModifier.NoModifier

    def at(place: tuple[float, float]) -> QPoint:
        return QPoint(round(place[0] * canvas.width()), round(place[1] * canvas.height()))

    desk.store.use(size=painting.size, indirect=painting.indirect)
    QTest.mouseClick(canvas, button, Qt.KeyboardModifier.AltModifier, at(painting.colour))
    QTest.mousePress(canvas, button, none, at(painting.path[0]))
    for place in painting.path[1:]:
        QTest.mouseMove(canvas, at(place))
    QTest.mouseRelease(canvas, button, none, at(painting.path[-1]))
    wait(
        lambda: (
            not desk.work.begun and rests() and panel.controls is not None and bool(panel.controls.why.cards)
        )
    )
    wait(lambda: desk.sketches.done)
    left = canvas.mapTo(studio.window, QPoint(0, 0)).x()
    seen = QRect(left, 0, studio.window.width() - left, studio.window.height())  # the picture and the panel
    if not studio.window.grab(seen).save(str(target), "webp", 88):
        raise SystemExit("the picture cannot be written")
    studio.close()


__all__ = ["SOFA", "TINT", "Painting", "photograph"]
