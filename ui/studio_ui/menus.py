"""The menu bar: the catalogue's menus, and those whose entries change (files, samples, cameras, panels)."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from pathlib import Path

from PySide6.QtGui import QIcon, QPixmap
from PySide6.QtWidgets import QDockWidget, QMenu, QMenuBar

from studio_core.scene.nodes import Camera
from studio_ui.actions.action_set import ActionSet
from studio_ui.commands import Commands
from studio_ui.context import Context
from studio_ui.files.recent import folder_text, shared_names
from studio_ui.project_files import ProjectFiles


class Menus:
    """Fills a menu bar; entries that change are made when their menu is about to show."""

    def __init__(
        self,
        bar: QMenuBar,
        actions: ActionSet,
        context: Context,
        commands: Commands,
        files: ProjectFiles,
    ) -> None:
        self._actions, self._context, self._commands = actions, context, commands
        self._files = files
        actions.fill_menus(bar)
        file, view = actions.menus["File"], actions.menus["View"]
        self.recent, self.samples = file.addMenu("Open recent"), file.addMenu("Open sample")
        for menu in (self.recent, self.samples):
            file.insertMenu(actions["file.save"], menu)
        self.cameras = view.addMenu("Cameras")
        view.insertMenu(actions["view.new_camera"], self.cameras)
        self.recent.aboutToShow.connect(self.fill_recent)
        self.cameras.aboutToShow.connect(self.fill_cameras)
        self.recent.setToolTipsVisible(True)
        self.samples.setEnabled(False)

    def offer_samples(self, samples: Mapping[str, Path]) -> None:
        """The projects of File ▸ Open sample, by name."""
        for name, path in samples.items():
            self.samples.addAction(name, partial(self._files.open_copy, path))
        self.samples.setEnabled(bool(samples))

    def offer_panels(self, docks: Mapping[str, QDockWidget]) -> None:
        """The panels, shown and hidden by the Window menu."""
        window, reset = self._actions.menus["Window"], self._actions["window.reset"]
        for dock in docks.values():
            window.insertAction(reset, dock.toggleViewAction())
        window.insertSeparator(reset)

    def fill_recent(self) -> None:
        """Projects opened lately, with their pictures."""
        self.recent.clear()
        projects = self._files.recent.projects
        alike = shared_names(projects)
        for project in projects:
            name = project.name.replace("&", "&&")
            folder = f"  ({folder_text(project.path)})" if project.name in alike else ""
            entry = self.recent.addAction(f"{name}{folder}", partial(self._files.open, project.path))
            entry.setToolTip(str(project.path))
            entry.setEnabled(project.there)
            if project.image is not None:
                entry.setIcon(QIcon(QPixmap.fromImage(project.image)))
        if projects:
            self.recent.addSeparator()
            self.recent.addAction("Clear list", self._files.recent.clear)
        _or_none(self.recent)

    def fill_cameras(self) -> None:
        """The cameras of the scene."""
        self.cameras.clear()
        for camera in self._context.document.scene.of(Camera):
            self.cameras.addAction(camera.name, partial(self._commands.look_through, camera.id))
        _or_none(self.cameras)


def _or_none(menu: QMenu) -> None:
    if menu.isEmpty():
        menu.addAction("None yet").setEnabled(False)
