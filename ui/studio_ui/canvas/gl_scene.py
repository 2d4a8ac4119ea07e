"""A picture's surfaces on the GPU: shapes by shading mesh, colours by object, batches of faces."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt
from vispy import gloo

from studio_core.kernels.compose import AFFINE, CAUGHT, CONSTANT, GENERAL
from studio_core.kernels.relief import BEND
from studio_core.scene.nodes import NodeId
from studio_core.scene.shading_mesh import NO_BACK, ShadingMesh
from studio_core.scene.transform import IDENTITY, Transform
from studio_core.shading.artifacts import TERMS, Picture, Surfaces
from studio_core.shading.coefficients import Maps
from studio_core.shading.reliefs import Reliefs
from studio_ui.canvas.gl_buffers import GROWTH, Attribute, Tally
from studio_ui.canvas.gl_maps import Atlas, Atlases

F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]
U32 = npt.NDArray[np.uint32]
NO_LIGHT, OPEN = np.zeros(3, np.float32), np.ones(3, np.float32)
KEPT = 3
"""Lists of faces that a shape keeps: refined meshes and unrefined ones take turns."""


@dataclass(frozen=True, eq=False)
class Batch:
    """Faces that are drawn with one call; `culled`: seen where they are counter-clockwise alone."""

    indices: Any
    culled: bool
    kind: int
    opacity: float
    atlas: Atlas | None
    uv_map: tuple[float, ...]
    relief: Atlas | None = None
    relief_map: tuple[float, ...] = ()


@dataclass(eq=False)
class Shape:
    """Where the vertices of a shading mesh are, in its own frame; instances share it."""

    mesh: ShadingMesh
    positions: Attribute
    uvs: Attribute
    centre: F64 = field(default_factory=lambda: np.zeros(3))
    radius: float = 0.0
    lists: dict[tuple[object, ...], tuple[ShadingMesh, tuple[Batch, ...]]] = field(default_factory=dict)

    def delete(self) -> None:
        """Give everything back."""
        self.positions.delete()
        self.uvs.delete()
        self.forget()

    def forget(self, keep: int = 0) -> None:
        """Give the oldest lists of faces back."""
        while len(self.lists) > keep:
            for batch in self.lists.pop(next(iter(self.lists)))[1]:
                batch.indices.delete()


@dataclass(eq=False)
class Body:
    """An object of the picture."""

    shape: Shape
    plain: Attribute
    slope: Attribute
    sums: tuple[Attribute, ...]
    bends: tuple[Attribute, ...]
    pictured: Transform = IDENTITY
    transform: Transform = IDENTITY  # where it is drawn
    shown: bool = True
    batches: tuple[Batch, ...] = ()

    def colours(self) -> tuple[Attribute, ...]:
        """What depends on light."""
        return (self.plain, self.slope, *self.sums, *self.bends)


_Look = tuple[int, Atlas | None, tuple[float, ...], float, Atlas | None, tuple[float, ...]]
"""Kind, atlas, its scale and offset, opacity, and the same of the normal map as of the atlas."""
Places = Mapping[NodeId, Transform | None]
"""Where objects are in the world; None: not shown."""


class GlScene:
    """Follows pictures: what is the same in the next one stays where it is."""

    def __init__(self, tally: Tally, largest_texture: int) -> None:
        self.tally = tally
        self.bodies: list[Body] = []
        self.nodes: tuple[NodeId, ...] = ()
        self.atlases = Atlases(tally, largest_texture)
        self._shapes: dict[int, Shape] = {}  # by identity of the mesh, which the shape holds
        self._picture: Picture | None = None
        self._typical = np.zeros(3, np.float32)

    @property
    def layered(self) -> bool:
        """Whether anything is looked through."""
        return any(batch.opacity < 1 for body in self.bodies for batch in body.batches)

    def draws(self, clear: bool) -> Iterator[tuple[int, Body, Batch]]:
        """The batches that are, or are not, looked through, with the number of their object."""
        for index, body in enumerate(self.bodies):
            for batch in body.batches if body.shown else ():
                if (batch.opacity < 1) == clear:
                    yield index, body, batch

    def show(self, picture: Picture) -> None:
        """Upload what this picture has and the last one had not."""
        if picture is self._picture or picture.colours is None:
            return
        mesh, colours = picture.radiance.surfaces.mesh, picture.colours
        self.atlases.update(colours.maps, colours.reliefs)
        self._typical = _typical(picture)
        wanted = {id(placed.mesh) for placed in mesh.objects}
        old = dict(zip(self.nodes, self.bodies, strict=True))
        bodies = []
        for index, placed in enumerate(mesh.objects):
            before = old.pop(placed.node, None)
            shape = self._shape(placed.mesh, before, wanted)
            batches = self._batches(shape, picture, index)
            body = before or Body(shape, *self._attributes())
            body.shape, body.batches = shape, batches
            body.pictured = body.transform = placed.transform
            body.shown = True
            self._colour(body, picture, index)
            bodies.append(body)
        for body in old.values():
            _delete(body)
        self.bodies, self.nodes = bodies, tuple(placed.node for placed in mesh.objects)
        for key in [key for key in self._shapes if key not in wanted]:
            self._shapes.pop(key).delete()
        self._picture = picture

    def place(self, places: Places) -> None:
        """Objects where they are by now; those that are not named stay where the picture has them."""
        for node, body in zip(self.nodes, self.bodies, strict=True):
            place = places.get(node, body.pictured)
            body.shown, body.transform = place is not None, place or body.pictured

    def clear(self) -> None:
        """Give everything back."""
        for body in self.bodies:
            _delete(body)
        for shape in self._shapes.values():
            shape.delete()
        self.atlases.clear()
        self.bodies, self.nodes, self._shapes, self._picture = [], (), {}, None

    def _attributes(self) -> tuple[Attribute, Attribute, tuple[Attribute, ...], tuple[Attribute, ...]]:
        count = 2 + TERMS + BEND // 3
        plain, slope, *more = (Attribute(3, self.tally, "colours") for _ in range(count))
        return plain, slope, tuple(more[:TERMS]), tuple(more[TERMS:])

    def _shape(self, mesh: ShadingMesh, before: Body | None, wanted: set[int]) -> Shape:
        """The shape of a mesh; a finer or coarser one of the same object takes over what begins alike."""
        key = id(mesh)
        found = self._shapes.get(key)
        if found is not None:
            return found
        if before is not None and id(before.shape.mesh) not in wanted:
            found = self._shapes.pop(id(before.shape.mesh), None)
        if found is None:
            positions, uvs = (Attribute(width, self.tally, "shapes") for width in (3, 2))
            found = Shape(mesh, positions, uvs)
        found.mesh = mesh
        room = found.positions.room
        if len(mesh) > room:
            room = int(GROWTH * len(mesh)) if room else len(mesh)
        uvs = np.zeros((len(mesh), 2), np.float32) if mesh.uvs is None else mesh.uvs
        for attribute, values in ((found.positions, mesh.positions), (found.uvs, uvs)):
            attribute.resize(room)
            attribute.replace_tail(values)
        if len(mesh):
            low, high = mesh.positions.min(axis=0), mesh.positions.max(axis=0)
            found.centre = (low.astype(np.float64) + high) / 2
            found.radius = float(np.linalg.norm(high - low)) / 2
        self._shapes[key] = found
        return found

    def _batches(self, shape: Shape, picture: Picture, index: int) -> tuple[Batch, ...]:
        surfaces, colours = picture.radiance.surfaces, picture.colours
        assert colours is not None
        mesh, maps = shape.mesh, colours.maps
        materials = surfaces.mesh.face_material[surfaces.mesh.faces_of(index)]
        used = np.unique(materials).tolist()
        looks = {m: self._look(maps, colours.reliefs, surfaces, m) for m in used}
        key = (id(mesh), *((m, looks[m]) for m in used))
        if key in shape.lists:
            shape.lists[key] = found = shape.lists.pop(key)  # the newest is last
            return found[1]
        shape.forget(KEPT - 1)
        made: list[Batch] = []
        for look in dict.fromkeys(looks.values()):
            kind, atlas, uv_map, opacity, *relief = look
            chosen = np.isin(materials, [m for m in used if looks[m] == look])
            sided = mesh.back_faces[:, 0] != NO_BACK
            single = mesh.faces[chosen & ~sided]
            double = np.concatenate([mesh.faces[chosen & sided], mesh.back_faces[chosen & sided][:, ::-1]])
            for faces, culled in ((double, True), (single, False)):
                if len(faces):
                    made.append(Batch(self._indices(faces), culled, kind, opacity, atlas, uv_map, *relief))
        shape.lists[key] = mesh, tuple(made)  # holds the mesh, so that the key stays its own
        return tuple(made)

    def _look(self, maps: Maps, reliefs: Reliefs | None, surfaces: Surfaces, material: int) -> _Look:
        if material < 0:
            return CONSTANT, None, (), 1.0, None, ()
        own, alpha = int(maps.kind[material]), float(surfaces.opacity[material])
        if surfaces.catches[material]:
            return CAUGHT, None, (), alpha, None, ()
        fine, laid = self.atlases.relief(material), ()
        if fine is not None and reliefs is not None:
            laid = tuple(reliefs.laid[material].tolist())
        if own == CONSTANT:
            return own, None, (), alpha, fine, laid
        return own, self.atlases[material], tuple(maps.uv_map[material].tolist()), alpha, fine, laid

    def _indices(self, faces: U32) -> Any:
        flat = np.ascontiguousarray(faces, np.uint32).reshape(-1)
        self.tally.shapes += flat.nbytes
        self.tally.uploads += 1
        return gloo.IndexBuffer(flat)

    def _colour(self, body: Body, picture: Picture, index: int) -> None:
        colours = picture.colours
        assert colours is not None
        own = picture.radiance.surfaces.mesh.vertices_of(index)
        kinds = {batch.kind for batch in body.batches}
        record, sums = colours.record[own], colours.sums[own]
        wanted = [(body.plain, record[:, 0:3])]
        if kinds & {AFFINE, CAUGHT}:
            wanted.append((body.slope, record[:, 3:6]))
        if GENERAL in kinds:
            wanted += [(body.sums[k], sums[:, 3 * k : 3 * k + 3]) for k in range(sums.shape[1] // 3)]
        if colours.bend is not None and any(batch.relief for batch in body.batches):
            bend = colours.bend[own]
            parts = 6 if AFFINE in kinds else 4 if GENERAL in kinds else 3
            wanted += [(body.bends[k], bend[:, 3 * k : 3 * k + 3]) for k in range(parts)]
        known, shown = picture.radiance.valid[own], colours.shown[own]
        if not shown.all():  # what is turned away is black; who turns the view wants to see something better
            lit = shown.copy()
            for column in (column for _, values in wanted for column in values.T):
                lit |= column != 0
            known = known & lit
        typical = {body.plain: self._typical}
        if CAUGHT in kinds:
            typical = {body.plain: NO_LIGHT, body.slope: OPEN}
        for attribute, values in wanted:
            attribute.resize(body.shape.positions.room)
            attribute.update(values, known, typical.get(attribute))


def _delete(body: Body) -> None:
    for attribute in body.colours():
        attribute.delete()


def _typical(picture: Picture) -> F32:
    """A colour for objects of which nothing is known: the mean of some that are shown."""
    colours = picture.colours
    assert colours is not None
    some = np.flatnonzero(colours.shown & picture.radiance.valid)[::64]
    return colours.record[some, :3].mean(axis=0) if len(some) else np.zeros(3, np.float32)
