"""The View menu: where from, how bright, how it looks; computing."""

from studio_ui.actions.spec import SEPARATOR, ActionSpec, Item
from studio_ui.canvas.presets import PRESETS, Preset


def _habit(preset: Preset) -> ActionSpec:
    name = f"navigation_{preset.id}"
    return ActionSpec(
        f"view.{name}", preset.label, "View/Navigation", "", preset.tip, group="navigation", checked=name
    )


ITEMS: tuple[Item, ...] = (
    ActionSpec("view.frame_selection", "Frame selection", "View", "F",
               "See all of what is chosen (or everything)", icon="frame", bar=True, canvas=True),
    ActionSpec("view.frame_all", "Frame all", "View", "Home", canvas=True),
    SEPARATOR,
    ActionSpec("view.front", "Front", "View/Look from", "1", canvas=True),
    ActionSpec("view.back", "Back", "View/Look from", "Ctrl+1", canvas=True),
    ActionSpec("view.right", "Right", "View/Look from", "3", canvas=True),
    ActionSpec("view.left", "Left", "View/Look from", "Ctrl+3", canvas=True),
    ActionSpec("view.top", "Top", "View/Look from", "7", canvas=True),
    ActionSpec("view.bottom", "Bottom", "View/Look from", "Ctrl+7", canvas=True),
    *(_habit(preset) for preset in PRESETS.values()),
    ActionSpec("view.invert_wheel", "Turn the wheel the other way", "View/Navigation", "",
               "Towards the hand goes nearer", checked="invert_wheel"),
    ActionSpec("view.animate", "Animate the view", "View/Navigation", "",
               "Move smoothly to where the view is sent", checked="animate"),
    ActionSpec("view.new_camera", "New camera from view", "View", "Ctrl+Alt+0", icon="camera"),
    ActionSpec("view.aim_camera", "Set chosen camera to view", "View", enabled="camera"),
    SEPARATOR,
    ActionSpec("view.brighter", "Brighter", "View", "+", "Half an EV more exposure", canvas=True),
    ActionSpec("view.darker", "Darker", "View", "-", "Half an EV less exposure", canvas=True),
    ActionSpec("view.grid", "Ground grid", "View", "G", "Lines on the ground: decimetres, metres, ten metres",
               canvas=True, checked="grid"),
    ActionSpec("view.canvas_auto", "Automatic", "View/Canvas", "", "The graphics card where there is one",
               group="canvas", checked="canvas_auto"),
    ActionSpec("view.canvas_gpu", "Graphics card", "View/Canvas", "", "Draw the picture with OpenGL",
               group="canvas", checked="canvas_gpu"),
    ActionSpec("view.canvas_software", "Software", "View/Canvas", "",
               "Draw the picture without the graphics card", group="canvas", checked="canvas_software"),
    ActionSpec("view.system", "As the system", "View/Theme", "", "Dark or light, as the desktop is",
               group="theme", checked="theme_system"),
    ActionSpec("view.dark", "Dark theme", "View/Theme", group="theme", checked="theme_dark"),
    ActionSpec("view.light", "Light theme", "View/Theme", group="theme", checked="theme_light"),
    SEPARATOR,
    ActionSpec("shade.again", "Compute again", "View", "F5"),
    ActionSpec("shade.cancel", "Stop computing", "View", "Shift+F5", enabled="computing"),
)  # fmt: skip
