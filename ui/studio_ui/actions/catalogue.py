"""All actions, in the order of the menus: one module of data a menu."""

from __future__ import annotations

from collections.abc import Iterator

from studio_ui.actions import edit, file, help, object, view, window
from studio_ui.actions.spec import ActionSpec, Item

MENUS = (file, edit, object, view, window, help)

ACTIONS: tuple[Item, ...] = tuple(item for menu in MENUS for item in menu.ITEMS)
"""In the order of the menus; None is a line between actions."""


def specs() -> Iterator[ActionSpec]:
    """All actions without the lines between them."""
    return (spec for spec in ACTIONS if spec is not None)
