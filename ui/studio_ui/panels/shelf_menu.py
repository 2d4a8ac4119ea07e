"""New materials from the shelf: those to begin with by kind, and those that a person kept."""

from __future__ import annotations

from collections.abc import Callable

from PySide6.QtWidgets import QMenu

from studio_core.folders import user_materials
from studio_core.library.lucmat import Kept
from studio_core.library.shelf import Entry, Shelf, folded
from studio_core.scene.nodes import Material
from studio_core.shading.job import Job
from studio_ui.context import Context
from studio_ui.panels.swatch import swatch


class ShelfMenu(QMenu):
    """`plain()` wants a material without a look, `take(kept)` one of the shelf.

    The person's own files are read away from the window's thread whenever the menu is opened; until then
    those that were there the last time are offered.
    """

    def __init__(
        self,
        context: Context,
        plain: Callable[[], object],
        take: Callable[[Kept], object],
        shelf: Shelf | None = None,
    ) -> None:
        super().__init__()
        self._context, self._plain, self._take = context, plain, take
        if shelf is None:
            from studio_core.library.presets import PRESETS

            shelf = Shelf(user_materials(), PRESETS)
        self.shelf = shelf
        self._own: tuple[Entry, ...] = ()
        self._reading = False
        self.aboutToShow.connect(self._fill)

    def keep(self, material: Material) -> None:
        """Put a material on the shelf, for all projects."""

        def write(job: Job) -> str:
            return self.shelf.add(material).name

        def done(name: str) -> None:
            self._context.journal.write(f"Kept for all projects as {name}.")
            self.read()

        self._context.tasks.run(f"Keeping {material.name}", write, done)

    def read(self) -> None:
        """Look what is on the shelf now."""
        if self._reading:
            return
        self._reading = True

        def look(job: Job) -> tuple[Entry, ...]:
            return self.shelf.entries()

        def done(entries: tuple[Entry, ...]) -> None:
            self._reading = False
            own = tuple(entry for entry in entries if entry.path is not None)
            if own != self._own:
                self._own = own
                if self.isVisible():
                    self._show()

        def failed(error: Exception) -> None:
            self._reading = False

        self._context.tasks.run("Looking for materials", look, done, failed, quiet=True)

    def _fill(self) -> None:
        self._show()
        self.read()

    def _show(self) -> None:
        self.clear()
        for old in self.findChildren(QMenu):
            old.deleteLater()
        self.addAction("Plain", self._plain)
        self.addSeparator()
        kinds: dict[str, list[Entry]] = {}
        for entry in self.shelf.built_in:
            kinds.setdefault(entry.tags[0] if entry.tags else "other", []).append(entry)
        for kind, entries in kinds.items():
            self._submenu(kind.capitalize(), entries)
        if self._own:
            self.addSeparator()
            self._submenu("My materials", self._own)

    def _submenu(self, title: str, entries: list[Entry] | tuple[Entry, ...]) -> None:
        menu = self.addMenu(title)
        menu.setToolTipsVisible(True)
        for entry in sorted(entries, key=lambda one: folded(one.name)):
            kept = entry.kept
            if kept is None:
                action = menu.addAction(entry.name)
                action.setEnabled(False)
                action.setToolTip(entry.problem)
                continue
            icon = swatch(kept.material, self.devicePixelRatioF())
            action = menu.addAction(icon, kept.name.replace("&", "&&"))
            action.setToolTip(kept.about or ", ".join(kept.tags))
            action.triggered.connect(lambda checked=False, chosen=kept: self._take(chosen))
