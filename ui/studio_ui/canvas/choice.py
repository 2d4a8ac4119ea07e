"""Which canvas is shown: the GPU's where a graphics card draws, or what a person prefers.

`LUCARNE_CANVAS` (auto, gpu, software) comes before the preference. What OpenGL can do is asked in a child
process while the window is up already; what has drawn once is used at once the next time. That the canvas is
being tried is remembered until it has drawn: a driver that ends the program does so once.
"""

from __future__ import annotations

import os
from collections.abc import Callable

from PySide6.QtCore import QObject, QProcess, QProcessEnvironment
from PySide6.QtGui import QGuiApplication

from studio_core.signal import Signal
from studio_ui.canvas import gl_report
from studio_ui.canvas.gl_report import GlReport
from studio_ui.canvas.raster_viewport import RasterViewport
from studio_ui.canvas.switch_viewport import SwitchViewport
from studio_ui.canvas.viewport import Viewport
from studio_ui.journal import Level
from studio_ui.settings import Settings

AUTO, GPU, SOFTWARE = PREFERENCES = ("auto", "gpu", "software")
VARIABLE = "LUCARNE_CANVAS"
HIDDEN = ("offscreen", "minimal")
"""Qt's platforms that have no OpenGL."""
_TRYING, _PREFERRED, _CARD = "canvas_trying", "canvas", "canvas_card"
Say = Callable[[str, Level], None]


class CanvasChoice:
    """`changed` is emitted when another canvas is shown; `say(text, level)` writes a line of the log."""

    def __init__(self, viewport: SwitchViewport, settings: Settings, say: Say) -> None:
        self.changed: Signal[[]] = Signal()
        self.report: GlReport | None = None
        self._viewport, self._settings, self._say = viewport, settings, say
        self._process: QProcess | None = None
        self._owner = QObject()

    @property
    def preference(self) -> str:
        """`auto`, `gpu` or `software`."""
        asked = os.environ.get(VARIABLE, "") or self._settings.get(_PREFERRED, AUTO)
        return asked if asked in PREFERENCES else AUTO

    @property
    def shown(self) -> str:
        """`gpu` or `software`."""
        return SOFTWARE if isinstance(self._viewport.inner, RasterViewport) else GPU

    def start(self) -> None:
        """Follow the preference; before the window is shown, where that can be."""
        if self.shown == GPU:
            return
        platform = QGuiApplication.platformName()
        if self.preference == SOFTWARE:
            return
        if platform in HIDDEN:
            if self.preference == GPU:
                self._fall_back(f"Qt's {platform} platform has no OpenGL")
            return
        if self._settings.get(_TRYING, False) and self.preference == AUTO:
            self._settings.set(_CARD, None)
            self._fall_back("the program ended while it was being tried last time")
            return
        known = GlReport(True, self._settings.get(_CARD, ""))
        if known.renderer and (known.hardware or self.preference == GPU):
            self._try()
        else:
            self._ask()

    def prefer(self, preference: str) -> None:
        """Another preference, remembered, and followed at once."""
        self._settings.set(_PREFERRED, preference)
        self._settings.set(_TRYING, None)
        os.environ.pop(VARIABLE, None)
        if preference == SOFTWARE:
            self._show(RasterViewport())
        else:
            self.start()

    def close(self) -> None:
        """Ask nothing more."""
        process, self._process = self._process, None
        if process is not None:
            process.finished.disconnect()
            process.kill()
            process.waitForFinished(2000)

    def _ask(self) -> None:
        """What OpenGL can do, of a child."""
        if self._process is not None:
            return
        (program, *arguments), environment = gl_report.command()
        process = self._process = QProcess(self._owner)
        values = QProcessEnvironment()
        for name, value in environment.items():
            values.insert(name, value)
        process.setProcessEnvironment(values)
        process.finished.connect(self._answered)
        process.errorOccurred.connect(self._unanswered)
        process.start(program, arguments)

    def _unanswered(self, error: QProcess.ProcessError) -> None:
        if error is QProcess.ProcessError.FailedToStart:
            self._process = None
            self._fall_back("it cannot be asked what OpenGL can do")

    def _answered(self, status: int, how: QProcess.ExitStatus) -> None:
        process, self._process = self._process, None
        if process is None:
            return
        output, complaints = (
            bytes(read().data()).decode("utf-8", "replace")
            for read in (process.readAllStandardOutput, process.readAllStandardError)
        )
        crashed = how is QProcess.ExitStatus.CrashExit
        self.report = gl_report.parse(-1 if crashed else status, output, complaints)
        process.deleteLater()
        self._decide(self.report)

    def _decide(self, report: GlReport) -> None:
        if self.preference == SOFTWARE or self.shown == GPU:
            return
        if not report.usable:
            self._fall_back(report.reason)
        elif report.hardware or self.preference == GPU:
            self._try()
        # a software renderer is no quicker than the canvas that is shown

    def _try(self) -> None:
        """The GPU canvas; remembered as being tried until it has drawn."""
        try:
            from studio_ui.canvas.vispy_viewport import VispyViewport
        except Exception as error:  # a missing library, or one that does not load
            self._fall_back(str(error))
            return
        self._settings.set(_TRYING, True)
        made = VispyViewport(self._failed)
        surface = made.surface
        surface.frameSwapped.connect(lambda: surface.tally.draws and self._drawn(surface.drawn_by))
        self._show(made)

    def _drawn(self, renderer: str) -> None:
        self._settings.set(_TRYING, None)
        self._settings.set(_CARD, renderer)

    def _failed(self, reason: str) -> None:
        """The GPU canvas draws no more."""
        self._settings.set(_TRYING, None)
        self._settings.set(_CARD, None)
        if self.shown == GPU:
            self._show(RasterViewport())
        self._fall_back(reason)

    def _fall_back(self, reason: str) -> None:
        self._say(f"The canvas is drawn without the graphics card: {reason.rstrip('.')}.", "warning")

    def _show(self, viewport: Viewport) -> None:
        if isinstance(viewport, RasterViewport) and self.shown == SOFTWARE:
            return
        self._viewport.use(viewport)
        self.changed.emit()
