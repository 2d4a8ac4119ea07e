"""Lamp, plant, picture, rug, floor and skirting board. Each stands on y = 0."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from studio_core.scene.transform import Transform

from ..modelling.mesh import Array, Mesh, facing, grid_faces, joined, spline
from ..modelling.parts import Part
from ..modelling.shapes import box, circle, lathe, leaf, leg, plane, rounded_box, sweep

SHADE_HEIGHT = 1.42


def floor_lamp() -> list[Part]:
    """A brass lamp, 1.68 m high, with a linen shade that is open above and below."""
    foot = lathe(
        [
            [(0.0, 0.0), (0.14, 0.0)],
            spline([(0.14, 0.0), (0.146, 0.006), (0.14, 0.014), (0.05, 0.022), (0.014, 0.03)], 11),
            [(0.014, 0.03), (0.0, 0.03)],
        ],
        22,
    )
    pole = leg((0.0, SHADE_HEIGHT + 0.02, 0.0), (0.0, 0.02, 0.0), 0.018, 0.018, around=8, rings=9)
    arms = [
        sweep(
            np.linspace(
                [0, SHADE_HEIGHT + 0.02, 0], [0.2 * math.cos(a), SHADE_HEIGHT + 0.02, 0.2 * math.sin(a)], 4
            ),
            circle(5, 0.006, 0.006),
        )
        for a in (0.3, 2.394, 4.489)
    ]
    socket = lathe(
        [[(0.0, 0.0), (0.018, 0.0)], [(0.018, 0.0), (0.018, 0.06)], [(0.018, 0.06), (0.0, 0.06)]], 12
    )
    outer = np.linspace([0.235, -0.06], [0.165, 0.25], 6)
    rim_top, rim_low = [[0.1635, 0.2515]], [[0.2335, -0.0615]]
    inner = outer[::-1] - [0.003, 0.0]
    loop = np.concatenate([outer, rim_top, inner, rim_low, outer[:1]])
    shade = lathe([loop], 28).moved(y=SHADE_HEIGHT)
    bulb = lathe([spline([(0.0, 0.055), (0.014, 0.06), (0.03, 0.1), (0.02, 0.125), (0.0, 0.132)], 9)], 12)
    return [
        Part("Stand", joined(foot, pole, *arms, socket.moved(y=SHADE_HEIGHT + 0.02)), ("brass",)),
        Part("Shade", shade, ("linen shade",)),
        Part("Bulb", bulb.moved(y=SHADE_HEIGHT + 0.02), ("opal glass",)),
    ]


def plant(seed: int = 5, leaves: int = 30) -> list[Part]:
    """A rubber fig in a clay pot, 1.45 m high."""
    rng = np.random.default_rng(seed)
    outer = spline([(0.115, 0.004), (0.13, 0.05), (0.158, 0.2), (0.17, 0.29)], 7)
    rim = [(0.17, 0.29), (0.172, 0.3), (0.166, 0.304), (0.156, 0.3)]
    pot = lathe(
        [
            [(0.0, 0.0), (0.115, 0.0)],
            np.concatenate([[(0.115, 0.0)], outer[:-1], rim, [(0.15, 0.25)]]),
            [(0.15, 0.25), (0.0, 0.25)],
        ],
        22,
    )
    soil = lathe(
        [
            [(0.0, 0.251), (0.148, 0.251)],
            [(0.148, 0.251), (0.148, 0.262)],
            [(0.148, 0.262), (0.1, 0.266), (0.05, 0.268), (0.0, 0.27)],
        ],
        16,
    )
    trunks, blades = [], []
    for lean, turn, height in ((0.10, 30.0, 1.08), (0.2, 160.0, 0.86), (0.17, 280.0, 0.66)):
        t = np.linspace(0, 1, 10)
        line = np.stack([0.03 + lean * t**1.5, 0.25 + height * t, 0.03 * np.sin(2.2 * t)], 1)
        trunks.append(sweep(line, circle(6, 0.018, 0.018), np.linspace(1.0, 0.5, 10)).turned((0, 1, 0), turn))
        count = round(leaves * height / 2.6)
        for k in range(count):
            at = 0.3 + 0.7 * (k + 0.5) / count
            place = [float(np.interp(at, t, line[:, c])) for c in range(3)]
            size = rng.uniform(0.27, 0.34) * (1.15 - 0.4 * at)
            blade = leaf(size, size * 0.47, rng.uniform(0.5, 1.0), 0.28, 5, 2).moved(x=0.03)
            blade = blade.turned((0, 0, 1), rng.uniform(8, 30) + 42 * at**3)
            blade = blade.turned((0, 1, 0), k * 137.5 + rng.uniform(-18, 18))
            blades.append(blade.moved(*place).turned((0, 1, 0), turn))
    return [
        Part("Pot", pot, ("clay",)),
        Part("Soil", soil, ("soil",)),
        Part("Stems", joined(*trunks), ("bark",)),
        Part("Leaves", joined(*blades), ("fig leaf",)),
    ]


def picture(width: float, height: float) -> list[Part]:
    """A framed print in the plane z = 0, its lower edge at y = 0, seen from +z."""
    deep, bar = 0.028, 0.022
    rods: list[Mesh] = []
    for y in (bar / 2, height - bar / 2):
        rods.append(rounded_box((width, bar, deep), 0.003, (4, 1, 1), 1).moved(y=y, z=deep / 2))
    for x in (-1, 1):
        upright = rounded_box((bar - 0.001, height - 2 * bar + 0.004, deep - 0.001), 0.003, (1, 3, 1), 1)
        rods.append(upright.moved(x * (width - bar) / 2, height / 2, deep / 2))
    sheet = _denser_at_its_edges(plane(width - 2 * bar, height - 2 * bar, (14, 12)))
    sheet = sheet.turned((1, 0, 0), 90).moved(y=height / 2, z=0.012)
    return [
        Part("Frame", joined(*rods), ("oak",)),
        Part("Print", sheet, ("print",), textured=True),
    ]


def _denser_at_its_edges(sheet: Mesh) -> Mesh:
    """A plane whose lines crowd towards the rim, where a frame's shadow lies; uvs span it once."""
    half = np.array(sheet.positions).max(axis=0)[[0, 2]]
    t = np.array(sheet.positions)[:, [0, 2]] / half
    t = np.sign(t) * (1 - (1 - np.abs(t)) ** 2)
    positions = np.array(sheet.positions)
    positions[:, [0, 2]] = t * half
    uvs = np.stack([(1 + t[:, 0]) / 2, (1 - t[:, 1]) / 2], axis=1)
    return replace(sheet, positions=positions, uvs=uvs)


