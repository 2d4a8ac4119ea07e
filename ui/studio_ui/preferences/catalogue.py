"""Every preference as data: what it is called, what it may be, and what it is at first.

A new preference is an entry here; whatever it concerns asks `Preferences.get`, or follows it with
`Preferences.bind`. The names are those under which `Settings` remembers.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from studio_core.params import ParamInfo, Value
from studio_core.units import LENGTH_UNITS
from studio_ui.canvas.choice import AUTO, GPU, SOFTWARE
from studio_ui.canvas.presets import LUCARNE, PRESETS

GENERAL, NAVIGATION, SNAPPING, PICTURE, FILES = "General", "Navigation", "Snapping", "Picture", "Files"
PAGES = (GENERAL, NAVIGATION, SNAPPING, PICTURE, FILES)
KEYS = "Keys"  # a page of its own
SYSTEM = "system"


@dataclass(frozen=True)
class Preference:
    """One preference: `info` bounds and describes it, `labels` are what its choices are called.

    `restart` tells that it counts from the next start on.
    """

    name: str
    page: str
    info: ParamInfo
    default: Value
    labels: Mapping[str, str] = field(default_factory=dict)
    restart: bool = False


def _choice(
    name: str,
    page: str,
    label: str,
    doc: str,
    labels: Mapping[str, str],
    *,
    default: str = "",
    restart: bool = False,
) -> Preference:
    info = ParamInfo("choice", label, doc, choices=tuple(labels))
    return Preference(name, page, info, default or next(iter(labels)), labels, restart)


def _flag(name: str, page: str, label: str, doc: str, default: bool = True) -> Preference:
    return Preference(name, page, ParamInfo("flag", label, doc), default)


def _number(
    name: str, page: str, label: str, doc: str, default: float, *, restart: bool = False, **info: object
) -> Preference:
    made = ParamInfo("number", label, doc, **info)  # type: ignore[arg-type]
    return Preference(name, page, made, default, restart=restart)


ALL: tuple[Preference, ...] = (
    _choice("theme", GENERAL, "Theme", "Colours of the window; the picture's are not touched",
            {SYSTEM: "As the system", "dark": "Dark", "light": "Light"}, default="dark"),
    _choice("scale", GENERAL, "Size of everything", "For screens on which letters are too small or too large",
            {SYSTEM: "As the system", "1": "100 %", "1.25": "125 %", "1.5": "150 %", "1.75": "175 %",
             "2": "200 %"}, restart=True),
    _choice("length_unit", GENERAL, "Lengths in",
            "How lengths are shown; every unit can be typed anywhere",
            {name: unit.label for name, unit in LENGTH_UNITS.items()}),
    _choice("decimal_mark", GENERAL, "Decimal mark", "How numbers are shown; both can be typed",
            {SYSTEM: "As the system", ".": "Point (0.5)", ",": "Comma (0,5)"}),
    _choice("navigation", NAVIGATION, "Mouse and touchpad", "Which buttons turn, slide and zoom the view",
            {name: preset.label for name, preset in PRESETS.items()}, default=LUCARNE.id),
    _flag("invert_wheel", NAVIGATION, "Turn the wheel round", "Zoom out where it zoomed in", default=False),
    _flag("animate_view", NAVIGATION, "Move the view smoothly",
          "Where it is sent by a key, a camera or the cube"),
    _flag("snap", SNAPPING, "Snap", "What is moved stops at steps, surfaces and other things"),
    _flag("snap_grid", SNAPPING, "To the grid", "Moves go by steps"),
    _number("snap_step", SNAPPING, "Step", "How far apart the steps of a move are", 0.05, unit="m", low=0.001,
            high=10.0, scale="log"),
    _number("snap_angle", SNAPPING, "Angle", "How far apart the steps of a turn are", 15.0, unit="°", low=0.5,
            high=90.0),
    _flag("snap_objects", SNAPPING, "To other things", "Faces, edges and middles of the boxes around them"),
    _flag("snap_surfaces", SNAPPING, "To surfaces", "What is moved stands on what lies below it"),
    _choice("canvas", PICTURE, "Drawn by", "What draws the picture in the window",
            {AUTO: "Graphics card where there is one", GPU: "Graphics card", SOFTWARE: "Software"}),
    _flag("grid", PICTURE, "Ground grid", "Lines on the ground: decimetres, metres, ten metres",
          default=False),
    _choice("rest_pixels", PICTURE, "Pixels while nothing moves",
            "Large windows get no more than these; fewer are ready sooner",
            {"1": "1 megapixel", "2.4": "2.4 megapixels", "4": "4 megapixels", "8.3": "8.3 megapixels (4K)"},
            default="2.4"),
    _number("quality", PICTURE, "Faster or truer",
            "For projects in which it was never set: 0 is fastest, 1 truest", 0.5, low=0.0, high=1.0),
    _number("autosave", FILES, "Autosave after", "How soon after a change it is kept beside the project", 1.0,
            unit="s", low=1.0, high=600.0, scale="log"),
    _number("cache", FILES, "Keep at most", "Disk space for what was computed, shared by all projects",
            1024.0, restart=True, unit="MB", low=64.0, high=65536.0, scale="log"),
)  # fmt: skip
"""In the order of the pages."""

BY_NAME: Mapping[str, Preference] = {preference.name: preference for preference in ALL}
