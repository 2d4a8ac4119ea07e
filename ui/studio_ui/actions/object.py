"""The Object menu: tools, and what is done to what is chosen."""

from studio_ui.actions.spec import SEPARATOR, ActionSpec, Item


def _nudge(name: str, text: str, shortcut: str) -> ActionSpec:
    return ActionSpec(
        f"object.{name}", text, "Object/Nudge", shortcut, "One step", canvas=True, enabled="movable"
    )


ITEMS: tuple[Item, ...] = (
    ActionSpec("tool.select", "Select", "Object", "Q", "Choose only; a drag looks around", icon="select",
               bar=True, group="tool", checked="tool_select", canvas=True),
    ActionSpec("tool.move", "Move", "Object", "W",
               "Drag what is chosen over the floor; Shift up and down; Ctrl in steps of 5 cm", icon="move",
               bar=True, group="tool", checked="tool_move", canvas=True),
    ActionSpec("tool.rotate", "Rotate", "Object", "Shift+R",
               "Drag what is chosen to turn it; Ctrl in steps of 15°", icon="rotate",
               bar=True, group="tool", checked="tool_rotate", canvas=True),
    SEPARATOR,
    ActionSpec("object.photograph", "Stand in the photograph", "Object", "",
               "A floor for shadows on the photographed room, whose picture is seen on the ground"),
    ActionSpec("object.drop", "Drop to floor", "Object", "End", "Let what is chosen stand on the floor",
               icon="drop", bar=True, enabled="movable"),
    _nudge("left", "Nudge left", "Left"),
    _nudge("right", "Nudge right", "Right"),
    _nudge("away", "Nudge away", "Up"),
    _nudge("near", "Nudge closer", "Down"),
    _nudge("up", "Nudge up", "PgUp"),
    _nudge("down", "Nudge down", "PgDown"),
    _nudge("turn_left", "Turn left 15°", ","),
    _nudge("turn_right", "Turn right 15°", "."),
    SEPARATOR,
    ActionSpec("object.correct_units", "Correct units…", "Object", "",
               "Make an import larger or smaller that had another unit, or turn it upright",
               enabled="correctable"),
    ActionSpec("object.group", "Group", "Object", "Ctrl+G", "Hold what is chosen together",
               enabled="selection"),
    ActionSpec("object.ungroup", "Ungroup", "Object", "Ctrl+Shift+G", enabled="group"),
    ActionSpec("object.hide", "Hide", "Object", "H", enabled="selection", canvas=True),
    ActionSpec("object.show_all", "Show all", "Object", "Alt+H", canvas=True),
    ActionSpec("object.lock", "Lock", "Object", "Ctrl+L", "Not picked or moved in the picture",
               enabled="selection"),
)  # fmt: skip
