"""Sofa, armchair and chair. Each stands on y = 0 with its front towards +z."""

from __future__ import annotations

import numpy as np

from ..modelling.mesh import Array, Mesh, Point, joined, spline
from ..modelling.parts import Part
from ..modelling.shapes import circle, leg, pillow, rounded_box, sweep


def cushion(size: Point, crown: float, sag: Point, flat: tuple[int, int, int] = (6, 1, 6)) -> Mesh:
    """A seat cushion centred at the origin: crowned on top, with a dent of depth sag[1] at sag x, z."""
    width, height, depth = size
    mesh = rounded_box(size, (0.055, height * 0.42, 0.06), flat, 3)

    def bend(p: Array) -> Array:
        u, w = p[:, 0] / (width / 2), p[:, 2] / (depth / 2)
        top = np.clip(p[:, 1] / height + 0.5, 0, 1)
        dent = np.exp(-((p[:, 0] - sag[0]) ** 2 + (p[:, 2] - sag[2]) ** 2) / 0.028)
        lift = top * (crown * (1 - u * u) * (1 - w * w) - sag[1] * dent)
        swell = 1 + 0.02 * (1 - (2 * top - 1) ** 2)
        return np.stack([p[:, 0] * swell, p[:, 1] + lift, p[:, 2] * swell], 1)

    return mesh.bent(bend)


def back_cushion(size: Point, bulge: float, slump: float) -> Mesh:
    """An upright cushion centred at the origin: bulging to the front, its filling slumped downwards."""
    width, height, depth = size
    mesh = rounded_box(size, (0.06, 0.06, depth * 0.44), (5, 4, 1), 3)

    def bend(p: Array) -> Array:
        u, v = p[:, 0] / (width / 2), p[:, 1] / (height / 2)
        front = np.clip(p[:, 2] / depth + 0.5, 0, 1)
        puff = bulge * (1 - u * u) * (1 - v * v) + slump * (1 - v) * 0.5
        dip = -0.018 * np.clip(v, 0, 1) * (1 - u * u)
        return np.stack([p[:, 0], p[:, 1] + dip, p[:, 2] + front * puff - 0.3 * (1 - front) * puff], 1)

    return mesh.bent(bend)


def sofa() -> list[Part]:
    """Three seats, 2.16 m wide, 0.92 m deep, loose cushions, turned oak legs."""
    base = rounded_box((1.86, 0.14, 0.8), 0.03, (14, 1, 4), 1).moved(y=0.225, z=0.02)
    back = rounded_box((1.88, 0.62, 0.17), 0.06, (12, 5, 1), 2)
    back = back.turned((1, 0, 0), -7).moved(y=0.5, z=-0.37)
    arm = rounded_box((0.17, 0.44, 0.9), (0.07, 0.075, 0.07), (1, 4, 8), 3)
    arm = arm.bent(lambda p: p + np.stack([0.03 * (p[:, 1] + 0.22) ** 2 / 0.2, 0 * p[:, 1], 0 * p[:, 2]], 1))
    arm = arm.moved(x=1.01, y=0.385, z=-0.005)
    parts = [
        Part("Frame", joined(base, back), ("fabric",)),
        Part("Armrest right", arm, ("fabric",)),
        Part("Armrest left", arm.mirrored(), ("fabric",)),
    ]
    places = (("left", -0.612, -0.012), ("middle", 0.0, 0.006), ("right", 0.612, 0.015))
    for name, x, shift in places:
        seat = cushion((0.605, 0.175, 0.68), 0.035, (shift * 3, 0.016 + abs(shift) / 2, 0.05))
        parts.append(Part(f"Seat cushion {name}", seat.moved(x, 0.375, 0.105), ("fabric",)))
    for name, x, shift in places:
        rest = back_cushion((0.6, 0.45, 0.15), 0.05, 0.035)
        rest = rest.turned((0, 0, 1), shift * 110).turned((1, 0, 0), -13 - shift * 150)
        parts.append(Part(f"Back cushion {name}", rest.moved(x, 0.655, -0.215), ("fabric",)))
    legs = [
        leg((0.86 * s, 0.17, z), (0.93 * s, 0.0, z * 1.12), 0.05, 0.028)
        for s in (-1, 1)
        for z in (-0.32, 0.34)
    ]
    parts.append(Part("Legs", joined(*legs), ("oak",)))
    throw = pillow(0.47, 0.47, 0.19).turned((0, 0, 1), 5).turned((1, 0, 0), -24).turned((0, 1, 0), 24)
    parts.append(Part("Throw pillow terracotta", throw.moved(-0.66, 0.66, 0.03), ("terracotta wool",)))
    small = pillow(0.43, 0.43, 0.18).turned((0, 0, 1), -5).turned((1, 0, 0), -27).turned((0, 1, 0), -20)
    parts.append(Part("Throw pillow ochre", small.moved(0.67, 0.635, 0.02), ("ochre linen",)))
    return parts


