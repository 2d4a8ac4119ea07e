"""The View menu: where from, how bright, how it looks; computing."""

from studio_ui.actions.spec import SEPARATOR, ActionSpec, Item
from studio_ui.canvas.framing import ASPECTS, CAMERA_KEYS
from studio_ui.canvas.presets import PRESETS, Preset


def _habit(preset: Preset) -> ActionSpec:
    name = f"navigation_{preset.id}"
    return ActionSpec(
        f"view.{name}", preset.label, "View/Navigation", "", preset.tip, group="navigation", checked=name
    )


def _camera(number: int) -> ActionSpec:
    return ActionSpec(
        f"view.camera_{number}",
        f"Camera {number}",
        "View/Cameras",
        f"Ctrl+Alt+{number}",
        "Look through it",
        enabled=f"camera_{number}",
        checked=f"through_{number}",
    )


def _frame(aspect: str) -> ActionSpec:
    name = f"frame_{aspect.replace(':', '_').replace('.', '_')}"
    tip = "Shape of the pictures that cameras make, width : height"
    return ActionSpec(
        f"view.{name}", ASPECTS[aspect][0], "View/Camera frame", "", tip, group="frame", checked=name
    )


def _light(name: str, text: str, tip: str) -> ActionSpec:
    return ActionSpec(
        f"view.light_{name}", text, "View/Light shown", "", tip, group="shown", checked=f"light_{name}"
    )


ITEMS: tuple[Item, ...] = (
    ActionSpec("view.frame_selection", "Frame selection", "View", "F",
               "See all of what is chosen (or everything)", icon="frame", bar=True, canvas=True),
    ActionSpec("view.frame_all", "Frame all", "View", "Home", "See everything", canvas=True),
    SEPARATOR,
    ActionSpec("view.front", "Front", "View/Look from", "1",
               "Along the z axis, about what is chosen", canvas=True),
    ActionSpec("view.back", "Back", "View/Look from", "Ctrl+1",
               "Along the z axis from behind, about what is chosen", canvas=True),
    ActionSpec("view.right", "Right", "View/Look from", "3",
               "Along the x axis, about what is chosen", canvas=True),
    ActionSpec("view.left", "Left", "View/Look from", "Ctrl+3",
               "Along the x axis from the other side, about what is chosen", canvas=True),
    ActionSpec("view.top", "Top", "View/Look from", "7", "From above, about what is chosen", canvas=True),
    ActionSpec("view.bottom", "Bottom", "View/Look from", "Ctrl+7",
               "From below, about what is chosen", canvas=True),
    ActionSpec("view.home", "Three quarters", "View/Look from", "Shift+Home",
               "Everything, from the front, the right and above", canvas=True),
    ActionSpec("view.walk", "Walk around", "View", "Shift+W",
               "W, A, S and D walk, E and Q go up and down, Shift hurries; drags turn the head; Esc ends it",
               canvas=True, checked="walk"),
    *(_habit(preset) for preset in PRESETS.values()),
    ActionSpec("view.invert_wheel", "Turn the wheel the other way", "View/Navigation", "",
               "Towards the hand goes nearer", checked="invert_wheel"),
    ActionSpec("view.animate", "Animate the view", "View/Navigation", "",
               "Move smoothly to where the view is sent", checked="animate"),
    SEPARATOR,
    *(_camera(n) for n in range(1, CAMERA_KEYS + 1)),
    ActionSpec("view.new_camera", "New camera from view", "View", "Ctrl+Alt+0", "Keep this view as a camera",
               icon="camera"),
    ActionSpec("view.aim_camera", "Set chosen camera to view", "View", "", "Put it where you look from",
               enabled="aimable"),
    ActionSpec("view.keep_camera", "Lock camera to view", "View", "",
               "The camera you look through goes along when you look around", enabled="through",
               checked="kept"),
    ActionSpec("view.leave_camera", "Free view", "View", "", "Stay here without the camera",
               enabled="through"),
    *(_frame(name) for name in ASPECTS),
    SEPARATOR,
    ActionSpec("view.brighter", "Brighter", "View", "+", "Half an EV more exposure", canvas=True),
    ActionSpec("view.darker", "Darker", "View", "-", "Half an EV less exposure", canvas=True),
    ActionSpec("shade.bounces", "Light between surfaces", "View", "",
               "Light goes on from surface to surface: colours tint what stands beside them", icon="bounce",
               bar=True, enabled="bouncing", checked="bounces"),
    _light("all", "All light", "The picture as the eye would see it"),
    _light("direct", "Straight from lamps and sky", "Without light that comes by way of other surfaces"),
    _light("indirect", "From other surfaces", "Only light that comes by way of other surfaces"),
    _light("share", "Share from other surfaces",
           "How much of the light comes by way of other surfaces, in colours"),
    ActionSpec("view.cube", "View cube", "View", "",
               "Which way one looks; click a side, an edge or a corner to look from there", checked="cube"),
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
    ActionSpec("view.dark", "Dark theme", "View/Theme", "",
               "Dark panels around the picture", group="theme", checked="theme_dark"),
    ActionSpec("view.light", "Light theme", "View/Theme", "",
               "Light panels around the picture", group="theme", checked="theme_light"),
    SEPARATOR,
    ActionSpec("shade.again", "Compute again", "View", "F5", "Begin the picture anew"),
    ActionSpec("shade.cancel", "Stop computing", "View", "Shift+F5",
               "Keep the picture as far as it is", enabled="computing"),
)  # fmt: skip
