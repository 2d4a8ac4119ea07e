"""The scenes of the paper's figures 14–22, rebuilt: what matters in each, of a few objects.

A bunny stands for the dragon. Rooms have no front; walls are of few faces, which shading divides as finely as
the backend is asked to.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from studio.bench.interreflection_meshes import (
    box,
    bunny,
    merged,
    one_slot,
    sheet,
    shell,
    star,
    teapot,
    vase,
)
from studio_core.arrays import frozen_map
from studio_core.params import Colour, Value
from studio_core.scene.geometry import Geometry, Image, Texture
from studio_core.scene.nodes import (
    AreaLamp,
    Camera,
    Environment,
    Material,
    MeshObject,
    PointLamp,
    Scene,
    SpotLamp,
)
from studio_core.scene.transform import Transform, axis_angle, looking

F64 = npt.NDArray[np.float64]
Point = tuple[float, float, float]
TEXELS = 256


def shadow() -> Scene:
    """Figure 14: a table's shadow on a floor between a white and a red wall, under one lamp."""
    names = ("floor", "left", "wall", "wall", "wall", "wall")
    legs = [box((x, 0, z), (x + 0.05, 0.6, z + 0.05), (1, 1, 1)) for x in (-0.5, 0.45) for z in (-0.4, 0.35)]
    table = one_slot(merged(box((-0.55, 0.6, -0.45), (0.55, 0.65, 0.45), (1, 1, 1)), *legs))
    return _scene(
        [_matte("floor", (0.5, 0.48, 0.45)),
         _matte("left", (0.6, 0.1, 0.07)), _matte("wall", (0.75, 0.74, 0.7)),
         _matte("wood", (0.45, 0.3, 0.18))],
        _thing("room", shell((-1.5, 0, -1.4), (1.5, 2.2, 1.4), 0.1, (1, 1, 1)), *names),
        _thing("table", table, "wood", at=Transform((-0.35, 0, 0.05), axis_angle((0, 1, 0), 15))),
        _lamp((0.3, 2.1, 0.2), (0.2, 0, 0.2), 0.5, 60.0),
        _camera((0.25, 1.75, 3.1), (0.0, 0.45, 0.0), 42.0),
    )  # fmt: skip


def closed() -> Scene:
    """Figure 15: a bright room that lights itself, of one paint, and two things in it."""
    return _scene(
        [_matte("wall", (0.8, 0.8, 0.8)), _matte("clay", (0.55, 0.3, 0.2))],
        _thing("room", box((-1.5, 0, -1.5), (1.5, 2.2, 1.5), (1, 1, 1), inward=True), "wall"),
        _thing("vase", vase(24, 32, 0.9), "clay", at=_at(0.55, -0.5)),
        _thing("ball", star(20, 32, _round(0.3)), "clay", at=Transform((-0.6, 0.3, -0.3))),
        _lamp((0.0, 2.1, 0.3), (0.0, 0, 0.29), 0.5, 18.0),
        _camera((0.0, 1.2, 1.42), (0.0, 0.85, -0.4), 75.0),
    )


def still_life() -> Scene:
    """Figure 16: a glossy bunny, a matte red ball and a brown ball that shines a little."""
    return _scene(
        [_matte("floor", (0.35, 0.36, 0.38)),
         _shiny("porcelain", (0.14, 0.3, 0.24), (0.12, 0.12, 0.12), 0.4),
         _shiny("red", (0.5, 0.03, 0.02), (0.0, 0.0, 0.0), 0.25),
         _shiny("brown", (0.13, 0.08, 0.05), (0.04, 0.04, 0.04), 0.38)],
        _thing("floor", sheet((-4, 0, 4), (8, 0, 0), (0, 0, -8), (1, 1)), "floor"),
        _thing("bunny", _standing(star(60, 64, bunny), 0.4), "porcelain", at=_at(-0.62, -0.1, 25)),
        _thing("red ball", star(32, 48, _round(0.3)), "red", at=Transform((0.15, 0.3, 0.25))),
        _thing("brown ball", star(32, 48, _round(0.36)), "brown", at=Transform((0.75, 0.36, -0.3))),
        _lamp((-0.4, 2.0, 1.9), (0.1, 0.2, 0), 0.35, 45.0),
        Environment(id="sky", name="Sky", image=_sky(0.35)),
        _camera((0.05, 1.25, 2.6), (0.08, 0.3, 0.0), 36.0),
    )  # fmt: skip


def corner(floor: Material | None = None) -> Scene:
    """Figures 17 and 18: a floor between walls of their own materials, and a box on it."""
    walls = ("floor", "left", "right", "back")
    grey = [_matte(name, (0.7, 0.7, 0.68)) for name in walls[1:]]
    room = shell((-1.5, 0, -1.4), (1.5, 2.2, 1.4), 0.1, (1, 1, 1))
    return _scene(
        [*grey, floor or _matte("floor", (0.6, 0.58, 0.55)), _matte("box", (0.55, 0.45, 0.3))],
        _thing("floor", _slots(room, 0), "floor"),
        *(_thing(name, _slots(room, slot), name) for slot, name in enumerate(walls[1:], 1)),
        _thing("box", box((-0.25, 0, -0.25), (0.25, 0.5, 0.25), (1, 1, 1)), "box", at=_at(0.2, -0.55, 30)),
        _lamp((0.5, 2.1, 0.5), (-0.9, 0.4, -0.2), 0.5, 50.0),
        _camera((0.0, 1.5, 3.7), (0.0, 0.75, 0.0), 40.0),
    )


