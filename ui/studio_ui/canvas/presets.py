"""Habits of navigating, as data: which button and keys do what, for people who come from other programs.

A chord is written as in a menu: `Shift+middle`. AutoCAD, Revit and Archicad slide the view with the wheel
held and turn it with Shift; Rhino turns it with the right button; Blender and SketchUp turn it with the
wheel held and slide it with Shift. Two fingers do on a touchpad what they do in Blender.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Literal

from studio_ui.canvas.viewport import Pointer

Gesture = Literal["orbit", "pan", "zoom", "turn", "light"]
"""Around a point, sideways, nearer, the head alone, and the light instead of the view."""

WORDS: Mapping[Gesture, str] = {
    "orbit": "Look around",
    "pan": "Slide the view",
    "zoom": "Nearer and further",
    "turn": "Turn the head",
    "light": "Turn the light",
}


@dataclass(frozen=True)
class Preset:
    """One habit. `drags` by chord of a button, `fingers` by the keys held while two fingers slide.

    A plain left drag is listed only where it looks around; elsewhere it is the tools' alone.
    """

    id: str
    label: str
    tip: str
    drags: Mapping[str, Gesture]
    fingers: Mapping[str, Gesture] = field(default_factory=dict)

    def gesture(self, press: Pointer) -> Gesture | None:
        """What a drag means that begins like this."""
        return self.drags.get(chord(press))

    def slid(self, pointer: Pointer) -> Gesture | None:
        """What two fingers on a touchpad mean; None: they are a wheel."""
        return self.fingers.get("+".join(_keys(pointer)))

    def table(self) -> Iterator[tuple[str, str]]:
        """What to do with the mouse for each gesture, in words."""
        for gesture, words in WORDS.items():
            ways = [f"{text[0].upper()}{text[1:]} drag" for text, g in self.drags.items() if g == gesture]
            ways += [f"{keys}+two fingers" if keys else "Two fingers" for keys in self._fingers(gesture)]
            if gesture == "zoom":
                ways = [*(["Pinch"] if self.fingers else []), "Wheel, towards the cursor", *ways]
            if "Left drag" in ways:
                ways[ways.index("Left drag")] = "Left drag on what is not chosen"
            if ways:
                yield words, "; ".join(ways)

    def _fingers(self, gesture: Gesture) -> list[str]:
        return [keys for keys, found in self.fingers.items() if found == gesture]


_COMMON: Mapping[str, Gesture] = {"Shift+right": "light", "Ctrl+right": "turn"}

LUCARNE = Preset(
    "lucarne",
    "Lucarne",
    "Left drag on nothing looks around, right drag slides",
    {
        "left": "orbit",
        "Alt+left": "orbit",
        "middle": "orbit",
        "Shift+middle": "pan",
        "right": "pan",
        "Ctrl+middle": "zoom",
        **_COMMON,
    },
)
BLENDER = Preset(
    "blender",
    "Blender, SketchUp",
    "Middle drag looks around, with Shift it slides",
    {
        "middle": "orbit",
        "Alt+left": "orbit",
        "Shift+middle": "pan",
        "Ctrl+middle": "zoom",
        **_COMMON,
    },
)
CAD = Preset(
    "cad",
    "CAD (AutoCAD, Revit, Rhino)",
    "Middle drag slides, with Shift it looks around, as does right drag",
    {
        "Shift+middle": "orbit",
        "right": "orbit",
        "middle": "pan",
        "Ctrl+middle": "zoom",
        **_COMMON,
    },
)
TOUCHPAD = Preset(
    "touchpad",
    "Touchpad",
    "Two fingers look around, with Shift they slide; pinch to go nearer",
    {
        "left": "orbit",
        "Alt+left": "orbit",
        "Shift+Alt+left": "pan",
        "right": "pan",
        "Ctrl+Alt+left": "zoom",
        **_COMMON,
    },
    {"": "orbit", "Shift": "pan", "Ctrl": "zoom"},
)
PRESETS: Mapping[str, Preset] = {p.id: p for p in (LUCARNE, BLENDER, CAD, TOUCHPAD)}
"""In the order of the menu; the first is the one that nobody chose."""


def chord(press: Pointer) -> str:
    """The button and the keys of a press: `Shift+middle`."""
    return "+".join([*_keys(press), press.button])


def _keys(pointer: Pointer) -> list[str]:
    held = (("Shift", pointer.shift), ("Ctrl", pointer.ctrl), ("Alt", pointer.alt))
    return [name for name, down in held if down]
