"""A lacquered cabinet on four legs, 1.1 m wide, 1.32 m high. It stands on y = 0 and looks towards +z."""

from __future__ import annotations

from ..modelling.mesh import Mesh, joined
from ..modelling.parts import Part
from ..modelling.shapes import lathe, leg, rounded_box

WIDTH, HEIGHT, DEPTH = 1.1, 1.32, 0.42
LEGS, PLINTH, GAP = 0.16, 0.03, 0.006


def cabinet() -> list[Part]:
    """Body, two doors with brass knobs, tapered legs."""
    tall = HEIGHT - LEGS
    body = rounded_box((WIDTH, tall, DEPTH), 0.008, (12, 12, 5), 1).moved(y=LEGS + tall / 2)
    wide = WIDTH / 2 - PLINTH - GAP / 2
    high = tall - 2 * PLINTH
    doors: list[Mesh] = []
    knobs: list[Mesh] = []
    for side in (-1, 1):
        panel = rounded_box((wide, high, 0.02), 0.005, (7, 12, 1), 1)
        doors.append(panel.moved(side * (wide + GAP) / 2, LEGS + PLINTH + high / 2, DEPTH / 2 + 0.011))
        outline = [(0.0, 0.0), (0.008, 0.0), (0.008, 0.015), (0.016, 0.022), (0.012, 0.03), (0.0, 0.031)]
        knob = lathe([outline], 12)
        knobs.append(
            knob.turned((1, 0, 0), 90).moved(side * 0.045, LEGS + PLINTH + 0.55 * high, DEPTH / 2 + 0.022)
        )
    x, z = WIDTH / 2 - 0.06, DEPTH / 2 - 0.05
    legs = [
        leg((sx * x, LEGS + 0.004, sz * z), (sx * (x + 0.02), 0.0, sz * (z + 0.01)), 0.036, 0.022)
        for sx in (-1, 1)
        for sz in (-1, 1)
    ]
    return [
        Part("Body", body, ("red lacquer",)),
        Part("Doors", joined(*doors), ("red lacquer",)),
        Part("Knobs", joined(*knobs), ("brass",)),
        Part("Legs", joined(*legs), ("dark oak",)),
    ]