def glossy_corner() -> Scene:
    """Figure 18: its floor shows the walls, dimly."""
    return corner(_shiny("floor", (0.03, 0.03, 0.03), (0.6, 0.6, 0.6), 0.35))


def ring() -> Scene:
    """Figure 19: a blue ring of paint on a table in a corner, and a spot light into it."""
    return _scene(
        [*(_matte(name, (0.7, 0.7, 0.7)) for name in ("table", "back", "side")),
         _matte("ring", (0.06, 0.09, 0.28))],
        _thing("table", sheet((-1.2, 0, 1.2), (2.4, 0, 0), (0, 0, -2.4), (1, 1)), "table"),
        _thing("back", sheet((-1.2, 0, -1.2), (2.4, 0, 0), (0, 1.6, 0), (1, 1)), "back"),
        _thing("side", sheet((-1.2, 0, 1.2), (0, 0, -2.4), (0, 1.6, 0), (1, 1)), "side"),
        _thing("ring", _band(0.5, 0.22, 0.03), "ring"),
        SpotLamp(
            id="lamp", name="Lamp", transform=looking((1.5, 1.4, 0.4), (0, 0.1, 0)), intensity=9.0, cone=40.0,
            inner=30.0,
        ),
        _camera((0.35, 1.9, 2.2), (-0.05, 0.25, -0.1), 40.0),
    )  # fmt: skip


def pot() -> Scene:
    """Figure 20: a teapot of matte paint under the captured sky of a sample."""
    from studio.samples import sample
    from studio_core.project.store import load

    sky = next(load(sample("living-room")).scene.of(Environment))
    return _scene(
        [_matte("floor", (0.4, 0.38, 0.36)), _shiny("pot", (0.2, 0.06, 0.04), (0.0, 0.0, 0.0), 0.25)],
        _thing("floor", sheet((-2, 0, 2), (4, 0, 0), (0, 0, -4), (1, 1)), "floor"),
        _thing("pot", teapot(), "pot", at=_at(0.0, 0.0, 20)),
        dataclasses.replace(sky, id="sky", parent=None),
        _camera((0.15, 0.42, 0.75), (0.01, 0.1, 0.0), 38.0),
    )


def bricks() -> Scene:
    """Figure 21: light and dark tiles with grain and bumps, in a lamp's light."""
    material = Material(
        id="tiles",
        name="Tiles",
        model="specgloss",
        values=frozen_map({"diffuse": (1.0, 0.8, 0.7), "specular": (0.02, 0.02, 0.02), "roughness": 0.4}),
        textures=frozen_map({"diffuse": Texture(_tiles()), "normal": Texture(_bumps(), (6.0, 6.0))}),
    )
    return _scene(
        [material],
        _thing("ground", _square(3.0), "tiles"),
        PointLamp(id="lamp", name="Lamp", intensity=14.0, transform=Transform((0.3, 1.5, -1.4))),
        Environment(id="sky", name="Sky", image=_sky(0.12)),
        _camera((0.0, 1.3, 1.5), (0, 0, -0.05), 36.0),
    )


def furnished() -> Scene:
    """Figure 22: glossy and matte things in a coloured room."""
    names = ("floor", "left", "right", "wall", "wall", "wall")
    return _scene(
        [_matte("floor", (0.45, 0.4, 0.34)),
         _matte("left", (0.5, 0.16, 0.1)), _matte("right", (0.16, 0.34, 0.2)),
         _matte("wall", (0.55, 0.54, 0.5)),
         _shiny("bunny", (0.3, 0.26, 0.2), (0.06, 0.06, 0.06), 0.35),
         _shiny("vase", (0.1, 0.18, 0.4), (0.08, 0.08, 0.08), 0.3),
         _matte("stool", (0.5, 0.4, 0.22))],
        _thing("room", shell((-1.5, 0, -1.4), (1.5, 2.2, 1.4), 0.1, (1, 1, 1)), *names),
        _thing("bunny", _standing(star(40, 44, bunny), 0.55), "bunny", at=_at(-0.45, 0.1, 20)),
        _thing("vase", vase(24, 28, 0.75), "vase", at=_at(0.75, 0.35)),
        _thing("stool", box((-0.3, 0, -0.3), (0.3, 0.42, 0.3), (1, 1, 1)), "stool", at=_at(0.45, -0.55, 30)),
        _lamp((0.2, 2.1, 0.4), (0.1, 0, 0.1), 0.6, 50.0),
        _camera((0.0, 1.35, 3.6), (0.0, 0.75, 0.0), 40.0),
    )  # fmt: skip


