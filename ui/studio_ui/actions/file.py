"""The File menu."""

from studio_ui.actions.spec import SEPARATOR, ActionSpec, Item

ITEMS: tuple[Item, ...] = (
    ActionSpec("file.new", "New", "File", "Ctrl+N", "An empty project", icon="new"),
    ActionSpec("file.open", "Open…", "File", "Ctrl+O", "Open a project", icon="open", bar=True),
    ActionSpec("file.save", "Save", "File", "Ctrl+S", "Save the project", icon="save", bar=True,
               enabled="savable"),
    ActionSpec("file.save_as", "Save as…", "File", "Ctrl+Shift+S"),
    ActionSpec("file.versions", "Earlier versions…", "File", "",
               "What was saved before; a version opens as a copy", enabled="has_file"),
    ActionSpec("file.copy_clean", "Save a copy without history…", "File", "",
               "For clients: without undo steps and earlier versions"),
    ActionSpec("file.compact", "Compact project…", "File", "",
               "Drop earlier versions to make the file smaller", enabled="own_file"),
    SEPARATOR,
    ActionSpec("file.import", "Import model…", "File", "Ctrl+I", "Add furniture from a file", icon="import",
               bar=True),
    ActionSpec("file.import_options", "Import with options…", "File", "",
               "Ask about unit, axis and place of every model"),
    ActionSpec("file.environment", "Load environment…", "File", "", "Light from an HDR picture",
               icon="environment"),
    SEPARATOR,
    ActionSpec("file.export_picture", "Export picture…", "File", "Ctrl+E", icon="picture", enabled="picture"),
    ActionSpec("file.export_glb", "Export scene as GLB…", "File"),
    ActionSpec("file.export_mitsuba", "Export scene for Mitsuba…", "File"),
    SEPARATOR,
    ActionSpec("file.quit", "Quit", "File", "Ctrl+Q"),
)  # fmt: skip
