"""Strokes in indirect mode on rooms that are lit by `gather`: what is painted is what another scene shows."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
from gathered_rooms import Room

from studio_core.arrays import frozen_map
from studio_core.contract import Services
from studio_core.scene.geometry import Geometry
from studio_core.scene.nodes import Material, MeshObject, Scene
from studio_core.shading.artifacts import Indirect, Receivers, Surfaces
from studio_core.shading.job import Job
from studio_core.strokes.marks import Marks
from studio_core.strokes.solution import Lit
from studio_core.strokes.stroke import Stroke
from studio_plugins.slf.reflected import Reflected, Reflections

JOB = Job("test")


class Painting:
    """A room, its light, and strokes on it."""

    def __init__(self, scene: Scene, services: Services, vertices: int = 3000, **params: Any) -> None:
        self.scene, self.services = scene, services
        self.room = Room(scene, services, vertices, **params)
        self.solver = Reflected(services)
        self.lit = self.light(scene)

    def light(self, scene: Scene) -> Indirect:
        """The light between surfaces of a scene, as while something moves."""
        return self.room.light(scene)

    @property
    def mesh(self) -> Any:
        return self.room.handed()[Surfaces].mesh

    @property
    def eye(self) -> Any:
        return self.room.handed()[Receivers].eye

    def vertices(self, node: str, near: Any, count: int) -> Any:
        """Of an object's free vertices that look up or towards the eye, the nearest to a place."""
        mesh = self.mesh
        own = np.arange(len(mesh))[mesh.vertices_of(mesh.index_of(node))]
        covered = self.lit.sent.surface.covered if self.lit.sent is not None else None
        if covered is not None:
            own = own[~np.isin(own, covered.vertices)]
        seen = ((self.eye - mesh.origin - mesh.positions[own]) * mesh.normals[own]).sum(axis=1) > 0
        own = own[seen]
        away = np.linalg.norm(mesh.positions[own] + mesh.origin - np.asarray(near), axis=1)
        return own[np.argsort(away)[:count]]

    def radiance(self, made: Indirect, some: Any) -> Any:
        """(N, 3) towards the eye, of light by way of others."""
        assert made.sent is not None
        looks = made.sent.surface.coefficients[some]
        width = min(looks.shape[1], made.layer.terms.shape[1])
        return (made.layer.terms[some][:, :width] * looks[:, :width]).sum(axis=1).astype(np.float64)

    def after(self, scene: Scene, some: Any) -> Any:
        """(N, 3) what another scene shows there; the room is as before then."""
        made = self.radiance(self.light(scene), some)
        self.lit = self.light(self.scene)
        return made

    def stroke(self, some: Any, wanted: Any, number: int = 0, **more: Any) -> Stroke:
        """At vertices of one object."""
        mesh, count = self.mesh, len(some)
        placed = mesh.objects[int(mesh.object[some[0]])]
        local = some - mesh.vertex_offsets[int(mesh.object[some[0]])]
        shape = placed.mesh
        shown = self.radiance(self.lit, some)
        marks = Marks(
            np.zeros(count, np.int64), shape.positions[local], shape.normals[local],
            shape.slot[local].astype(np.int64), np.tile(self.eye, (count, 1)).astype(np.float32),
            shown.astype(np.float32), np.asarray(wanted, np.float32), np.ones(count, np.float32),
            np.full((count, 3), np.nan, np.float32),
        )  # fmt: skip
        return Stroke(
            id=f"stroke-{number}", name="Stroke", indirect=True, objects=(placed.node,), table=marks.table(),
            **more,
        )  # fmt: skip

    def fixate(self, some: Any, number: int = 9) -> Stroke:
        """Of light that is to stay."""
        return self.stroke(some, self.radiance(self.lit, some), number, tool="fixate")

    def solve(self, *strokes: Stroke) -> Reflections:
        """What explains them."""
        return self.solver.solve(self.scene, strokes, self.given(), JOB)

    def given(self) -> Lit:
        """As solvers get it."""
        handed = self.room.handed()
        return Lit(*(handed[kind] for kind in list(handed)[:4]), None, self.lit)  # type: ignore[arg-type]

    def become(self, scene: Scene) -> None:
        """From now on another scene."""
        self.scene = scene
        self.lit = self.light(scene)


def separate(scene: Scene) -> Scene:
    """Every object with a material of its own."""
    for node in list(scene.of(MeshObject)):
        name = f"of {node.id}"
        own = dataclasses.replace(scene.material(node.materials[0]), id=name)
        scene = scene.with_materials(own).with_nodes(dataclasses.replace(node, materials=(name,)))
    return scene


def band(radius: float = 0.5, height: float = 0.22, thick: float = 0.03, around: int = 72) -> Geometry:
    """A ring that stands on y = 0."""
    levels = np.linspace(0, height, 6)
    profile = [(radius, y) for y in levels] + [(radius - thick, y) for y in levels[::-1]]
    angles = 2 * np.pi * np.arange(around) / around
    points = np.array([(r * np.cos(a), y, r * np.sin(a)) for r, y in profile for a in angles], np.float32)
    i, j = (one.ravel() for one in np.meshgrid(np.arange(len(profile)), np.arange(around), indexing="ij"))
    p, q = i * around + j, i * around + (j + 1) % around
    r, s = (p + around) % len(points), (q + around) % len(points)
    faces = np.concatenate([np.stack([p, r, q], axis=1), np.stack([q, r, s], axis=1)])
    return Geometry(points, faces.astype(np.uint32))


def recoloured(scene: Scene, node: str, model: str = "", slot: int = 0, **values: Any) -> Scene:
    """With other values of one object's material, in another model."""
    thing = scene[node]
    assert isinstance(thing, MeshObject)
    old = scene.material(thing.materials[slot])
    kept = dict(old.values) if model in ("", old.model) else {}
    made = Material(id="other", name="Other", model=model or old.model, values=frozen_map({**kept, **values}))
    names = tuple("other" if i == slot else name for i, name in enumerate(thing.materials))
    return scene.with_materials(made).with_nodes(dataclasses.replace(thing, materials=names))


__all__ = ["JOB", "Painting", "band", "recoloured", "separate"]