def _scene(
    materials: list[Material], *nodes: MeshObject | AreaLamp | PointLamp | SpotLamp | Environment | Camera
) -> Scene:
    return Scene().with_materials(*materials).with_nodes(*nodes)


def _matte(name: str, colour: Colour) -> Material:
    values: dict[str, Value] = {"base_color": colour}
    return Material(id=name, name=name.capitalize(), model="lambert", values=frozen_map(values))


def _shiny(name: str, diffuse: Colour, specular: Colour, roughness: float) -> Material:
    values: dict[str, Value] = {"diffuse": diffuse, "specular": specular, "roughness": roughness}
    return Material(id=name, name=name.capitalize(), model="specgloss", values=frozen_map(values))


def _thing(name: str, mesh: Geometry, *materials: str, at: Transform | None = None) -> MeshObject:
    place = at or Transform()
    return MeshObject(id=name, name=name.capitalize(), geometry=mesh, materials=materials, transform=place)


def _lamp(eye: Point, target: Point, side: float, intensity: float) -> AreaLamp:
    place = looking(eye, target)
    return AreaLamp(id="lamp", name="Lamp", transform=place, width=side, height=side, intensity=intensity)


def _camera(eye: Point, target: Point, fov: float) -> Camera:
    return Camera(id="camera", name="Camera", transform=looking(eye, target), fov=fov)


def _at(x: float, z: float, degrees: float = 0.0) -> Transform:
    return Transform((x, 0.0, z), axis_angle((0, 1, 0), degrees))


def _round(radius: float) -> Callable[[F64], F64]:
    return lambda directions: np.full(len(directions), radius)


def _standing(mesh: Geometry, scale: float) -> Geometry:
    placed = mesh.positions * np.float32(scale)
    placed[:, 1] -= placed[:, 1].min()
    return Geometry(placed, mesh.faces, mesh.normals)


def _slots(mesh: Geometry, slot: int) -> Geometry:
    """One slot's faces alone."""
    assert mesh.slots is not None
    assert mesh.normals is not None
    kept, faces = np.unique(mesh.faces[mesh.slots == slot], return_inverse=True)
    return Geometry(mesh.positions[kept], faces.reshape(-1, 3).astype(np.uint32), mesh.normals[kept])


def _band(radius: float, height: float, thick: float, around: int = 72) -> Geometry:
    """A ring that stands on y = 0, open above and below as a strip of metal is."""
    levels = np.linspace(0, height, 6)
    profile = [(radius, y) for y in levels] + [(radius - thick, y) for y in levels[::-1]]
    angle = 2 * np.pi * np.arange(around) / around
    points = np.array([(r * np.cos(a), y, r * np.sin(a)) for r, y in profile for a in angle], np.float32)
    i, j = (one.ravel() for one in np.meshgrid(np.arange(len(profile)), np.arange(around), indexing="ij"))
    p, q = i * around + j, i * around + (j + 1) % around
    r, s = (p + around) % len(points), (q + around) % len(points)
    faces = np.concatenate([np.stack([p, r, q], axis=1), np.stack([q, r, s], axis=1)])
    return Geometry(points, faces.astype(np.uint32))


def _square(size: float) -> Geometry:
    """A square at y = 0 that faces up, uv over all of it."""
    half = size / 2
    corners = [(-half, 0, half), (half, 0, half), (half, 0, -half), (-half, 0, -half)]
    uvs = np.array([(0, 0), (1, 0), (1, 1), (0, 1)], np.float32)
    up = np.tile(np.array([0, 1, 0], np.float32), (4, 1))
    return Geometry(np.array(corners, np.float32), np.array([(0, 1, 2), (0, 2, 3)], np.uint32), up, uvs)


def _sky(level: float) -> Image:
    """Brighter and bluer towards the top, warm on one side."""
    v, u = np.meshgrid((np.arange(32) + 0.5) / 32, (np.arange(64) + 0.5) / 64, indexing="ij")
    up, side = np.cos(np.pi * v), np.cos(2 * np.pi * (u - 0.25)) * np.sin(np.pi * v)
    rgb = level * np.stack([0.6 + 0.2 * up + 0.2 * side, 0.6 + 0.3 * up, 0.6 + 0.4 * up], axis=2)
    return Image(rgb.astype(np.float32))


def _tiles() -> Image:
    """Squares of two greys, with grain."""
    row, column = np.indices((TEXELS, TEXELS)) * 8 // TEXELS
    grain = np.random.default_rng(3).uniform(0.75, 1.0, (TEXELS, TEXELS))
    grey = np.where((row + column) % 2 == 0, 0.55, 0.18) * grain
    return Image(np.repeat(grey[..., None], 3, axis=2).astype(np.float32))


def _bumps() -> Image:
    v, u = (np.indices((64, 64)) + 0.5) / 64
    across, up = 0.12 * np.cos(2 * np.pi * 2 * u), 0.12 * np.cos(2 * np.pi * 3 * v)
    normals = np.stack([-across, -up, np.ones_like(across)], axis=2)
    normals /= np.linalg.norm(normals, axis=2, keepdims=True)
    return Image(((normals + 1) / 2).astype(np.float32), "data")
