"""From a wanted change to the paint of objects: few points where it is uniform, many where it varies.

Points are vertices of the object's shading mesh, which is refined for this where the change differs between
neighbours, down to SHORTEST (`points`): paint is as sharp as the stroke, whatever the mesh of the day.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from studio_core.contract import Services
from studio_core.scene.geometry import Texture
from studio_core.scene.nodes import MeshObject, NodeId, Scene
from studio_core.scene.paint import Paint
from studio_core.scene.shading_mesh import ShadingMesh
from studio_core.scene.world_mesh import Placed, assemble
from studio_core.shading.artifacts import Surfaces
from studio_core.shading.looks import PictureLooks, looks_vary
from studio_core.strokes.stroke import Stroke
from studio_plugins.slf.field import Field
from studio_plugins.slf.looks import LookTable
from studio_plugins.slf.points import Known, finer, sufficient
from studio_plugins.slf.similarity import Reach, likeness_of
from studio_plugins.slf.spots import SLOTS, Spots, frame_of, joined, on_object

F32 = npt.NDArray[np.float32]
Bools = npt.NDArray[np.bool_]

SHORTEST = 0.01
"""Metres in the world: edges that are shorter are not cut."""
RIM = 0.25
"""Marks of less of a stroke's largest weight are its rim, from which nothing spreads."""
MIXED = 0.02
"""What vertices stand for has more than one look if its mean is so far from the look of the vertex itself."""
LEAST_CLEAR = 0.2
"""If fewer vertices have one look, the picture is finer than the mesh, and means are all there is."""


@dataclass(frozen=True)
class Columns:
    """Parameters side by side, and how many numbers each has."""

    widths: Mapping[str, int]

    @staticmethod
    def of(field: Field, under: Paint | None) -> Columns:
        """Of all that change."""
        beneath = {} if under is None else {name: under.change(name).shape[1] for name in under.changes}
        return Columns({**beneath, **field.widths})

    def stack(self, changes: Mapping[str, F32], count: int) -> F32:
        """(P, C) of changes by parameter (P, own); 0 for those that are not there."""
        nothing = {name: np.zeros((count, width), np.float32) for name, width in self.widths.items()}
        parts = [np.broadcast_to(changes.get(name, none), none.shape) for name, none in nothing.items()]
        return np.concatenate(parts, axis=1)

    def split(self, values: F32) -> dict[str, F32]:
        """By parameter what `stack` put together."""
        ends = np.cumsum(list(self.widths.values()))[:-1]
        return dict(zip(self.widths, np.split(values, ends, axis=1), strict=True))

    def scale(self, values: F32) -> F32:
        """(C,) the largest change of each parameter."""
        most = {name: np.abs(part).max(initial=1e-12) for name, part in self.split(values).items()}
        return np.concatenate([np.full(width, most[name]) for name, width in self.widths.items()])


