"""Meshes of the scenes of `lucarne bench interreflection`: grids, solids of revolution, tubes, blobs.

Their vertices are counted, since the figures that they are compared with are of scenes of that size.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np
import numpy.typing as npt

from studio_core.scene.geometry import Geometry

F64 = npt.NDArray[np.float64]
I64 = npt.NDArray[np.int64]
Point = tuple[float, float, float]


def merged(*parts: Geometry) -> Geometry:
    """Several meshes in one; slots count on: those of the second begin where the first's end."""
    starts = np.cumsum([0, *(len(part.positions) for part in parts)])[:-1]
    slots: list[npt.NDArray[np.uint16]] = []
    first = 0
    for part in parts:
        own = np.zeros(len(part.faces), np.uint16) if part.slots is None else part.slots
        slots.append((own + first).astype(np.uint16))
        first += int(own.max()) + 1
    return Geometry(
        np.concatenate([part.positions for part in parts]),
        np.concatenate(
            [part.faces.astype(np.int64) + at for part, at in zip(parts, starts, strict=True)]
        ).astype(np.uint32),
        np.concatenate([_normals(part) for part in parts]),
        None,
        np.concatenate(slots),
    )


def one_slot(mesh: Geometry) -> Geometry:
    """The mesh with all its faces of one material."""
    return Geometry(mesh.positions, mesh.faces, mesh.normals, mesh.uvs)


def inside_out(mesh: Geometry) -> Geometry:
    """The mesh seen from its other side."""
    return Geometry(mesh.positions, np.ascontiguousarray(mesh.faces[:, ::-1]), -_normals(mesh), mesh.uvs)


def sheet(corner: Point, across: Point, up: Point, cells: tuple[int, int]) -> Geometry:
    """A flat grid of (cells + 1)² vertices from `corner` along two sides; its front is across × up."""
    u, v = (np.linspace(0, 1, n + 1) for n in cells)
    place = np.stack(np.meshgrid(u, v, indexing="ij"), axis=-1).reshape(-1, 2)
    sides = np.array([across, up], np.float64)
    normal = np.cross(*sides)
    normal = normal / np.linalg.norm(normal)
    return Geometry(
        (np.array(corner) + place @ sides).astype(np.float32),
        _quads(cells[0] + 1, cells[1] + 1, wrap=False).astype(np.uint32),
        np.tile(normal.astype(np.float32), (len(place), 1)),
    )


def box(low: Point, high: Point, cells: tuple[int, int, int], inward: bool = False) -> Geometry:
    """A box of six grids with `cells` along x, y and z; `inward` has its fronts inside, as a closed room."""
    size = np.subtract(high, low)
    faces = []
    for axis in range(3):
        u, v = (axis + 1) % 3, (axis + 2) % 3
        for far in (False, True):
            first, second = (v, u) if far == inward else (u, v)
            corner = np.array(low, np.float64)
            corner[axis] = high[axis] if far else low[axis]
            sides = [tuple(float(x) for x in np.eye(3)[k] * size[k]) for k in (first, second)]
            start = (float(corner[0]), float(corner[1]), float(corner[2]))
            faces.append(sheet(start, *sides, (cells[first], cells[second])))  # type: ignore[arg-type]
    return one_slot(merged(*faces))


def slab(width: float, depth: float, thick: float, cells: tuple[int, int]) -> Geometry:
    """A floor that is closed: (cells + 1)² vertices on y = 0, sides and an underside."""
    x, z = width / 2, depth / 2
    across, deep = cells
    return one_slot(
        merged(
            sheet((-x, 0, z), (width, 0, 0), (0, 0, -depth), cells),
            sheet((-x, -thick, -z), (width, 0, 0), (0, 0, depth), (1, 1)),
            sheet((-x, -thick, z), (width, 0, 0), (0, thick, 0), (across, 1)),
            sheet((x, -thick, -z), (-width, 0, 0), (0, thick, 0), (across, 1)),
            sheet((x, -thick, z), (0, 0, -depth), (0, thick, 0), (deep, 1)),
            sheet((-x, -thick, -z), (0, 0, depth), (0, thick, 0), (deep, 1)),
        )
    )


