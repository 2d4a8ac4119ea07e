"""`lucarne stress ui`: does the window stay free while pictures are computed?

Opens the sample room (offscreen unless a platform is set) with the window's own backend, and edits and undoes
like somebody in a hurry. Prints how long the window's thread was away (stall), how long a cancelled job went
on (cancel), and how long the first picture after an edit took.
"""

from __future__ import annotations

import os
import sys
import tempfile
import time
from collections.abc import Callable

import numpy as np

from studio.bench.harness import Report
from studio.headless import Headless
from studio_core.errors import LucarneError

BEAT_MS = 5


def run(report: Report, program: Headless) -> None:
    """Rows `stall`, `cancel`, `first_picture` with percentiles in milliseconds."""
    os.environ.setdefault("QT_QPA_PLATFORM", "offscreen")
    os.environ["LUCARNE_STATE"] = tempfile.mkdtemp(prefix="lucarne-stress-")
    from PySide6.QtCore import QTimer
    from PySide6.QtWidgets import QApplication

    from studio.app import assemble
    from studio.samples import sample

    application = QApplication.instance() or QApplication(sys.argv[:1])
    studio = assemble()
    hurry = _Hurry(studio, 12 if report.quick else 40)
    studio.window.resize(1280, 800)
    studio.window.show()
    heart = QTimer()
    heart.timeout.connect(hurry.beat)
    QTimer.singleShot(0, lambda: studio.window.files.open_copy(sample()))
    hurry.finished = lambda: application.exit(0)  # quit would ask about unsaved changes
    heart.start(BEAT_MS)
    QTimer.singleShot(240_000, lambda: application.exit(1))
    application.exec()
    heart.stop()
    studio.close()
    if not hurry.done:
        raise LucarneError("the window did not get through the edits in four minutes")
    report.notes.append(_circumstances(studio.context.session.backend))
    for name, values in (
        ("stall", hurry.stalls),
        ("cancel", hurry.cancels),
        ("first_picture", hurry.pictures),
    ):
        milliseconds = 1000 * np.array(values or [np.nan])
        for percentile in (50, 99, 100):
            report.add("ui", f"{name}_p{percentile}_ms", float(np.percentile(milliseconds, percentile)), "ms")
        report.add("ui", f"{name}_count", len(values), "1")


def _circumstances(backend: str) -> str:
    """What the figures depend on, in words."""
    said = f"Backend `{backend}`, edits of one chair at a time, and undo."
    if hasattr(os, "getloadavg"):
        said += f" Load of the machine at the end, others included: {os.getloadavg()[0]:.1f}."
    return said


class _Hurry:
    """One beat at a time: watch the clock, and when it is due, do the next thing."""

    def __init__(self, studio: object, times: int) -> None:
        self.studio: object = studio
        self.left = times
        self.stalls: list[float] = []
        self.cancels: list[float] = []
        self.pictures: list[float] = []
        self.finished: Callable[[], object] = lambda: None
        self.done = False
        self._last = 0.0
        self._next = 0.0
        self._asked = 0.0
        self._cancelled: tuple[object, float] | None = None
        self._rng = np.random.default_rng(0)
        self.studio.context.feed.shown.connect(self._shown)  # type: ignore[attr-defined]

    def beat(self) -> None:
        """Called every few milliseconds by the window's thread."""
        now = time.perf_counter()
        if self._last:
            self.stalls.append(max(0.0, now - self._last - BEAT_MS / 1000))
        context = self.studio.context  # type: ignore[attr-defined]
        job = context.feed.job
        if self._cancelled is not None and job is not self._cancelled[0]:
            self.cancels.append(now - self._cancelled[1])
            self._cancelled = None
        elif self._cancelled is None and job is not None and job.cancelled:
            self._cancelled = (job, now)
        if context.document.scene.nodes and context.feed.last is not None and now >= self._next:
            self._act(context, now)
        self._last = time.perf_counter()

    def _act(self, context: object, now: float) -> None:
        from studio_core.edits import Move
        from studio_core.scene.nodes import MeshObject
        from studio_core.scene.transform import Transform

        if self.left == 0:
            self.done = True
            self.finished()
            return
        self.left -= 1
        document = context.document  # type: ignore[attr-defined]
        if self.left % 4 == 3 and document.can_undo:
            document.undo()
        else:
            objects = [n for n in document.scene.of(MeshObject) if n.name.startswith("Chair")]
            node = objects[self.left % len(objects)]
            x, z = (float(v) for v in self._rng.uniform(-0.1, 0.1, 2))
            document.apply(Move({node.id: Transform((x, 0.0, z)) @ node.transform}))
        self._asked = now
        self._next = now + float(self._rng.uniform(0.4, 3.0))

    def _shown(self, _: object) -> None:
        if self._asked:
            self.pictures.append(time.perf_counter() - self._asked)
            self._asked = 0.0
