"""Coffee table, round table and what lies on them. Each stands on y = 0."""

from __future__ import annotations

import math

import numpy as np

from ..modelling.mesh import Mesh, joined, spline
from ..modelling.parts import Part
from ..modelling.shapes import circle, lathe, leaf, leg, rounded_box, sweep


def coffee_table() -> list[Part]:
    """1.15 × 0.6 m, 0.4 m high: bevelled top, splayed tapered legs, a slatted shelf below."""
    top = rounded_box((1.15, 0.032, 0.6), (0.07, 0.014, 0.07), (14, 1, 7), 2).moved(y=0.384)
    top = top.mapped(0, 2, 1.15, 1.15)
    bars: list[Mesh] = [
        leg((0.44 * s, 0.372, 0.2 * t), (0.52 * s, 0.0, 0.26 * t), 0.046, 0.026)
        for s in (-1, 1)
        for t in (-1, 1)
    ]
    for z in (-0.155, 0.155):
        bars.append(
            sweep(np.linspace([-0.48, 0.17, z * 1.5], [0.48, 0.17, z * 1.5], 7), circle(8, 0.02, 0.02))
        )
    for x in np.linspace(-0.36, 0.36, 8):
        bars.append(
            sweep(
                np.linspace([x, 0.183, -0.245], [x, 0.183, 0.245], 5),
                circle(6, 0.036, 0.012),
                round_ends=False,
            )
        )
    return [
        Part("Top", top, ("grained walnut",), textured=True),
        Part("Legs and shelf", joined(*bars), ("walnut",)),
    ]


def round_table() -> list[Part]:
    """A pedestal table, 1.0 m across and 0.735 m high."""
    radius, thick = 0.5, 0.024
    high = 0.735
    rim = [
        (radius - 0.016 + 0.016 * math.cos(a), high - thick / 2 + thick / 2 * math.sin(a))
        for a in np.linspace(-math.pi / 2, math.pi / 2, 7)
    ]
    under = np.stack([np.linspace(0.0, rim[0][0], 6), np.full(6, high - thick)], 1)
    over = np.stack([np.linspace(rim[-1][0], 0.0, 10), np.full(10, high)], 1)
    top = lathe([np.concatenate([under[:-1], rim, over[1:]])], 36)
    foot = spline(
        [
            (0.27, 0.006),
            (0.255, 0.016),
            (0.16, 0.035),
            (0.06, 0.09),
            (0.034, 0.3),
            (0.036, 0.5),
            (0.075, 0.68),
            (0.13, high - thick),
        ],
        17,
    )
    base = lathe(
        [
            [(0.0, 0.0), (0.265, 0.0)],
            np.concatenate([[(0.265, 0.0)], foot]),
            [(0.13, high - thick), (0, high - thick)],
        ],
        22,
    )
    return [Part("Top", top, ("lacquer",)), Part("Pedestal", base, ("lacquer",))]


def vase() -> list[Part]:
    """A glazed vase, 0.27 m high, with three stems of eucalyptus."""
    outer = spline(
        [
            (0.045, 0.004),
            (0.06, 0.02),
            (0.088, 0.09),
            (0.07, 0.165),
            (0.034, 0.215),
            (0.032, 0.245),
            (0.046, 0.268),
        ],
        16,
    )
    lip = [
        (0.046 - 0.004 * (1 - math.cos(a)), 0.268 + 0.004 * math.sin(a)) for a in np.linspace(0, math.pi, 5)
    ]
    inner = spline(
        [(0.038, 0.268), (0.026, 0.242), (0.028, 0.215), (0.06, 0.16), (0.07, 0.09), (0.0, 0.02)], 8
    )
    body = lathe(
        [[(0.0, 0.0), (0.041, 0.0)], np.concatenate([[(0.041, 0.0)], outer[:-1], lip, inner[1:]])], 22
    )
    rng = np.random.default_rng(11)
    stems, leaves = [], []
    for lean, turn, length in ((0.2, 20.0, 0.34), (0.32, 150.0, 0.27), (0.26, 265.0, 0.3)):
        t = np.linspace(0, 1, 7)
        line = np.stack(
            [0.02 + lean * length * t**1.6 * 1.3, 0.12 + (0.13 + length) * t, 0.03 * np.sin(3 * t)], 1
        )
        stems.append(sweep(line, circle(5, 0.006, 0.006), np.linspace(1.0, 0.5, 7)).turned((0, 1, 0), turn))
        for k in range(12):
            at = 0.36 + 0.64 * k / 11
            place = [float(np.interp(at, t, line[:, c])) for c in range(3)]
            blade = leaf(
                rng.uniform(0.07, 0.09) * (1.2 - 0.5 * at), 0.052 * (1.25 - 0.5 * at), 0.5, 0.25, 3, 2
            )
            blade = blade.turned((0, 0, 1), rng.uniform(15, 50)).turned(
                (0, 1, 0), k * 137.5 + rng.uniform(-15, 15)
            )
            leaves.append(blade.moved(*place).turned((0, 1, 0), turn))
    return [
        Part("Vase", body, ("glaze",)),
        Part("Stems", joined(*stems), ("stem",)),
        Part("Leaves", joined(*leaves), ("eucalyptus",)),
    ]


def bowl() -> Part:
    """A shallow stoneware bowl, 0.28 m across."""
    outside = spline([(0.05, 0.0), (0.06, 0.006), (0.1, 0.03), (0.135, 0.075)], 7)
    inside = spline([(0.132, 0.077), (0.095, 0.036), (0.05, 0.014), (0.0, 0.01)], 7)
    body = lathe([[(0.0, 0.0), (0.05, 0.0)], np.concatenate([outside, inside])], 22)
    return Part("Bowl", body, ("stoneware",))


def fruit() -> Part:
    """Three lemons for the bowl."""
    line = [
        (0.0, -0.04),
        (0.008, -0.0385),
        (0.02, -0.029),
        (0.03, -0.01),
        (0.03, 0.01),
        (0.02, 0.029),
        (0.008, 0.0385),
        (0.0, 0.042),
    ]
    one = lathe([spline(line, 9)], 10)
    made = [
        one.turned((0, 0, 1), 80).turned((0, 1, 0), turn).moved(x, y, z)
        for turn, x, y, z in (
            (20.0, -0.035, 0.06, 0.02),
            (140.0, 0.04, 0.061, 0.015),
            (265.0, 0.0, 0.062, -0.045),
        )
    ]
    return Part("Lemons", joined(*made), ("lemon",))


def books() -> list[Part]:
    """Three books in a pile, 0.1 m high."""
    made, height = [], 0.0
    sizes = (
        ("blue", 0.3, 0.032, 0.225, 6.0),
        ("cream", 0.27, 0.026, 0.2, -9.0),
        ("rust", 0.23, 0.022, 0.165, 14.0),
    )
    for colour, width, thick, depth, turn in sizes:
        board = rounded_box((width, 0.003, depth), 0.0014, 1, 1)
        spine = rounded_box((0.004, thick, depth), 0.0018, 1, 1).moved(x=0.002 - width / 2, y=thick / 2)
        pages = rounded_box((width - 0.012, thick - 0.006, depth - 0.012), 0.0012, 1, 1)
        cover = joined(board.moved(y=0.0015), board.moved(y=thick - 0.0015), spine).slot(0)
        book = joined(cover, pages.moved(x=-0.002, y=thick / 2).slot(1)).turned((0, 1, 0), turn)
        made.append(Part(f"Book {colour}", book.moved(y=height), (f"{colour} cloth", "paper")))
        height += thick + 0.0005
    return made
