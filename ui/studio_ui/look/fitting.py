"""Bars in narrow windows: what matters least is left out until the rest fits."""

from __future__ import annotations

from collections.abc import Sequence

from PySide6.QtWidgets import QWidget


def show_what_fits(room: int, widgets: Sequence[QWidget], gap: int) -> None:
    """Show the widgets, the most important first, as long as they fit into `room` pixels; hide the others."""
    for widget in widgets:
        wide = widget.sizeHint().width() + gap
        fits = wide <= room
        room = room - wide if fits else -1
        if fits == widget.isHidden():
            widget.setVisible(fits)
