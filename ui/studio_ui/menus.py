"""The menu bar: the catalogue's menus, and those whose entries change (files, samples, cameras, panels)."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from pathlib import Path

from PySide6.QtGui import QAction, QIcon, QPixmap
from PySide6.QtWidgets import QDockWidget, QMenu, QMenuBar

from studio_ui.actions.action_set import ActionSet
from studio_ui.canvas.framing import CAMERA_KEYS
from studio_ui.files.project_files import ProjectFiles
from studio_ui.files.recent import folder_text, shared_names
from studio_ui.views.cameras import Cameras


class Menus:
    """Fills a menu bar; entries that change are made when their menu is about to show."""

    def __init__(
        self,
        bar: QMenuBar,
        actions: ActionSet,
        cameras: Cameras,
        files: ProjectFiles,
    ) -> None:
        self._actions, self._cameras, self._files = actions, cameras, files
        actions.fill_menus(bar)
        file = actions.menus["File"]
        self.recent, self.samples = file.addMenu("Open recent"), file.addMenu("Open sample")
        for menu in (self.recent, self.samples):
            file.insertMenu(actions["file.save"], menu)
        self.cameras = actions.menus["View/Cameras"]
        self._further: list[QAction] = []  # cameras that have no key
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
            name = escaped(project.name)
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
        """The cameras of the scene by name; the first ones have keys."""
        for action in self._further:
            self.cameras.removeAction(action)
        self._further.clear()
        found = self._cameras.all()
        for number in range(1, CAMERA_KEYS + 1):
            action = self._actions[f"view.camera_{number}"]
            action.setVisible(number <= len(found))
            action.setText(escaped(found[number - 1].name) if number <= len(found) else f"Camera {number}")
        for camera in found[CAMERA_KEYS:]:
            action = self.cameras.addAction(escaped(camera.name), partial(self._cameras.look, camera.id))
            self._further.append(action)
        if not found:
            self._further.append(self.cameras.addAction("None yet"))
            self._further[-1].setEnabled(False)


def escaped(name: str) -> str:
    """A name as a menu shows it."""
    return name.replace("&", "&&")


def _or_none(menu: QMenu) -> None:
    if menu.isEmpty():
        menu.addAction("None yet").setEnabled(False)
