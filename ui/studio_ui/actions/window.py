"""The Window menu; the panels are put above these (see `menus`)."""

from studio_ui.actions.spec import ActionSpec, Item

ITEMS: tuple[Item, ...] = (
    ActionSpec("window.reset", "Reset layout", "Window", "", "The panels as at the first start"),
)