def shell(low: Point, high: Point, thick: float, cells: tuple[int, int, int]) -> Geometry:
    """A room without a front (+z), closed walls of that thickness; `cells` of its inside.

    Slots: 0 floor, 1 left (−x), 2 right, 3 back, 4 ceiling, 5 what is outside.
    """
    x0, y0, z0 = low
    x1, y1, z1 = high
    wide, tall, deep = x1 - x0, y1 - y0, z1 - z0
    nx, ny, nz = cells
    inside = merged(
        sheet((x0, y0, z1), (wide, 0, 0), (0, 0, -deep), (nx, nz)),
        sheet((x0, y0, z1), (0, 0, -deep), (0, tall, 0), (nz, ny)),
        sheet((x1, y0, z0), (0, 0, deep), (0, tall, 0), (nz, ny)),
        sheet((x0, y0, z0), (wide, 0, 0), (0, tall, 0), (nx, ny)),
        sheet((x0, y1, z0), (wide, 0, 0), (0, 0, deep), (nx, nz)),
    )
    a, b = (x0 - thick, y0 - thick, z0 - thick), (x1 + thick, y1 + thick, z1)
    outer = box(a, b, (1, 1, 1))
    front = np.asarray(outer.normals)[:, 2] > 0.5
    kept = ~front[outer.faces].all(axis=1)
    outer = Geometry(outer.positions, outer.faces[kept], outer.normals)
    rim = [
        sheet((a[0], a[1], z1), (wide + 2 * thick, 0, 0), (0, thick, 0), (nx, 1)),
        sheet((a[0], y1, z1), (wide + 2 * thick, 0, 0), (0, thick, 0), (nx, 1)),
        sheet((a[0], y0, z1), (thick, 0, 0), (0, tall, 0), (1, ny)),
        sheet((x1, y0, z1), (thick, 0, 0), (0, tall, 0), (1, ny)),
    ]
    return merged(inside, one_slot(merged(outer, *rim)))


def revolved(profile: Sequence[tuple[float, float]], rings: int, around: int) -> Geometry:
    """A closed solid about y: rings · around + 2 vertices, from a profile (radius, height).

    Its ends, of radius 0, are the poles; rings lie evenly in length on the line through its points.
    """
    line = np.array(profile, np.float64)
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))])
    at = np.linspace(0, length[-1], rings + 2)
    radius, height = (np.interp(at, length, line[:, k]) for k in (0, 1))
    angle = np.arange(around) * 2 * math.pi / around
    ring = np.stack([np.cos(angle), np.zeros(around), -np.sin(angle)], axis=1)
    shaft = radius[1:-1, None, None] * ring + np.array([0.0, 1.0, 0.0]) * height[1:-1, None, None]
    poles = np.array([[0.0, height[0], 0.0], [0.0, height[-1], 0.0]])
    return _capped(shaft.reshape(-1, 3), poles, rings, around)


def tube(path: npt.ArrayLike, radius: npt.ArrayLike, rings: int, around: int) -> Geometry:
    """A closed pipe along a line in a plane x, y: rings · around + 2 vertices."""
    knots, width = np.asarray(path, np.float64), np.asarray(radius, np.float64)
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(knots, axis=0), axis=1))])
    at = np.linspace(0, length[-1], rings)
    line = np.stack([_smooth(length, knots[:, k])(at) for k in range(3)], axis=1)
    thick = np.interp(at, length, width)
    along = np.gradient(line, axis=0)
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    side = np.array([0.0, 0.0, 1.0])
    other = np.cross(side, along)
    angle = np.arange(around) * 2 * math.pi / around
    out = np.cos(angle)[:, None] * side + np.sin(angle)[:, None] * other[:, None]  # (rings, around, 3)
    shaft = line[:, None] + out * thick[:, None, None]
    ends = np.stack([line[0] - along[0] * thick[0] / 2, line[-1] + along[-1] * thick[-1] / 2])
    return _capped(shaft.reshape(-1, 3), ends, rings, around)


def star(rings: int, around: int, radius: Callable[[F64], F64]) -> Geometry:
    """A closed body about the origin: how far it reaches (N,) by unit directions (N, 3)."""
    theta = math.pi * (np.arange(rings) + 1) / (rings + 1)
    phi = 2 * math.pi * np.arange(around) / around
    t, p = (a.ravel() for a in np.meshgrid(theta, phi, indexing="ij"))
    directions = np.stack([np.sin(t) * np.cos(p), -np.cos(t), -np.sin(t) * np.sin(p)], axis=1)
    poles = np.array([[0.0, -1.0, 0.0], [0.0, 1.0, 0.0]])
    shaft, ends = (towards * radius(towards)[:, None] for towards in (directions, poles))
    return _capped(shaft, ends, rings, around)


def bunny(directions: F64) -> F64:
    """Reach of a sitting animal: a body, a head, two ears, a tail, and fur of a few low waves."""
    made = np.full(len(directions), 0.62)
    bumps = (
        ((0.0, 0.75, 0.65), 0.42, 9.0),
        ((0.22, 0.95, 0.25), 0.5, 60.0),
        ((-0.22, 0.95, 0.25), 0.5, 60.0),
        ((0.0, -0.35, -0.95), 0.16, 30.0),
        ((0.35, -0.75, 0.6), 0.2, 14.0),
        ((-0.35, -0.75, 0.6), 0.2, 14.0),
    )
    for towards, height, sharpness in bumps:
        axis = np.array(towards) / np.linalg.norm(towards)
        made += height * np.exp(sharpness * (directions @ axis - 1))
    rng = np.random.default_rng(11)
    for _ in range(8):
        wave, phase = rng.normal(0, 4.0, 3), rng.uniform(0, 2 * math.pi)
        made += 0.012 * np.sin(directions @ wave + phase)
    return made


