"""The Window menu; the panels are put above these (see `menus`)."""

from studio_ui.actions.spec import ActionSpec, Item

ITEMS: tuple[Item, ...] = (
    ActionSpec("window.console", "Go to the console", "Window", "F4",
               "A prompt for commands in Python; once more hides it"),
    ActionSpec("window.reset", "Reset layout", "Window", "", "The panels as at the first start"),
)  # fmt: skip
