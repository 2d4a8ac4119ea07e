"""In from other programs and out to them: models, environments, pictures, whole scenes."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from studio_core.contract import Exporter
from studio_core.errors import PluginError
from studio_core.scene.geometry import Image
from studio_core.shading.job import Job
from studio_core.signal import Signal
from studio_ui.ask import Ask, Filter
from studio_ui.context import Context
from studio_ui.panels.environment_shelf import set_environment

ENVIRONMENTS = Filter("Pictures of light", (".exr", ".hdr", ".tif", ".tiff", ".png", ".jpg", ".jpeg"))


class Transfer:
    """Imports and exports of the window; all reading and writing happens on the files' thread."""

    def __init__(
        self,
        context: Context,
        ask: Ask,
        beside: Callable[[str], Path],
    ) -> None:
        """`beside` tells where a file of a suffix is suggested to be written."""
        self.lit: Signal[[Path]] = Signal()  # an environment was loaded
        self._context, self._ask, self._beside = context, ask, beside

    def handlers(self) -> dict[str, Callable[[], object]]:
        """By action id."""
        return {
            "file.environment": self.load_environment,
            "file.export_glb": lambda: self.export_scene("glb", self._beside(".glb")),
            "file.export_materialx": lambda: self.export_scene("materialx", self._beside(".mtlx")),
            "file.export_mitsuba": lambda: self.export_scene("mitsuba", self._beside("")),
        }

    def conditions(self) -> dict[str, Callable[[], bool]]:
        """None."""
        return {}

    # in

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
            self._context.editing.apply(set_environment(self._context.document.scene, image, path.stem))
            self.lit.emit(path)

        self._context.tasks.run(f"Reading {path.name}", read, done)

    def _tell(self, path: Path, notes: tuple[str, ...]) -> None:
        for note in notes:
            self._context.journal.write(f"{path.name}: {note}", "warning")

    # out

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