def teapot() -> Geometry:
    """A pot with spout, handle and knob, 3,241 vertices, standing on y = 0, 0.5 m long."""
    body = [(0.0, 0.0), (0.08, 0.0), (0.1, 0.012), (0.135, 0.05), (0.15, 0.09), (0.145, 0.125)]
    body += [(0.12, 0.16), (0.085, 0.182), (0.05, 0.192), (0.018, 0.198), (0.014, 0.208)]
    body += [(0.026, 0.216), (0.026, 0.228), (0.014, 0.236), (0.0, 0.237)]
    spout = [(0.12, 0.06, 0.0), (0.18, 0.085, 0.0), (0.215, 0.13, 0.0), (0.25, 0.175, 0.0)]
    handle = [(-0.11, 0.155, 0.0), (-0.18, 0.165, 0.0), (-0.22, 0.12, 0.0), (-0.19, 0.06, 0.0)]
    handle += [(-0.13, 0.045, 0.0)]
    parts = (
        revolved(_rounded(body), 42, 48),
        tube(spout, (0.034, 0.026, 0.02, 0.017), 26, 24),
        tube(handle, (0.012, 0.013, 0.013, 0.013, 0.012), 35, 17),
    )
    return one_slot(merged(*parts))


def vase(rings: int, around: int, height: float = 0.5) -> Geometry:
    """A turned vase, standing on y = 0."""
    outline = [(0.0, 0.0), (0.3, 0.0), (0.36, 0.06), (0.46, 0.3), (0.42, 0.5), (0.22, 0.72), (0.18, 0.85)]
    outline += [(0.26, 0.98), (0.24, 1.0), (0.15, 0.86), (0.0, 0.84)]
    return revolved([(r * height, y * height) for r, y in _rounded(outline)], rings, around)


def _rounded(outline: Sequence[tuple[float, float]]) -> list[tuple[float, float]]:
    """The outline without its corners: each is cut twice at quarters (Chaikin 1974); its ends stay."""
    line = np.array(outline, np.float64)
    for _ in range(3):
        cut = np.stack([0.75 * line[:-1] + 0.25 * line[1:], 0.25 * line[:-1] + 0.75 * line[1:]], axis=1)
        line = np.concatenate([line[:1], cut.reshape(-1, 2)[1:-1], line[-1:]])
    return [(float(r), float(y)) for r, y in line]


def _smooth(at: F64, values: F64) -> Callable[[F64], F64]:
    from scipy.interpolate import PchipInterpolator

    made: Callable[[F64], F64] = PchipInterpolator(at, values)
    return made


def _capped(shaft: F64, poles: F64, rings: int, around: int) -> Geometry:
    """Rings from the first pole to the second, counter-clockwise seen from the second; closed, smooth."""
    here, there = np.arange(around), (np.arange(around) + 1) % around
    low, high = len(shaft), len(shaft) + 1
    last = (rings - 1) * around
    bottom = np.stack([np.full(around, low), here, there], axis=1)
    top = np.stack([last + there, last + here, np.full(around, high)], axis=1)
    faces = np.concatenate([_quads(rings, around, wrap=True), bottom, top])
    positions = np.concatenate([shaft, poles])
    flat = np.cross(*(positions[faces[:, k]] - positions[faces[:, 0]] for k in (1, 2)))
    volume = (positions[faces[:, 0]] * flat).sum()
    if volume < 0:
        faces, flat = faces[:, ::-1], -flat
    normals = np.zeros_like(positions)
    for k in range(3):
        np.add.at(normals, faces[:, k], flat)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return Geometry(positions.astype(np.float32), faces.astype(np.uint32), normals.astype(np.float32))


def _quads(rows: int, columns: int, wrap: bool) -> I64:
    """Triangles of a grid of vertices, row by row."""
    across = columns if wrap else columns - 1
    row, column = (a.ravel() for a in np.meshgrid(np.arange(rows - 1), np.arange(across), indexing="ij"))
    a, b = row * columns + column, row * columns + (column + 1) % columns
    c, d = a + columns, b + columns
    return np.concatenate([np.stack([a, c, d], axis=1), np.stack([a, d, b], axis=1)])


def _normals(mesh: Geometry) -> npt.NDArray[np.float32]:
    assert mesh.normals is not None
    return mesh.normals
