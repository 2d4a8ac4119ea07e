"""The composition root of the window: every object is made here once and passed along."""

from __future__ import annotations

import contextlib
import os
import subprocess
import sys
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, NoReturn

from PySide6.QtCore import QCoreApplication, QEvent, Qt
from PySide6.QtWidgets import QApplication

from studio import compile_ahead, samples
from studio.crash_log import crash_log
from studio_core.contract import Services, ShadingBackend
from studio_core.document import Document
from studio_core.errors import LucarneError
from studio_core.folders import user_cache
from studio_core.library.lucmat import SUFFIX as MATERIAL
from studio_core.parallel import Workers
from studio_core.params import build
from studio_core.registry import PluginHost
from studio_core.scene.nodes import Scene
from studio_core.session import Session
from studio_core.shading.artifacts import MeasuredError
from studio_core.shading.cache import DiskCache
from studio_core.shading.frame import Frame, IndirectChoice
from studio_core.shading.job import Job
from studio_core.shading.pipeline import Pipeline
from studio_core.shading.scheduler import ComputeThread, Executor
from studio_core.strokes.solution import Lit
from studio_ui.ask import Ask
from studio_ui.bridge import Bridge
from studio_ui.canvas.raster_viewport import RasterViewport
from studio_ui.canvas.switch_viewport import SwitchViewport
from studio_ui.context import Context
from studio_ui.editing import Editing
from studio_ui.feed import PictureFeed
from studio_ui.files.thumbnails import Thumbnails
from studio_ui.journal import Journal
from studio_ui.lazy_pipeline import Shading
from studio_ui.main_window import MainWindow
from studio_ui.plugins.dialog import OFF
from studio_ui.preferences.catalogue import SYSTEM
from studio_ui.preferences.store import Preferences
from studio_ui.settings import Settings, state_folder
from studio_ui.tasks import Tasks

COMPILE_AFTER = 8_000  # ms after the start: when the first picture is there


class PluginShading:
    """Pipelines of the registered backends; satisfies `studio_ui.feed.Shading`."""

    def __init__(self, services: Services) -> None:
        self._services = services
        self._unrefined: Any = None
        self._meter: Any = None  # keeps textures' tables; made on the compute thread, it loads kernels

    def pipeline(self, backend: str) -> Pipeline:
        """The backend's stages and the picture they end in."""
        from studio_core.raster import PictureStage
        from studio_core.shading.indirect import with_indirect

        found: ShadingBackend = self._services.registry.get("backend", backend)
        stages = with_indirect(found.stages(self._services), self._services)
        return Pipeline([*stages, PictureStage(self._services)])

    def measure(self, pipeline: Pipeline, frame: Frame, job: Job) -> MeasuredError | None:
        """The error of what the pipeline last made; surer each time it is asked for."""
        from studio_core.shading.error_meter import ErrorMeter, SteadyMeter

        self._meter = self._meter or SteadyMeter(ErrorMeter(self._services))
        found: MeasuredError | None = self._meter(pipeline, frame, job)
        return found

    def lit(self, pipeline: Pipeline, scene: Scene) -> Lit | None:
        """What the pipeline's newest frame has for solvers of strokes."""
        from studio_core.shading.indirect import UnrefinedShapes
        from studio_core.strokes.lit import lit_of

        self._unrefined = self._unrefined or UnrefinedShapes(self._services)
        found: Lit | None = lit_of(pipeline, scene, self._unrefined)
        return found

    def params(self, backend: str, values: Mapping[str, Any]) -> Any:
        """The backend's parameters, checked."""
        return build(self._services.registry.get("backend", backend).Params, values)

    def indirect(self, choice: IndirectChoice) -> IndirectChoice | None:
        """The choice with its parameters, checked."""
        from studio_core.shading.indirect import KIND
        from studio_core.shading.offline import indirect_choice

        registry = self._services.registry
        if choice.method not in registry.names(KIND):
            return None  # of a plugin that is not there
        return indirect_choice(registry, choice.method, choice.params)


@dataclass
class Studio:
    """A window with everything behind it. `close` ends threads; the window is to be closed before."""

    window: MainWindow
    context: Context
    bridge: Bridge
    workers: Workers
    executors: tuple[Executor, ...]

    def close(self) -> None:
        """Wait for threads and let Qt delete what it has to."""
        self.window.closing = True  # nobody is asked any more
        self.window.shut()
        for executor in self.executors:
            executor.close()
        self.bridge.close()
        self.workers.close()
        self.window.close()
        self.window.deleteLater()
        self.bridge.deleteLater()
        QCoreApplication.sendPostedEvents(None, QEvent.Type.DeferredDelete)


