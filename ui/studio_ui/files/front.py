"""What lies before the canvas: the start page, what went wrong, who else has the project open."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

from PySide6.QtWidgets import QWidget

from studio_ui.canvas.layered import Layered
from studio_ui.context import Context, Subscriptions
from studio_ui.files.drop_overlay import DropOverlay
from studio_ui.files.notice_bar import Notices
from studio_ui.files.project_files import ProjectFiles
from studio_ui.files.read_only_bar import ReadOnlyBar
from studio_ui.files.start_page import Begin, StartPage
from studio_ui.files.task_bar import TaskBar
from studio_ui.look.theme import Theme

_CRASHED = "Lucarne ended unexpectedly last time. What it had kept of your work is offered by itself."


class Front:
    """Builds these things over a canvas and follows the files; `widget` is the canvas with all of it."""

    def __init__(
        self,
        context: Context,
        canvas: QWidget,
        files: ProjectFiles,
        samples: Mapping[str, Path],
        load_environment: Callable[[], object],
        drop_overlay: DropOverlay,
        new_room: Callable[[], object],
    ) -> None:
        self.widget = Layered(canvas)
        begin = [
            Begin("New room", "A room with a window, a door and daylight", "room", new_room),
            Begin("Empty scene", "Begin with nothing", "new", self._empty),
            Begin("Open…", "Open a project", "open", files.choose),
            Begin("Load environment…", "Light from an HDR picture", "environment", load_environment),
        ]
        self.start_page = StartPage(context, files.recent, samples, files.open, files.open_copy, begin)
        self.notices = Notices(context.journal)
        self.read_only = ReadOnlyBar(files)
        self._drop_overlay = drop_overlay
        self.widget.fill(self.start_page)
        self.widget.fill(drop_overlay)
        self.tasks = TaskBar(context.tasks)
        self.widget.bar(self.read_only)
        self.widget.bar(self.tasks)
        self.widget.bar(self.notices)
        self._subscriptions = Subscriptions()
        self._subscriptions.add(files.opened.connect(self._opened))

    def crashed(self, report: str) -> None:
        """The program died last time; `report` is what the interpreter wrote then."""
        self.notices.tell(_CRASHED, report)

    def set_theme(self, theme: Theme) -> None:
        """Colours and icons."""
        self.start_page.set_theme(theme)
        self._drop_overlay.set_theme(theme)
        self.notices.set_theme(theme)

    def close(self) -> None:
        """Stop following."""
        self._subscriptions.close()
        self.start_page.close_panel()
        self.notices.close_panel()
        self.read_only.close_panel()
        self.tasks.close_panel()

    def _empty(self) -> None:
        """The bare canvas, until another document is opened."""
        self.start_page.dismiss()
        self.widget.setFocus()

    def _opened(self) -> None:
        self.notices.clear()
        self.start_page.open_again()
        self.widget.setFocus()  # so that the keys of the picture work
