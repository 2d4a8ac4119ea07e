"""Scenes to trace in, and a stand that follows them as the first stages of a backend do."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
from oracles.meshes import box, joined, ring

from studio_core.arrays import frozen_map
from studio_core.scene.diff import everything
from studio_core.scene.geometry import Geometry
from studio_core.scene.nodes import Material, MeshObject, Scene
from studio_core.scene.transform import Transform, normalized
from studio_core.shading.artifacts import Surfaces
from studio_core.shading.frame import Frame
from studio_core.shading.job import Job
from studio_core.shading.offline import scene_view
from studio_core.shading.pipeline import Inputs
from studio_core.shading.surfaces import CasterStage, SurfaceParams, SurfaceStage

MATERIALS = (
    Material(id="matt", name="Matt", values=frozen_map({"base_color": (0.5, 0.5, 0.5)})),
    Material(id="glass", name="Glass", opacity=0.3, values=frozen_map({"base_color": (0.5, 0.5, 0.5)})),
)


class Stand:
    """Surfaces and casters that follow a scene."""

    def __init__(self, scene: Scene, vertices: int = 2000) -> None:
        self._stages = SurfaceStage(), CasterStage()
        self._vertices = vertices
        self.surfaces: Any = None
        self.casters: Any = None
        self.follow(scene)

    def follow(self, scene: Scene) -> None:
        frame = Frame(scene, scene_view(scene, None, 32, 24), SurfaceParams(vertices=self._vertices))
        self.scene = scene
        before = self.surfaces, self.casters
        self.surfaces = self._stages[0].run(frame, Inputs({}, everything(scene), before[0]), Job("test"))
        inputs = Inputs({Surfaces: self.surfaces}, everything(scene), before[1])
        self.casters = self._stages[1].run(frame, inputs, Job("test"))

    def place(self, **transforms: Transform) -> None:
        """Puts objects elsewhere."""
        nodes = [dataclasses.replace(self.scene[name], transform=t) for name, t in transforms.items()]
        self.follow(self.scene.with_nodes(*nodes))

    @property
    def mesh(self) -> Any:
        return self.surfaces.unrefined.mesh

    def all(self) -> np.ndarray:
        return np.ones(len(self.mesh), np.bool_)


def thing(
    name: str, geometry: Geometry, at: Any = (0, 0, 0), material: str = "matt", **more: Any
) -> MeshObject:
    place = Transform(tuple(float(x) for x in at), **more)
    return MeshObject(id=name, name=name, geometry=geometry, materials=(material,), transform=place)


def scene_of(*things: MeshObject) -> Scene:
    return Scene().with_materials(*MATERIALS).with_nodes(*things)


def walls(width: float, height: float, depth: float) -> Geometry:
    """Six sheets that look into the box about (0, height / 2, 0), none of them closed."""
    outside = box((width, height, depth), (-width / 2, 0, -depth / 2))
    quads = outside.faces.reshape(6, 2, 3)
    sheets = [Geometry(outside.positions, quad[:, ::-1]) for quad in quads]
    return joined(*sheets)


def ball(radius: float = 1.0, rows: int = 14, inwards: bool = False) -> Geometry:
    """A closed sphere of quadrilaterals halved, about the origin."""
    theta = np.linspace(0, np.pi, rows + 1)[1:-1]
    phi = np.arange(2 * rows) * np.pi / rows
    t, p = np.meshgrid(theta, phi, indexing="ij")
    points = np.stack([np.sin(t) * np.sin(p), np.cos(t), np.sin(t) * np.cos(p)], axis=-1).reshape(-1, 3)
    points = radius * np.concatenate([points, [(0, 1, 0), (0, -1, 0)]])
    across = 2 * rows
    faces = []
    for i in range(rows - 2):
        for j in range(across):
            a, b = i * across + j, i * across + (j + 1) % across
            faces += [(a, a + across, b + across), (a, b + across, b)]
    for j in range(across):
        last = (rows - 2) * across
        faces.append((len(points) - 2, j, (j + 1) % across))
        faces.append((len(points) - 1, last + (j + 1) % across, last + j))
    made = np.array(faces)
    return Geometry(points, made[:, ::-1] if inwards else made)


def furnished(offset: Any = (0.0, 0.0, 0.0)) -> Scene:
    """A room without one wall: boxes of one mesh, a ring on a box, a ball at a wall."""
    away = np.asarray(offset, float)
    sheets = walls(4.0, 2.5, 4.0)
    open_front = Geometry(sheets.positions, sheets.faces[:-2])
    chest = box((1.0, 0.6, 0.5))
    return scene_of(
        thing("room", open_front, away),
        thing("chest", chest, np.add(away, (-1.2, 0, -1.0))),
        thing("stool", chest, np.add(away, (0.6, 0, 0.3)), scale=0.6),
        thing("hoop", ring(24, 12, 0.3), np.add(away, (-0.7, 0.72, -0.75)), scale=0.4),
        thing("ball", ball(0.45), np.add(away, (1.3, 0.45, -1.4))),
    )


def somewhere(rng: np.random.Generator, offset: Any = (0.0, 0.0, 0.0), scale: float = 1.0) -> Transform:
    """A pose in the furnished room: within it or through a wall or a floor, often at rest on the floor."""
    at = np.asarray(offset) + rng.uniform((-1.8, 0.0, -1.8), (1.2, 1.6, 1.8))
    turn: Any = rng.normal(size=4)
    if rng.random() < 0.5:
        at[1] = offset[1]
        angle = rng.uniform(0, 2 * np.pi)
        turn = np.array([np.cos(angle / 2), 0.0, np.sin(angle / 2), 0.0])
    return Transform(tuple(at.tolist()), normalized(tuple((turn / np.linalg.norm(turn)).tolist())), scale)


__all__ = ["Stand", "ball", "furnished", "scene_of", "somewhere", "thing", "walls"]
