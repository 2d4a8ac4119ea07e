"""The Window menu; the panels are put above these (see `menus`)."""

from studio_ui.actions.spec import ActionSpec, Item

ITEMS: tuple[Item, ...] = (
    ActionSpec("window.console", "Go to the console", "Window", "F4",
               "A prompt for commands in Python; once more hides it"),
    ActionSpec("window.next", "Next panel", "Window", "F6",
               "Picture, toolbar and panels in turn, without a mouse"),
    ActionSpec("window.previous", "Previous panel", "Window", "Shift+F6", "The same the other way round"),
    ActionSpec("window.furnish", "Furnish", "Window/Layouts", "", "Outliner, properties and materials"),
    ActionSpec("window.light", "Light", "Window/Layouts", "", "Environments, lamps and shading"),
    ActionSpec("window.picture_only", "Picture only", "Window/Layouts", "Tab",
               "Hide all panels; once more shows them again", checked="picture_only", canvas=True),
    ActionSpec("window.save_layout", "Save layout…", "Window/Layouts", "",
               "Keep the panels as they are now under a name"),
    ActionSpec("window.reset", "Reset layout", "Window", "", "The panels as at the first start"),
)  # fmt: skip