def armchair() -> list[Part]:
    """A lounge chair of oak with two leather cushions, 0.74 m wide."""
    bars: list[Mesh] = []
    round_bar, paddle = circle(8, 1.0, 1.0), circle(10, 0.062, 0.026)
    for side in (-1.0, 1.0):
        x = 0.335 * side
        bars.append(leg((x, 0.56, 0.27), (x * 1.03, 0.0, 0.33), 0.036, 0.026, rings=6))
        bars.append(leg((x, 0.52, -0.28), (x * 1.03, 0.0, -0.4), 0.036, 0.026, rings=6))
        line = spline(
            [(x, 0.575, 0.36), (x * 1.01, 0.572, 0.2), (x, 0.55, -0.1), (x * 0.98, 0.522, -0.34)], 9
        )
        bars.append(
            sweep(line, paddle, np.interp(np.linspace(0, 1, 9), [0, 0.2, 0.6, 1], [1.0, 1.15, 0.9, 0.8]))
        )
        post = spline([(x * 0.84, 0.25, -0.2), (x * 0.84, 0.5, -0.3), (x * 0.84, 0.86, -0.47)], 9)
        bars.append(sweep(post, round_bar, np.linspace(0.034, 0.024, 9)))
        rail = np.linspace([x, 0.3, 0.295], [x, 0.24, -0.34], 5)
        bars.append(sweep(rail, circle(8, 0.024, 0.046), round_ends=False))
    for y, z in ((0.275, 0.285), (0.235, -0.3)):
        bars.append(
            sweep(np.linspace([-0.335, y, z], [0.335, y, z], 6), circle(8, 0.024, 0.044), round_ends=False)
        )
    for y in (0.5, 0.64, 0.78):
        z = -0.3 - (y - 0.5) * 0.46
        slat = spline([(-0.285, y, z), (0, y, z - 0.025), (0.285, y, z)], 9)
        bars.append(sweep(slat, circle(8, 0.014, 0.042), round_ends=False))
    seat = cushion((0.61, 0.14, 0.6), 0.03, (0.0, 0.014, 0.0)).turned((1, 0, 0), -6).moved(y=0.365, z=0.0)
    rest = back_cushion((0.59, 0.53, 0.12), 0.04, 0.02).turned((1, 0, 0), -24).moved(y=0.665, z=-0.285)
    return [
        Part("Frame", joined(*bars), ("oak",)),
        Part("Seat cushion", seat, ("leather",)),
        Part("Back cushion", rest, ("leather",)),
    ]


def chair() -> Part:
    """A dining chair: upholstered seat, curved back on spindles, splayed legs; 0.47 × 0.8 × 0.5 m."""
    pad = rounded_box((0.45, 0.055, 0.43), (0.13, 0.026, 0.13), (4, 1, 4), 2)

    def dish(p: Array) -> Array:
        taper = 1 - 0.12 * (0.5 - p[:, 2] / 0.43)
        hollow = 0.012 * np.exp(-(p[:, 0] ** 2 + p[:, 2] ** 2) / 0.02)
        return np.stack([p[:, 0] * taper, p[:, 1] - hollow, p[:, 2]], 1)

    pad = pad.bent(dish).moved(y=0.455)
    frame = rounded_box((0.4, 0.045, 0.38), (0.09, 0.015, 0.09), (2, 1, 2), 2).moved(y=0.418)
    wood = [frame]
    for side in (-1.0, 1.0):
        wood.append(leg((0.165 * side, 0.41, 0.15), (0.215 * side, 0.0, 0.205), 0.036, 0.022))
        wood.append(leg((0.15 * side, 0.41, -0.15), (0.2 * side, 0.0, -0.23), 0.036, 0.022))
    bow = spline(
        [
            (-0.225, 0.735, -0.13),
            (-0.2, 0.76, -0.235),
            (0.0, 0.785, -0.305),
            (0.2, 0.76, -0.235),
            (0.225, 0.735, -0.13),
        ],
        15,
    )
    swell = np.interp(np.linspace(0, 1, 15), [0, 0.2, 0.5, 0.8, 1], [0.55, 0.8, 1.15, 0.8, 0.55])
    wood.append(sweep(bow, circle(8, 0.026, 0.068), swell))
    for x in (-0.17, -0.085, 0.0, 0.085, 0.17):
        top = (x * 1.12, 0.772 - 0.35 * x * x, -0.295 + 1.7 * x * x)
        wood.append(leg(top, (x * 0.86, 0.42, -0.165 + 0.5 * x * x), 0.013, 0.018, around=6, rings=4))
    return Part("Chair", joined(joined(*wood).slot(0), pad.slot(1)), ("dark oak", "wool"))