class Spread:
    """Makes paint of changes; keeps what looks of meshes that stay come to."""

    def __init__(self, services: Services) -> None:
        self._workers = services.workers
        self._looks, self._finer = LookTable(services), LookTable(services)
        self._pictures = PictureLooks(services.registry)

    def spots(self, scene: Scene, surfaces: Surfaces) -> Spots:
        """The vertices of the unrefined meshes."""
        base = surfaces.unrefined
        return Spots.of_mesh(base.mesh, self._looks(scene, base))

    def marks(self, scene: Scene, surfaces: Surfaces, stroke: Stroke) -> Spots:
        """Where a stroke lies: its marks that want a change, without the brush's faint rim.

        All of them where none does (something is to stay as it is).
        """
        vertices = self.spots(scene, surfaces)
        if stroke.marks is None or not len(stroke.marks):
            return vertices.some(np.zeros(0, np.int64))
        said = stroke.marks
        meant = (said.wanted != said.shown).any(axis=1)
        meant &= said.weight > RIM * said.weight.max(initial=0)
        some = said.some(meant) if meant.any() else said
        return Spots.of_marks(some, stroke.objects, surfaces.unrefined.mesh, vertices)

    def likeness(self, scene: Scene, surfaces: Surfaces, stroke: Stroke) -> F32:
        """(V,) how much each vertex of the unrefined meshes would change with a stroke."""
        vertices, marks = self.spots(scene, surfaces), self.marks(scene, surfaces, stroke)
        return likeness_of(vertices, marks, Reach.of(stroke), self._workers)

    def __call__(
        self, scene: Scene, surfaces: Surfaces, field: Field, under: Mapping[NodeId, Paint] | None = None
    ) -> dict[NodeId, Paint]:
        """The paint of all objects that the change reaches, added to what lies `under` it there.

        Objects of `under` that it does not reach keep theirs.
        """
        base, made = surfaces.unrefined, dict(under or {})
        vertices = self.spots(scene, surfaces)
        changed = np.zeros(len(base.mesh), np.bool_)
        for values in field.at(vertices, self._workers).values():
            changed |= (values != 0).any(axis=1)
        marked = {part // SLOTS for marks in field.marks for part in np.unique(marks.part).tolist()}
        for index, placed in enumerate(base.mesh.objects):
            node, own = scene.nodes.get(placed.node), base.mesh.vertices_of(index)
            if isinstance(node, MeshObject) and (index in marked or changed[own].any()):
                some = vertices.some(np.arange(own.start, own.stop))
                paint = self._on(scene, base, field, index, some, made.get(node.id))
                if paint is not None:
                    made[node.id] = paint
        return made

    def on_elements(self, scene: Scene, surfaces: Surfaces, field: Field) -> dict[NodeId, Paint]:
        """The paint of changes that vary from element to element, wherever these lie.

        Between its points paint is as elements are upsampled. What ends somewhere, or follows pictures, needs
        more points.
        """
        base = surfaces.unrefined
        if field.layers or any(reach != Reach() for one in field.varied for _, reach in one.strokes):
            return self(scene, surfaces, field)
        every = joined([one.elements for one in field.varied], self.spots(scene, surfaces))
        some = np.unique(np.column_stack([every.place, every.part]), axis=0, return_index=True)[1]
        spots = every.some(some)
        changes, made = field.at(spots, self._workers), dict[NodeId, Paint]()
        for index in np.unique(spots.part // SLOTS).tolist():
            placed, own = base.mesh.objects[index], spots.part // SLOTS == index
            node = scene[placed.node]
            assert isinstance(node, MeshObject)
            if any(self._pictures.pictures(scene, node)):
                return self(scene, surfaces, field)
            turn, scale, shift = frame_of(placed.transform, base.mesh.origin)
            place, normal = (spots.place[own] - shift) @ turn.T / scale, spots.normal[own] @ turn.T
            here = {name: values[own] for name, values in changes.items() if values[own].any()}
            if here:
                made[node.id] = Paint.of(place, normal, spots.part[own] % SLOTS, here)
        return made

    def _on(
        self, scene: Scene, base: Surfaces, field: Field, index: int, vertices: Spots, under: Paint | None
    ) -> Paint | None:
        """The paint of one object, whose unrefined `vertices` are given."""
        placed, columns = base.mesh.objects[index], Columns.of(field, under)
        node = scene[placed.node]
        assert isinstance(node, MeshObject)
        pictures = self._pictures.pictures(scene, node)

        follows = field.by_look or (under is not None and under.looks is not None)
        shown = pictures if follows else ()

        def wanted(mesh: ShadingMesh, there: Spots, first: int) -> F32:
            """From the vertex `first` on, whose spots are given."""
            made = columns.stack(field.at(there, self._workers), len(there))
            if under is None:
                return made
            looks = None if under.looks is None else self._pictures.of_mesh(pictures, mesh)
            new = mesh.positions[first:], mesh.normals[first:], mesh.slot[first:]
            weights = under.weights(*new, looks)
            return made + columns.stack(
                {name: weights(under.change(name)) for name in under.changes}, len(there)
            )

        seeds, told = self._seeds(field, columns, base, index, vertices, under)
        plain = wanted(placed.mesh, vertices, 0)
        scale = columns.scale(np.concatenate([plain, told]))
        spots = vertices

        def known(mesh: ShadingMesh, before: Known | None) -> Known:
            nonlocal spots
            if before is None:
                return Known(plain / scale, *self._looking(shown, mesh), vertices.look)
            if follows:
                alone = assemble(
                    [Placed(placed.node, mesh, placed.transform, placed.materials)], base.mesh.origin
                )
                spots = Spots.of_mesh(alone, self._finer(scene, dataclasses.replace(base, mesh=alone)), index)
                return Known(wanted(mesh, spots, 0) / scale, *self._looking(shown, mesh), spots.look)
            first = len(before.values)
            parents = mesh.parents[first:, 0].astype(np.int64)
            new = spots.moved(parents, base.mesh, index, mesh.positions[first:], mesh.normals[first:])
            spots = joined([spots, new], spots)
            values = np.concatenate([before.values, wanted(mesh, new, first) / scale])
            return Known(values, None, np.ones(len(mesh), np.bool_), spots.look)

        shortest = SHORTEST / placed.transform.scale
        mesh, here = finer(placed.mesh, known, (seeds, told / scale), shortest)
        points = sufficient(mesh, here)
        if not len(points):
            return None
        changes = columns.split(here.values[points] * scale)
        own = None if here.looks is None else here.looks[points]
        return Paint.of(mesh.positions[points], mesh.normals[points], mesh.slot[points], changes, own)

    def _looking(self, pictures: tuple[Texture | None, ...], mesh: ShadingMesh) -> tuple[F32 | None, Bools]:
        """The looks of pictures, and whether no edge of one runs through what a vertex stands for."""
        clear = np.ones(len(mesh), np.bool_)
        looks = self._pictures.of_mesh(pictures, mesh) if any(pictures) else None
        if looks is None or not looks_vary(looks):
            return None, clear
        itself = self._pictures.of_mesh(pictures, mesh, sharp=True)
        clear = np.abs(looks - itself).max(axis=1) < MIXED
        return looks, clear | bool(clear.mean() < LEAST_CLEAR)

    def _seeds(
        self,
        field: Field,
        columns: Columns,
        base: Surfaces,
        index: int,
        vertices: Spots,
        under: Paint | None,
    ) -> tuple[F32, F32]:
        """Places (N, 3) on an object where what is wanted (N, C) is known: marks, and points of old paint."""
        placed = base.mesh.objects[index]
        parts = [marks.some(marks.part // SLOTS == index) for marks in field.marks]
        if under is not None:
            slots = under.slots
            parts.append(on_object(vertices, base.mesh, index, under.places, under.normals, slots))
        there = joined(parts, vertices)
        made = columns.stack(field.at(there, self._workers), len(there))
        if under is not None:
            made[-len(under.places) :] += columns.stack(
                {name: under.change(name) for name in under.changes}, len(under.places)
            )
        turn, scale, shift = frame_of(placed.transform, base.mesh.origin)
        return np.asarray((there.place - shift) @ turn.T / scale, np.float32), made


__all__ = ["SHORTEST", "Columns", "Spread"]
