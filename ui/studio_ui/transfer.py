"""In from other programs and out to them: models, environments, pictures, whole scenes."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from studio_core.contract import Exporter, ImportedModel, Importer
from studio_core.edits import Add
from studio_core.errors import InputError, PluginError
from studio_core.kernels.tonemap import tonemap
from studio_core.scene.geometry import Image
from studio_core.scene.nodes import Group, Node, Scene, new_id
from studio_core.scene.size import model_size, suspicious_size
from studio_core.scene.transform import Transform, vec3
from studio_core.shading.job import Job
from studio_ui.ask import Ask, Filter
from studio_ui.canvas.projection import bounds
from studio_ui.context import Context
from studio_ui.panels.lighting import set_environment

ENVIRONMENTS = Filter("Pictures of light", (".exr", ".hdr", ".tif", ".tiff", ".png", ".jpg", ".jpeg"))
PNG, EXR = Filter("PNG picture, as shown", (".png",)), Filter("OpenEXR, scene-linear", (".exr",))


class Transfer:
    """Imports and exports of the window; all reading and writing happens on the files' thread."""

    def __init__(
        self,
        context: Context,
        ask: Ask,
        frame_all: Callable[[], object],
        beside: Callable[[str], Path],
    ) -> None:
        """`beside` tells where a file of a suffix is suggested to be written."""
        self._context, self._ask, self._frame_all, self._beside = context, ask, frame_all, beside

    def handlers(self) -> dict[str, Callable[[], object]]:
        """By action id."""
        return {
            "file.import": self.import_models,
            "file.environment": self.load_environment,
            "file.export_picture": lambda: self.export_picture(self._beside(".png")),
            "file.export_glb": lambda: self.export_scene("glb", self._beside(".glb")),
            "file.export_mitsuba": lambda: self.export_scene("mitsuba", self._beside("")),
        }

    def conditions(self) -> dict[str, Callable[[], bool]]:
        """By name."""
        return {"picture": lambda: self._context.feed.last is not None}

    # in

    def import_models(self, paths: list[Path] | None = None) -> None:
        """Ask for files unless given, and add what is in them."""
        if paths is None:
            paths = self._ask.open_files("Import model", self._model_filters(), many=True)
        for path in paths:
            self._import(path, 1.0, asked=False)

    def load_environment(self, path: Path | None = None) -> None:
        """Ask for a picture unless given, and light the scene with it."""
        if path is None:
            chosen = self._ask.open_files("Load environment", [ENVIRONMENTS])
            path = chosen[0] if chosen else None
        if path is not None:
            self._environment(path)

    def _environment(self, path: Path) -> None:
        def read(job: Job) -> tuple[Image, tuple[str, ...]]:
            from studio_core.imaging.environment import load_environment

            return load_environment(path)

        def done(found: tuple[Image, tuple[str, ...]]) -> None:
            image, notes = found
            self._tell(path, notes)
            self._context.editing.apply(set_environment(self._context.document.scene, image, path))

        self._context.tasks.run(f"Reading {path.name}", read, done)

    def _import(self, path: Path, unit: float, *, asked: bool) -> None:
        def read(job: Job) -> tuple[ImportedModel, str | None]:
            model = self._importer(path).load(path, unit)
            return model, suspicious_size(model)

        def done(found: tuple[ImportedModel, str | None]) -> None:
            model, question = found
            if question is not None and not asked:
                chosen = self._ask.unit(path.name, model_size(model), question)
                if chosen is not None and chosen != unit:
                    self._import(path, chosen, asked=True)
                if chosen is None or chosen != unit:
                    return
            self._add(path, model)

        self._context.tasks.run(f"Importing {path.name}", read, done)

    def _importer(self, path: Path) -> Importer:
        host = self._context.host
        known: list[str] = []
        for name in host.names("importer"):
            try:
                importer: Importer = host.get("importer", name)
            except PluginError:
                continue
            if path.suffix.lower() in importer.extensions:
                return importer
            known += importer.extensions
        raise InputError(f"{path.name} cannot be imported: known kinds are {', '.join(known) or 'none'}")

    def _add(self, path: Path, model: ImportedModel) -> None:
        scene = self._context.document.scene
        empty = bounds(scene) is None
        edit, root = placed_model(scene, model, path.stem, self._context.session.view.target)
        self._tell(path, model.notes)
        if self._context.editing.apply(edit):
            width, depth, height = model_size(model)
            self._context.journal.write(f"{path.stem}: {width:.2f} × {depth:.2f} × {height:.2f} m.")
            self._context.session.select([root])
            if empty:
                self._frame_all()

    def _model_filters(self) -> list[Filter]:
        if not self._context.warm:
            return []
        found = self._context.host.available("importer").values()
        filters = [Filter(importer.label, tuple(importer.extensions)) for importer in found]
        every = tuple(e for f in filters for e in f.extensions)
        return [Filter("All models", every), *filters]

    def _tell(self, path: Path, notes: tuple[str, ...]) -> None:
        for note in notes:
            self._context.journal.write(f"{path.name}: {note}", "warning")

    # out

    def export_picture(self, suggested: Path) -> None:
        """The picture as it is on the screen (PNG), or scene-linear (EXR)."""
        shown, session = self._context.feed.last, self._context.session
        if shown is None:
            self._context.journal.write("There is no picture to export yet.", "warning")
            return
        path = self._ask.save_file("Export picture", suggested.with_suffix(".png"), [PNG, EXR])
        if path is None:
            return
        if path.suffix.lower() not in (".png", ".exr"):
            path = path.with_name(path.name + ".png")
        exposure, kind, linear = session.exposure, session.tonemap, shown.picture.linear

        def write(job: Job) -> None:
            from studio_core.imaging.encode import write_exr, write_png

            if path.suffix.lower() == ".exr":
                write_exr(path, linear)
            else:
                write_png(path, tonemap(linear, exposure, kind))

        def done(_: None) -> None:
            unfinished = "" if shown.final else " It was still being refined."
            size = f"{linear.shape[1]} × {linear.shape[0]}"
            self._context.journal.write(f"Exported {path.name}, {size} pixels.{unfinished}")

        self._context.tasks.run(f"Exporting {path.name}", write, done)

    def export_scene(self, name: str, suggested: Path) -> None:
        """The scene through an exporter plugin; what it could not express goes to the journal."""
        host = self._context.host
        try:
            exporter: Exporter = host.get("exporter", name)
        except PluginError as error:
            self._context.journal.problem("Exporting", error)
            return
        if exporter.extensions:
            chosen = Filter(exporter.label, tuple(exporter.extensions))
            suffix = exporter.extensions[0]
            path = self._ask.save_file(f"Export {exporter.label}", suggested.with_suffix(suffix), [chosen])
            if path is not None and path.suffix.lower() not in exporter.extensions:
                path = path.with_name(path.name + suffix)
        else:
            path = self._ask.folder(f"Folder for {exporter.label}")
        if path is None:
            return
        target, scene = path, self._context.document.scene

        def done(notes: tuple[str, ...]) -> None:
            self._context.journal.write(f"Exported {target.name}.")
            self._tell(target, notes)

        def write(job: Job) -> Any:
            return exporter.save(scene, target, host)

        self._context.tasks.run(f"Exporting {target.name}", write, done)


def placed_model(
    scene: Scene, model: ImportedModel, name: str, towards: tuple[float, float, float]
) -> tuple[Add, str]:
    """The edit that adds a model under one node, standing on the floor, and that node's id.

    The first model stands where its file has it; later ones at the point that is looked at.
    """
    nodes: list[Node] = list(model.nodes)
    ids = {node.id for node in nodes}
    tops = [node for node in nodes if node.parent not in ids]
    if len(tops) != 1:
        group = Group(id=new_id("group"), name=name)
        nodes = [dataclasses.replace(n, parent=group.id) if n in tops else n for n in nodes]
        nodes.insert(0, group)
        top: Node = group
    else:
        top = tops[0]
    found = bounds(Scene().with_nodes(*nodes), (top.id,))
    if found is not None:
        low, high = found
        move = np.array([0.0, -low[1], 0.0])
        if bounds(scene) is not None:
            centre = (low + high) / 2
            move[[0, 2]] = np.round(np.array(towards)[[0, 2]] / 0.05) * 0.05 - centre[[0, 2]]
        placed = dataclasses.replace(top, transform=Transform(vec3(move)) @ top.transform)
        nodes[nodes.index(top)] = placed
    return Add(tuple(nodes), model.materials, f"Import {name}"), top.id