def assemble(
    *,
    settings: Settings | None = None,
    host: PluginHost | None = None,
    shading: Shading | None = None,
    compute: Executor | None = None,
    files: Executor | None = None,
    ask: Ask | None = None,
    threads: int | None = None,
    thumbnails: Path | None = None,
) -> Studio:
    """A window with an empty document; what is not given is the real thing. Needs a QApplication."""
    settings = settings or Settings(state_folder())
    thumbnails = thumbnails or user_cache() / "thumbnails"
    host = host or PluginHost.discover(settings.get(OFF, []))
    workers = Workers(threads)
    aside = files or ComputeThread()
    compute, files = compute or ComputeThread(), files or ComputeThread()
    journal, document, session = Journal(), Document(), Session()
    journal.blame = partial(_blame, host)
    bridge = Bridge(lambda error: journal.problem("Something in the window", error))

    editing = Editing(document, journal.problem)
    tasks = Tasks(files, bridge.post, journal)
    cache = DiskCache(user_cache() / "computed", cache_limit(settings))
    services = Services(workers, host, cache)
    shading = shading or PluginShading(services)
    feed = PictureFeed(document, session, shading, compute, bridge.post, bridge.later)
    context = Context(document, session, editing, host, journal, tasks, feed, services, compute, bridge.quiet)
    context.aside = aside
    viewport = SwitchViewport(RasterViewport())
    window = MainWindow(context, viewport, settings, files, _samples(), ask, Thumbnails(thumbnails))
    for failure in host.failures:
        journal.write(f"The plugin {failure.plugin} {failure.what}", "problem", failure.traceback)
    _warm(context, compute, files, bridge)
    return Studio(window, context, bridge, workers, (compute, files, aside))


def cache_limit(settings: Settings) -> int:
    """Bytes that may be kept of what was computed."""
    return round(Preferences(settings).get("cache") * 2**20)


def run_window(path: Path | None, *, read_only: bool = False) -> int:
    """Open the window on a project (None: the sample room); the program's exit status."""
    settings = Settings(state_folder())
    scale = Preferences(settings).get("scale")
    if scale != SYSTEM:
        os.environ.setdefault("QT_SCALE_FACTOR", scale)
    QApplication.setAttribute(Qt.ApplicationAttribute.AA_ShareOpenGLContexts)
    application = QApplication.instance() or QApplication(sys.argv[:1])
    assert isinstance(application, QApplication)
    application.setApplicationName("Lucarne")
    application.setDesktopFileName("lucarne")
    with crash_log(settings.folder) as crashed:
        studio = assemble(settings=settings)
        compiling: list[subprocess.Popen[bytes]] = []
        before, sys.excepthook = sys.excepthook, _hook(studio.context.journal)
        try:
            studio.window.canvas.start()
            studio.window.show()
            if crashed:
                studio.window.front.crashed(crashed)
            _first(studio, path, read_only)
            studio.bridge.later(
                COMPILE_AFTER, lambda: studio.executors[1].submit(lambda: _compile(compiling))
            )
            with staying():
                return application.exec()
        finally:
            studio.close()
            for process in compiling:
                process.terminate()
            sys.excepthook = before


def _first(studio: Studio, path: Path | None, read_only: bool) -> None:
    """What is opened at the start, once the window is up."""

    def start() -> None:
        files = studio.window.files
        if path is not None:
            files.open(path, read_only=read_only)
            if path.suffix.lower() != MATERIAL:
                return
        if studio.window.settings.recent:
            studio.window.front.start_page.refresh()
        else:
            with contextlib.suppress(LucarneError):
                files.open_copy(samples.sample())
        files.offer_unsaved()

    studio.bridge.later(0, start)


def _compile(started: list[subprocess.Popen[bytes]]) -> None:
    """Compile kernels that no picture has needed so far, in a process of its own."""
    process = compile_ahead.start()
    if process is not None:
        started.append(process)


def _warm(context: Context, compute: Executor, files: Executor, bridge: Bridge) -> None:
    """Load models and backends on the compute thread, so that panels can ask for them."""
    host = context.host

    def warmed() -> None:
        context.warm = True
        context.warmed.emit()

    def load() -> None:
        for kind in ("brdf", "backend", "indirect"):
            host.available(kind)
        bridge.post(warmed)

    def rest() -> None:
        for kind in ("importer", "exporter"):
            host.available(kind)

    compute.submit(load)
    files.submit(rest)


def _samples() -> dict[str, Path]:
    with contextlib.suppress(LucarneError, OSError):
        found = sorted(
            samples.sample_folder().glob("*.lucarne"),
            key=lambda path: (path.stem != samples.DEFAULT, path.stem),
        )
        return {path.stem.replace("-", " ").capitalize(): path for path in found}
    return {}


def _blame(host: PluginHost, doing: str, error: BaseException) -> str:
    """The plugin of other people whose code an error went through, noted as its failure."""
    plugin = host.culprit(error)
    if plugin is None:
        return ""
    host.report(plugin.id, doing, error)
    return plugin.label or plugin.id


def _hook(journal: Journal) -> Callable[..., None]:
    """What an exception in a slot does: it is told, and the program goes on."""

    def tell(kind: type[BaseException], error: BaseException, trace: object) -> None:
        if issubclass(kind, KeyboardInterrupt):
            QApplication.quit()
            return
        sys.__excepthook__(kind, error, trace)  # type: ignore[arg-type]
        journal.problem("Something in the window", error)

    return tell


@contextlib.contextmanager
def staying() -> Iterator[None]:
    """Inside, `sys.exit` is an error like others: in a slot or while painting Qt would end the process."""

    def leave(status: object = None) -> NoReturn:
        raise RuntimeError(f"something tried to leave the program: {status}")

    before, sys.exit = sys.exit, leave
    try:
        yield
    finally:
        sys.exit = before
