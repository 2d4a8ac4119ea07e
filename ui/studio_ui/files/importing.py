"""Models that come in: read away from the window, asked about when their size or axis is doubtful, placed."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from studio_core.contract import ImportedModel
from studio_core.edits import Add, Move
from studio_core.exchange.files import importer_of
from studio_core.scene.arranging import roots
from studio_core.scene.bounds import exact_bounds
from studio_core.scene.imported import UPRIGHT, Up, converted
from studio_core.scene.nodes import NodeId, Scene
from studio_core.scene.size import model_bounds, model_size
from studio_core.scene.transform import Transform, vec3
from studio_core.shading.job import Job
from studio_ui.ask import Ask, Filter
from studio_ui.canvas.projection import bounds
from studio_ui.context import Context
from studio_ui.files.import_question import (
    ImportChoice,
    ImportQuestion,
    kept,
    question,
    remembered,
    some_lines,
)
from studio_ui.files.landing import F64, Landing, beside, placed_model
from studio_ui.objects.choosing import meshes_below
from studio_ui.settings import Settings

_SETTING = "import"
_BETWEEN = 0.15  # metres between models that are dropped together


@dataclass
class _Wanted:
    path: Path
    options: bool
    batch: _Batch


@dataclass
class _Batch:
    """Files that came together: the next one stands beside the last."""

    where: Landing | None


class Importing:
    """File ▸ Import, and what dropping a model does; one file after the other."""

    def __init__(
        self, context: Context, ask: Ask, settings: Settings, frame_all: Callable[[], object]
    ) -> None:
        self._context, self._ask, self._settings, self._frame_all = context, ask, settings, frame_all
        self._queue: deque[_Wanted] = deque()
        self._busy = False

    def handlers(self) -> dict[str, Callable[[], object]]:
        """By action id."""
        return {
            "file.import": self.choose,
            "file.import_options": lambda: self.choose(options=True),
            "object.correct_units": self.correct,
        }

    def conditions(self) -> dict[str, Callable[[], bool]]:
        """By name."""
        return {"correctable": lambda: bool(self._correctable())}

    def choose(self, *, options: bool = False) -> None:
        """Ask for files."""
        title = "Import with options" if options else "Import model"
        self.take(self._ask.open_files(title, self._filters(), many=True), options=options)

    def take(self, paths: Sequence[Path], where: Landing | None = None, *, options: bool = False) -> None:
        """Import files; on a landing they stand side by side. `options` asks about each of them."""
        batch = _Batch(where)
        self._queue.extend(_Wanted(path, options, batch) for path in paths)
        self._next()

    def correct(self) -> None:
        """Another unit or axis for what is chosen: larger or smaller about its foot, one step."""
        nodes = self._correctable()
        scene = self._context.document.scene
        if not nodes:
            return
        choice = self._ask.import_options(_about(scene, nodes))
        if choice is None or (choice.unit, choice.up) == (1.0, "y"):
            return
        edit = corrected(scene, nodes, choice.unit, choice.up)
        self._context.editing.apply(edit)

    def _correctable(self) -> tuple[NodeId, ...]:
        scene = self._context.document.scene
        chosen = (n for n in self._context.session.selection if n in scene.nodes)
        return tuple(n for n in roots(scene, chosen) if meshes_below(scene, (n,)))

    def _next(self) -> None:
        if self._busy or not self._queue:
            return
        self._busy = True
        wanted = self._queue.popleft()
        path, host = wanted.path, self._context.host
        guess = remembered(self._settings.get(_SETTING, {}), path.suffix.lower())

        def read(job: Job) -> tuple[ImportedModel, ImportQuestion | None]:
            model = importer_of(host, path).load(path)
            job.checkpoint()
            return model, question(path, model, guess) if model.nodes or not model.materials else None

        def done(found: tuple[ImportedModel, ImportQuestion | None]) -> None:
            model, asked = found
            try:
                if asked is None:
                    self._add_materials(path, model)
                else:
                    self._answered(wanted, model, asked)
            finally:
                self._after()

        self._context.tasks.run(f"Importing {path.name}", read, done, lambda error: self._after())

    def _answered(self, wanted: _Wanted, model: ImportedModel, asked: ImportQuestion) -> None:
        choice: ImportChoice | None = asked.guess
        if wanted.options or asked.doubt:
            choice = self._ask.import_options(asked)
            if choice is None:
                return
            if choice.remember:
                values = self._settings.get(_SETTING, {})
                self._settings.set(_SETTING, kept(values, asked.suffix, choice))
        self._add(wanted, converted(model, choice.unit, choice.up), choice)

    def _after(self) -> None:
        self._busy = False
        self._next()

    def _add(self, wanted: _Wanted, model: ImportedModel, choice: ImportChoice) -> None:
        context, path, where = self._context, wanted.path, wanted.batch.where
        scene, view = context.document.scene, context.session.view
        empty = bounds(scene) is None
        width, depth, height = model_size(model)
        edit, root = placed_model(
            scene, model, path.stem, where or view.target, stand=choice.stand, centre=choice.centre
        )
        for note in model.notes:
            context.journal.write(f"{path.name}: {note}", "warning")
        if context.editing.apply(edit):
            context.journal.write(f"{path.stem}: {width:.2f} × {depth:.2f} × {height:.2f} m.")
            context.session.select([root])
            if where is not None:
                wanted.batch.where = beside(where, view, max(width, depth) + _BETWEEN)
            if empty:
                self._frame_all()

    def _add_materials(self, path: Path, model: ImportedModel) -> None:
        """A file that holds materials alone: they wait among the materials until they are used."""
        for note in model.notes:
            self._context.journal.write(f"{path.name}: {note}", "warning")
        count = len(model.materials)
        few = " and ".join(material.name for material in model.materials[:3])
        names, it = (few, "them" if count > 1 else "it") if count < 4 else (f"{count} materials", "them")
        if self._context.editing.apply(Add((), model.materials, f"Import {names}")):
            verb = "is" if count == 1 else "are"
            self._context.journal.write(f"{names} {verb} among the materials now: drag {it} onto an object.")

    def _filters(self) -> list[Filter]:
        if not self._context.warm:
            return []
        found = self._context.host.available("importer").values()
        filters = [Filter(importer.label, tuple(importer.extensions)) for importer in found]
        every = tuple(e for f in filters for e in f.extensions)
        return [Filter("All that can be imported", every), *filters]


def corrected(scene: Scene, nodes: Sequence[NodeId], factor: float, up: Up) -> Move:
    """Each node `factor` times as large and, for z, turned upright, about the middle of its foot."""
    local: dict[NodeId, Transform] = {}
    turn = Transform(rotation=UPRIGHT) if up == "z" else Transform()
    for node in nodes:
        box = exact_bounds(scene, (node,))
        if box is None:
            continue
        foot = _foot(*box)
        change = Transform(scale=factor) @ turn @ Transform(vec3(-foot))
        world = change @ scene.world(node)
        parent = scene[node].parent
        above = Transform() if parent is None else scene.world(parent)
        moved = Move({node: above.inverse() @ world})(scene)
        after = exact_bounds(moved, (node,))
        assert after is not None
        local[node] = above.inverse() @ (Transform(vec3(foot - _foot(*after))) @ world)
    names = scene[nodes[0]].name if len(nodes) == 1 else f"{len(nodes)} objects"
    return Move(local, f"Correct units of {names}")


def _foot(low: F64, high: F64) -> F64:
    """Middle of a box' lower face."""
    return np.array([(low[0] + high[0]) / 2, low[1], (low[2] + high[2]) / 2])


def _about(scene: Scene, nodes: Sequence[NodeId]) -> ImportQuestion:
    """The question about what is in the scene already."""
    found = [
        replace(mesh, parent=None, transform=scene.world(mesh.id)) for mesh in meshes_below(scene, nodes)
    ]
    model = ImportedModel(tuple(found), ())
    return ImportQuestion(
        name=scene[nodes[0]].name if len(nodes) == 1 else f"{len(nodes)} objects",
        triangles=sum(len(mesh.geometry.faces) for mesh in found),
        materials=len({material for mesh in found for material in mesh.materials}),
        bounds=np.stack(model_bounds(model)),
        lines=some_lines(model),
        guess=ImportChoice(),
        correcting=True,
    )
