"""The Window menu; the panels are put above these (see `menus`)."""

from studio_ui.actions.spec import ActionSpec, Item

ITEMS: tuple[Item, ...] = (
    ActionSpec("window.console", "Go to the console", "Window", "F4",
               "A prompt for commands in Python; once more hides it"),
    ActionSpec("window.next", "Next panel", "Window", "F6",
               "Picture, toolbar and panels in turn, without a mouse"),
    ActionSpec("window.previous", "Previous panel", "Window", "Shift+F6"),
    ActionSpec("window.reset", "Reset layout", "Window", "", "The panels as at the first start"),
)  # fmt: skip
