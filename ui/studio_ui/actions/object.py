"""The Object menu: tools, and what is done to what is chosen."""

from studio_ui.actions.spec import SEPARATOR, ActionSpec, Item


def _nudge(name: str, text: str, shortcut: str) -> ActionSpec:
    return ActionSpec(
        f"object.{name}", text, "Object/Nudge", shortcut, "One step", canvas=True, enabled="movable"
    )


def _align(name: str, text: str) -> ActionSpec:
    return ActionSpec(
        f"object.align_{name}", text, "Object/Align", "", "Of what is chosen, as you see it", enabled="two"
    )


def _spread(name: str, text: str) -> ActionSpec:
    return ActionSpec(
        f"object.spread_{name}", text, "Object/Distribute", "", "Equal gaps; both ends stay", enabled="three"
    )


ITEMS: tuple[Item, ...] = (
    ActionSpec("tool.select", "Select", "Object", "Q", "Choose only; a drag draws a box",
               icon="select", bar=True, group="tool", checked="tool_select", canvas=True),
    ActionSpec("tool.move", "Move", "Object", "W",
               "Drag an arrow, a square, or the thing itself; X, Y, Z and a typed distance", icon="move",
               bar=True, group="tool", checked="tool_move", canvas=True),
    ActionSpec("tool.rotate", "Rotate", "Object", "E",
               "Drag a ring, or the thing itself; X, Y, Z and a typed angle", icon="rotate",
               bar=True, group="tool", checked="tool_rotate", canvas=True),
    ActionSpec("tool.scale", "Scale", "Object", "R",
               "Drag a handle: all sides grow alike; or type a factor, such as 120 %", icon="scale",
               bar=True, group="tool", checked="tool_scale", canvas=True),
    ActionSpec("tool.stroke", "Stroke", "Object", "P",
               "Paint the light you want to see; the material that explains it is found", icon="stroke",
               bar=True, group="tool", checked="tool_stroke", canvas=True),
    ActionSpec("stroke.smaller", "Smaller brush", "Object/Stroke", "[", "A sixth less across", canvas=True),
    ActionSpec("stroke.larger", "Larger brush", "Object/Stroke", "]", "A fifth more across", canvas=True),
    ActionSpec("stroke.softer", "Softer brush", "Object/Stroke", "Shift+[", "Fades earlier", canvas=True),
    ActionSpec("stroke.harder", "Harder brush", "Object/Stroke", "Shift+]", "Fades later", canvas=True),
    ActionSpec("stroke.indirect", "Change what is reflected", "Object/Stroke", "",
               "Strokes change what lights the surface or shows in it, and not the surface",
               checked="stroke_indirect"),
    ActionSpec("stroke.match", "Match what was painted", "Object/Stroke", "",
               "Explain the chosen stroke again until the picture, with the light that it changes, shows it",
               enabled="furnished"),
    ActionSpec("stroke.stylise", "Stylise the scene…", "Object/Stroke", "",
               "Sharpen or smooth the light of the whole scene by its materials", enabled="furnished"),
    ActionSpec("tool.local_axes", "Use its own axes", "Object", "L",
               "Arrows and rings turn with what is chosen, instead of standing as the room does",
               checked="local_axes", canvas=True),
    ActionSpec("snap.on", "Snap", "Object/Snap", "M",
               "Things you drag are drawn to places that fit; hold Ctrl for the opposite",
               icon="magnet", bar=True, checked="snap_on", canvas=True),
    ActionSpec("snap.grid", "To steps", "Object/Snap", "", "Steps of length and angle (Preferences)",
               checked="snap_grid"),
    ActionSpec("snap.objects", "To other things", "Object/Snap", "", "Sides and middles of what is near",
               checked="snap_objects"),
    ActionSpec("snap.surfaces", "To surfaces", "Object/Snap", "",
               "What stands is set down on the table, rug or floor that you point at",
               checked="snap_surfaces"),
    SEPARATOR,
    ActionSpec("object.photograph", "Stand in the photograph", "Object", "",
               "A floor for shadows on the photographed room, whose picture is seen on the ground"),
    ActionSpec("object.drop", "Drop", "Object", "End", "Down onto what lies below it, or the floor",
               icon="drop", bar=True, enabled="movable", canvas=True),
    _align("left", "Left sides"),
    _align("centre", "Middles, left to right"),
    _align("right", "Right sides"),
    _align("front", "Front sides"),
    _align("depth", "Middles, front to back"),
    _align("back", "Back sides"),
    _align("bottom", "Undersides"),
    _align("height", "Middles, floor to ceiling"),
    _align("top", "Tops"),
    _spread("across", "Left to right"),
    _spread("away", "Front to back"),
    _spread("up", "Floor to ceiling"),
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
    SEPARATOR,
    ActionSpec("object.edit_capture", "Edit capture…", "Object", "",
               "The photographs and decisions that the environment was made from", enabled="captured"),
    ActionSpec("room.new", "New room", "Object/Room", "",
               "Floor, walls and ceiling round the furniture, with a window and a door", icon="room"),
    ActionSpec("room.open_walls", "Open walls towards the view", "Object/Room", "",
               "Leave out the walls and the ceiling that stand before the inside; light comes in there",
               enabled="room"),
    ActionSpec("room.close_walls", "Close all walls", "Object/Room", "", "All walls and the ceiling again",
               enabled="room"),
    SEPARATOR,
    ActionSpec("object.group", "Group", "Object", "Ctrl+G", "Hold what is chosen together",
               enabled="selection"),
    ActionSpec("object.ungroup", "Ungroup", "Object", "Ctrl+Shift+G",
               "What the group holds goes up to where the group was", enabled="group"),
    ActionSpec("object.own_material", "Make material its own", "Object", "",
               "Copies of the materials that other things use too", enabled="mesh"),
    ActionSpec("object.coordinates", "Make texture coordinates", "Object", "",
               "For what has none: its surfaces are unrolled, so that pictures lie on them in their size",
               enabled="bare"),
    ActionSpec("object.hide", "Hide", "Object", "H",
               "Not drawn, and without shadow or light", enabled="selection", canvas=True),
    ActionSpec("object.show_all", "Show all", "Object", "Alt+H",
               "Everything that was hidden; lamps stay as they are", canvas=True),
    ActionSpec("object.lock", "Lock", "Object", "Ctrl+L", "Not picked or moved in the picture",
               enabled="selection"),
)  # fmt: skip
