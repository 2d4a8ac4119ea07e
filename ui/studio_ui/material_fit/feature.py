"""The window's way to materials from photographs: one dialog, one fit at a time, on a thread of its own."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

from PySide6.QtWidgets import QWidget

from studio_core.errors import InputError, PluginError
from studio_core.fitting import FitRequest, Fitted
from studio_core.library.lucmat import Kept
from studio_core.library.shelf import file_stem
from studio_core.shading.job import Job
from studio_core.shading.scheduler import ComputeThread, Executor
from studio_ui.ask import Ask, Filter
from studio_ui.context import Context
from studio_ui.library.library import MaterialLibrary
from studio_ui.library.taking import Taking
from studio_ui.look.theme import DARK, Theme
from studio_ui.material_fit.dialog import FitDialog
from studio_ui.tasks import Task

_REPORTS = Filter("Reports", (".json",))


class MaterialFitting:
    """Handlers of actions, and what the dialog asks. `executor` is another one in tests."""

    def __init__(
        self, parent: QWidget, context: Context, ask: Ask, library: MaterialLibrary, taking: Taking
    ) -> None:
        self.dialog: FitDialog | None = None
        self.executor: Executor | None = None  # a thread of its own from the first fit on
        self._parent, self._context, self._ask = parent, context, ask
        self._library, self._taking = library, taking
        self._theme = DARK
        self._task: Task | None = None

    def handlers(self) -> dict[str, Callable[[], object]]:
        """By action id."""
        return {"file.fit_material": self.show}

    def conditions(self) -> dict[str, Callable[[], bool]]:
        """None."""
        return {}

    def set_theme(self, theme: Theme) -> None:
        """Other colours."""
        self._theme = theme
        if self.dialog is not None:
            self.dialog.set_theme(theme)

    def show(self, folder: Path | None = None) -> FitDialog:
        """The dialog as it is, or with another folder."""
        if self.dialog is None:
            self.dialog = FitDialog(self._parent, self._context, self._ask, self)
            self.dialog.set_theme(self._theme)
        if folder is not None:
            self.dialog.take(folder)
        self.dialog.show()
        self.dialog.raise_()
        self.dialog.activateWindow()
        return self.dialog

    # what the dialog asks

    def start(self, request: FitRequest) -> Task:
        """Fit."""
        host, dialog = self._context.host, self.dialog

        def work(job: Job) -> Fitted:
            names = host.names("fitter")
            if not names:
                raise PluginError("no plugin is there that makes materials out of photographs")
            fitted: Fitted = host.get("fitter", names[0]).fit(request, job)
            return fitted

        def done(fitted: Fitted) -> None:
            self._context.journal.write(f"The material {fitted.material.name} is fitted.")
            if dialog is not None and dialog is self.dialog:
                dialog.finished_well(fitted)

        def failed(error: Exception) -> None:
            if dialog is not None and dialog is self.dialog:
                dialog.failed(error)

        self.executor = self.executor or ComputeThread()
        label = f"Material from {request.folder.name}"
        self._task = self._context.tasks.run(label, work, done, failed, executor=self.executor)
        return self._task

    def add(self, kept: Kept) -> None:
        """Into the scene, where the panel of materials shows it."""
        self._taking.add_kept([kept])

    def keep(self, kept: Kept) -> None:
        """On the shelf of one's own."""
        self._library.keep_kept([kept])

    def save(self, kept: Kept) -> None:
        """As a file of its own."""
        self._library.export_kept([kept])

    def save_report(self, fitted: Fitted, name: str) -> None:
        """As JSON."""
        path = self._ask.save_file("Save the report", Path.home() / f"{file_stem(name)}.json", [_REPORTS])
        if path is None:
            return

        def write(job: Job) -> None:
            text = json.dumps(dict(fitted.report), indent=1, allow_nan=False)
            try:
                path.write_text(text, "utf-8")
            except OSError as error:
                raise InputError(f"{path.name} cannot be written: {error.strerror or error}") from None

        def done(_: None) -> None:
            self._context.journal.write(f"Saved {path.name}.")

        self._context.tasks.run(f"Saving {path.name}", write, done)

    def close(self) -> None:
        """Stop what is fitted, and wait until it has gone."""
        if self._task is not None:
            self._task.job.cancel()
        if self.dialog is not None:
            self.dialog.close_dialog()
            self.dialog = None
        if self.executor is not None:
            self.executor.close()
            self.executor = None


__all__ = ["MaterialFitting"]
