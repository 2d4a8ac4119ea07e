"""The Edit menu."""

from studio_ui.actions.spec import SEPARATOR, ActionSpec, Item

ITEMS: tuple[Item, ...] = (
    ActionSpec("edit.undo", "Undo", "Edit", "Ctrl+Z",
               "Take the last step back", icon="undo", bar=True, enabled="undo"),
    ActionSpec("edit.redo", "Redo", "Edit", "Ctrl+Shift+Z",
               "Do the step again that was taken back", icon="redo", bar=True, enabled="redo"),
    SEPARATOR,
    ActionSpec("edit.duplicate", "Duplicate", "Edit", "Ctrl+D",
               "An instance beside it: mesh and materials are shared", icon="duplicate", enabled="selection"),
    ActionSpec("edit.duplicate_own", "Duplicate with own materials", "Edit", "Ctrl+Shift+D",
               "A copy beside it whose materials can be changed alone", enabled="selection"),
    ActionSpec("edit.delete", "Delete", "Edit", "Delete",
               "Take what is chosen out of the scene", icon="delete", enabled="selection"),
    SEPARATOR,
    ActionSpec("edit.select_all", "Select all", "Edit", "Ctrl+A", "Everything that is shown and not locked"),
    ActionSpec("edit.select_box", "Select in a box", "Edit", "B",
               "Drag to the right: what lies wholly inside; to the left: whatever is touched", canvas=True),
    ActionSpec("edit.select_none", "Select nothing", "Edit", "Ctrl+Shift+A",
               "Choose nothing", enabled="selection"),
    ActionSpec("edit.select_material", "Select same material", "Edit", "",
               "All objects that share a material with what is chosen", enabled="objects"),
    ActionSpec("edit.select_instances", "Select instances", "Edit", "",
               "All objects that share a mesh with what is chosen", enabled="objects"),
    SEPARATOR,
    ActionSpec("edit.keys", "Keyboard shortcuts…", "Edit", "", "Change the keys of commands"),
    ActionSpec("edit.preferences", "Preferences…", "Edit", "Ctrl+,",
               "Theme, units, navigation, keys and more"),
)  # fmt: skip
