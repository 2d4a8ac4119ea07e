"""The maps of a captured material as one thing: they were made together and lie together."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from PySide6.QtWidgets import QLabel, QToolButton, QVBoxLayout, QWidget

from studio_core.scene.geometry import Image, Texture
from studio_core.scene.pattern import UnitLengths
from studio_ui.panels.grow_button import GrowButton
from studio_ui.panels.panel import row
from studio_ui.panels.pattern_row import PatternRow
from studio_ui.panels.texture_row import small_pixmap


class MapsRow(QWidget):
    """`lay(name, texture)` is an edit of all maps that lie as this one does; `names` is their order.

    `grow(name, times)` makes these larger. `pattern` is for whoever makes the row to put below.
    """

    def __init__(
        self,
        names: tuple[str, ...],
        tool: Callable[[str, str], QToolButton],
        lay: Callable[[str, Texture], object],
        grow: Callable[[str, int], object],
    ) -> None:
        super().__init__()
        self._names = names
        self._image: Image | None = None
        self.first = ""  # the map that is shown
        self.picture = QLabel()
        self.text = QLabel()
        self.text.setProperty("role", "dim")
        self.text.setWordWrap(True)
        self.pattern = PatternRow(tool, lambda texture: lay(self.first, texture))
        self.grow = GrowButton(tool, lambda times: grow(self.first, times))
        column = QVBoxLayout(self)
        column.setContentsMargins(0, 0, 0, 0)
        column.setSpacing(2)
        column.addLayout(row(self.picture, self.text, self.grow.button, stretch=1))

    def show_maps(self, textures: Mapping[str, Texture], lengths: UnitLengths | None) -> None:
        """What lies there now, on surfaces with such lengths."""
        there = [name for name in self._names if name in textures]
        self.first = there[0] if there else ""
        shown = textures[self.first] if there else None
        if shown is not None and shown.image is not self._image:
            self.picture.setPixmap(small_pixmap(shown.image))
        self._image = shown.image if shown is not None else None
        self.picture.setVisible(shown is not None)
        self.pattern.setVisible(shown is not None)
        self.grow.show_texture(shown)
        if shown is None:
            self.text.setText("No pictures: every spot is alike")
            return
        height, width = shown.image.pixels.shape[:2]
        maps = "one map" if len(there) == 1 else f"{len(there)} maps"
        self.text.setText(f"{width} × {height}, {maps}")
        self.pattern.show_texture(shown, lengths)


__all__ = ["MapsRow"]
