"""What stands on the terrace: parasol, planter, pots, paving. Each stands on y = 0."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from ..modelling.mesh import Array, Mesh, joined, spline
from ..modelling.parts import Part
from ..modelling.shapes import circle, lathe, leaf, leg, plane, rounded_box, sweep

RIBS = 8


def parasol(radius: float = 1.45, low: float = 2.12, top: float = 2.62) -> list[Part]:
    """A market parasol: eight ribs, a canopy that hangs a little between them, a heavy foot."""
    t = np.linspace(0, 1, 9)
    upper = np.stack([0.02 + (radius - 0.02) * t, top - (top - low) * t**1.15], 1)
    valance = np.array([[radius - 0.002, low - 0.052], [radius + 0.002, low - 0.05]])
    lower = upper - np.array([0.0, 0.005])
    hub = upper[:1] - np.array([0.0, 0.0025])
    canopy = lathe([np.concatenate([hub, lower, valance, upper[::-1], hub])], 32)

    def hang(p: Array) -> Array:
        angle = np.arctan2(p[:, 2], p[:, 0])
        away = np.hypot(p[:, 0], p[:, 2]) / radius
        between = 0.5 - 0.5 * np.cos(RIBS * angle)
        drawn = 1 - 0.055 * between * away
        return np.stack([p[:, 0] * drawn, p[:, 1] - 0.05 * between * away * (1.2 - away), p[:, 2] * drawn], 1)

    pole = leg((0.0, top + 0.03, 0.0), (0.0, 0.05, 0.0), 0.042, 0.042, around=10, rings=12)
    knob = lathe([spline([(0.0, 0.0), (0.028, 0.008), (0.03, 0.03), (0.016, 0.055), (0.0, 0.065)], 9)], 12)
    bars: list[Mesh] = [pole, knob.moved(y=top + 0.01)]
    for k in range(RIBS):
        a = 2 * math.pi * k / RIBS
        end = [0.96 * radius * math.cos(a), low + 0.01, 0.96 * radius * math.sin(a)]
        bars.append(
            sweep(np.linspace([0, top - 0.035, 0], end, 7), circle(5, 0.018, 0.018), round_ends=False)
        )
    foot = lathe(
        [
            [(0.0, 0.0), (0.27, 0.0)],
            spline([(0.27, 0.0), (0.275, 0.02), (0.262, 0.06), (0.24, 0.07)], 8),
            [(0.24, 0.07), (0.06, 0.075)],
            [(0.06, 0.075), (0.05, 0.26)],
            [(0.05, 0.26), (0.0, 0.26)],
        ],
        24,
    )
    return [
        Part("Canopy", canopy.bent(hang), ("canvas",)),
        Part("Pole and ribs", joined(*bars), ("teak",)),
        Part("Foot", foot, ("granite",)),
    ]


def planter(seed: int = 9, width: float = 1.3) -> list[Part]:
    """A long teak box, 0.42 m high, with tall grasses."""
    deep, high = 0.4, 0.42
    slats = [
        rounded_box((width, 0.098, 0.022), 0.006, (4, 1, 1), 1).moved(
            y=0.054 + 0.105 * k, z=s * (deep / 2 - 0.011)
        )
        for k in range(4)
        for s in (-1, 1)
    ]
    slats += [
        rounded_box((0.022, 0.098, deep - 0.05), 0.006, (1, 1, 1), 1).moved(
            s * (width / 2 - 0.011), 0.054 + 0.105 * k
        )
        for k in range(4)
        for s in (-1, 1)
    ]
    earth = plane(width - 0.05, deep - 0.05, (6, 2)).moved(y=high - 0.05)
    rng = np.random.default_rng(seed)
    blades = []
    for _ in range(90):
        blade = leaf(rng.uniform(0.5, 0.85), 0.018, rng.uniform(0.5, 1.6), 0.3, 4, 1)
        blade = blade.turned((0, 0, 1), rng.uniform(58, 86)).turned((0, 1, 0), rng.uniform(0, 360))
        x, z = rng.uniform(-0.5, 0.5) * (width - 0.16), rng.uniform(-0.5, 0.5) * (deep - 0.16)
        blades.append(blade.moved(x, high - 0.06, z))
    return [
        Part("Box", joined(*slats), ("teak",)),
        Part("Earth", earth, ("soil",)),
        Part("Grasses", joined(*blades), ("grass",)),
    ]


def paving(width: float, depth: float, tile: float) -> Part:
    """The paving; its texture repeats every `tile` metres."""
    mesh = plane(width, depth)
    return Part("Paving", replace(mesh, uvs=mesh.uvs / tile), ("paving",), textured=True)
