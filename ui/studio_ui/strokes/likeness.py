"""What else would change with a stroke, over the picture: in a pattern of the accent's colour."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
from PySide6.QtCore import QObject
from PySide6.QtGui import QColor

from studio_core.scene.diff import Aspect, Changes
from studio_core.scene.nodes import NodeId, Scene
from studio_core.shading.artifacts import Hits, Surfaces
from studio_core.shading.job import Job
from studio_core.signal import Signal
from studio_core.strokes.solution import Lit
from studio_ui.canvas.overlay import Film, Overlay
from studio_ui.context import Context, Subscriptions
from studio_ui.strokes.bench import Bench, lit_for
from studio_ui.strokes.brush_store import BrushStore
from studio_ui.strokes.sheet import Placed

F32 = npt.NDArray[np.float32]
MOST = 300_000
"""Pixels of the pattern: more are not told apart."""
CHECKS = 110
"""Down the picture, whatever pixels it has."""
_STRONG, _WEAK = 0.75, 0.25
_SHADED = Aspect.TRANSFORM | Aspect.STRUCTURE | Aspect.GEOMETRY


class Likeness(QObject):
    """Asked for while `stroke` is one; `changed()` when there is another pattern, or none."""

    def __init__(self, context: Context, store: BrushStore, bench: Bench) -> None:
        super().__init__()
        self.changed: Signal[[]] = Signal()
        self.stroke: NodeId | None = None
        self._context, self._store, self._bench = context, store, bench
        self._amount: F32 | None = None
        self._asked = self._again = False
        self._colour = QColor("#f2a83b")
        self._subscriptions = Subscriptions()
        self._subscriptions.add(
            context.document.changed.connect(self._edited),
            context.session.changed.connect(lambda _: self._drop()),
            context.feed.shown.connect(lambda _: self._missing()),
        )

    def close(self) -> None:
        """Stop."""
        self._subscriptions.close()
        self.stroke = None

    def show(self, stroke: NodeId | None) -> None:
        """The pattern of this stroke from now on; None: none."""
        self.stroke = stroke
        self._drop()
        self._ask()

    def marks(self, placed: Placed) -> Overlay:
        """The pattern over the picture."""
        if self._amount is None or self.stroke is None:
            return Overlay()
        height, width = self._amount.shape
        rows, columns = np.indices((height, width))
        size = max(round(height / CHECKS), 1)
        check = np.where((rows // size + columns // size) % 2, _STRONG, _WEAK)
        pixels = np.empty((height, width, 4), np.uint8)
        pixels[..., :3] = self._colour.red(), self._colour.green(), self._colour.blue()
        pixels[..., 3] = np.rint(255 * check * np.clip(self._amount, 0, 1))
        left, top, right, bottom = placed
        return Overlay((Film(pixels, (left, top), (right, bottom)),))

    def _edited(self, before: Scene, after: Scene, changes: Changes) -> None:
        if self.stroke is None:
            return
        if self.stroke not in after.nodes or changes.aspects & _SHADED:
            self._drop()
        if before.nodes.get(self.stroke) is not after.nodes.get(self.stroke):
            self._ask()

    def _drop(self) -> None:
        if self._amount is not None:
            self._amount = None
            self.changed.emit()

    def _missing(self) -> None:
        """Another picture: of another view or of moved things it needs another pattern."""
        if self._amount is None:
            self._ask()

    def _ask(self) -> None:
        scene, stroke = self._context.document.scene, self.stroke
        if stroke is None or stroke not in scene.nodes:
            return
        if self._asked:
            self._again = True
            return
        self._asked, self._again = True, False
        bench, solver = self._bench, self._store.now.solver

        def work(pipeline: Any, job: Job) -> F32 | None:
            lit: Lit | None = lit_for(pipeline, scene, {})
            if lit is None or lit.hits is None:
                return None
            return spread(bench.likeness(scene, stroke, lit, solver, job), lit.surfaces, lit.hits)

        def done(found: Any, error: Exception | None) -> None:
            self._asked = False
            if error is None and found is not None and stroke == self.stroke:
                self._amount = found
                self.changed.emit()
            if self._again:
                self._ask()

        self._context.feed.ask("likeness", scene, work, done)


def spread(amount: F32, surfaces: Surfaces, hits: Hits) -> F32:
    """(h, w) of the picture's pixels, or fewer, between values (V,) of the unrefined vertices."""
    height, width = hits.view.height, hits.view.width
    step = max(1, int(np.ceil(np.sqrt(height * width / MOST))))
    middle = hits.samples // 2 * (hits.samples + 1)
    rows, columns = np.arange(0, height, step), np.arange(0, width, step)
    sample = ((rows[:, None] * width + columns) * hits.samples**2 + middle).ravel()
    face = hits.face[sample]
    seen = np.flatnonzero(face >= 0)
    made = np.zeros(len(sample), np.float32)
    base = surfaces.unrefined.mesh
    if surfaces.tree is None:
        some = sample[seen]
        weights = np.stack([1 - hits.u[some] - hits.v[some], hits.u[some], hits.v[some]], axis=1)
        made[seen] = (weights * amount[base.faces[face[seen]]]).sum(axis=1)
    else:
        made[seen] = amount[base.faces[surfaces.tree.origins()[face[seen]]]].mean(axis=1)
    return made.reshape(len(rows), len(columns))


__all__ = ["Likeness", "spread"]
