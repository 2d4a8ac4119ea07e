"""The Help menu."""

from studio_ui.actions.spec import ActionSpec, Item

ITEMS: tuple[Item, ...] = (
    ActionSpec(
        "help.palette",
        "Find a command…",
        "Help",
        "Ctrl+Shift+P",
        "Everything the menus offer, by a few letters",
    ),
    ActionSpec(
        "help.hints", "First steps", "Help", "", "Three things to try, above the picture", enabled="furnished"
    ),
    ActionSpec("help.keys", "Keys and mouse", "Help", "F1", "All keys, and what the mouse does"),
    ActionSpec("help.plugins", "Plugins", "Help", "", "What is loaded, and what failed and why"),
    ActionSpec("help.about", "About Lucarne", "Help", "", "Which version this is"),
)
