"""The button that makes pictures larger than their sample."""

from __future__ import annotations

from collections.abc import Callable

from PySide6.QtWidgets import QMenu, QToolButton

from studio_core.scene.geometry import Texture
from studio_core.shading.grown_textures import LARGEST_SIDE

_TIMES = (2, 4, 8)


class GrowButton:
    """A button with a menu; `grow(times)` is asked for. `larger` are the menu's entries by times."""

    def __init__(self, tool: Callable[[str, str], QToolButton], grow: Callable[[int], object]) -> None:
        self.button = tool("area", "Fill large surfaces: a larger picture of this kind that does not repeat")
        menu = QMenu(self.button)
        self.larger = {times: menu.addAction(f"{times} times as large") for times in _TIMES}
        for times, action in self.larger.items():
            action.triggered.connect(lambda _, times=times: grow(times))
        self.button.setMenu(menu)
        self.button.setPopupMode(QToolButton.ToolButtonPopupMode.InstantPopup)

    def show_texture(self, texture: Texture | None) -> None:
        """What is there now decides how far it can grow."""
        self.button.setVisible(texture is not None)
        longest = max(texture.image.pixels.shape[:2]) if texture is not None else LARGEST_SIDE
        for times, action in self.larger.items():
            action.setEnabled(times * longest <= LARGEST_SIDE)
