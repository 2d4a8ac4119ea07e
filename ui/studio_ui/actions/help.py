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
    ActionSpec("help.keys", "Keys and mouse", "Help", "F1"),
    ActionSpec("help.plugins", "Plugins", "Help"),
    ActionSpec("help.about", "About Lucarne", "Help"),
)