def rug(width: float, depth: float) -> Part:
    """A rug 14 mm thick, without an underside; uvs span it once."""
    mesh = rounded_box(
        (width, 0.028, depth), (0.03, 0.012, 0.03), (round(width / 0.13), 1, round(depth / 0.13)), 2
    )
    upper = mesh.positions[:, 1] > -1e-9
    # The lower half is cut away: what is left stands on the floor with its rim.
    kept = upper[mesh.faces].all(axis=1)
    used, faces = np.unique(mesh.faces[kept], return_inverse=True)
    mesh = Mesh(
        mesh.positions[used], mesh.normals[used], faces.reshape(-1, 3), mesh.uvs[used], mesh.slots[kept]
    )

    def waves(p: Array) -> Array:
        lift = 0.0015 * np.sin(5 * p[:, 0] + 1) * np.sin(4 * p[:, 2]) * np.clip(p[:, 1] / 0.014, 0, 1)
        return np.asarray(p + np.stack([0 * lift, lift, 0 * lift], 1))

    return Part("Rug", mesh.bent(waves).mapped(0, 2, width, depth), ("rug",), textured=True)


def floor(width: float, depth: float, tile: float, rug: Transform, rug_size: tuple[float, float]) -> Part:
    """The floor; its texture repeats every `tile` metres.

    It has edges just beside and just below the rim of the rug that lies on it, so that the dark below the
    rug does not bleed out over a whole cell of a mesh that is shaded at its vertices.
    """
    signs = np.array([(-1.0, 1.0), (1.0, 1.0), (1.0, -1.0), (-1.0, -1.0)])
    rings = [signs * [width / 2, depth / 2]]
    matrix = rug.matrix()
    for margin in (0.012, -0.004):
        around = signs * (np.array(rug_size) / 2 + margin)
        points = np.stack([around[:, 0], np.zeros(4), around[:, 1]], 1) @ matrix[:3, :3].T + matrix[:3, 3]
        rings.append(points[:, [0, 2]])
    flat = np.concatenate(rings)
    points = np.stack([flat[:, 0], np.zeros(len(flat)), flat[:, 1]], 1)
    ring_faces = grid_faces(3, 4, wrap=True)
    faces = np.concatenate([ring_faces, [[8, 9, 10], [8, 10, 11]]])
    uvs = (flat * [1.0, -1.0] + [width / 2, depth / 2]) / tile
    up = np.tile([0.0, 1.0, 0.0], (len(points), 1))
    return Part("Floor", facing(points, up, faces, uvs), ("floor",), textured=True)


def skirting(length: float) -> Mesh:
    """A skirting board along x, its back in z = 0, seen from +z."""
    return box((length, 0.09, 0.016)).moved(y=0.046, z=0.009)
