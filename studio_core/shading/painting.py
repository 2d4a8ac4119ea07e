"""What painted objects send differently: changes of BRDF coefficients, and of shapes' numbers, at vertices.

A pixel's coefficients are plain + slope · texel (`kernels.compose`); paint adds a third part that is known at
vertices and interpolated like light, so pictures keep their detail under it.
"""

from __future__ import annotations

import dataclasses
import operator
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from studio_core.contract import Registry
from studio_core.params import ParamInfo, param_infos
from studio_core.scene.between import Weights
from studio_core.scene.geometry import Texture
from studio_core.scene.nodes import Material, MaterialId, MeshObject, NodeId, Scene
from studio_core.scene.paint import Paint
from studio_core.scene.shading_mesh import ShadingMesh
from studio_core.scene.world_mesh import WorldMesh
from studio_core.shading.looks import PictureLooks
from studio_core.shading.materials import Resolved, linear_rgb, resolve, shape_paints

F32 = npt.NDArray[np.float32]
I32 = npt.NDArray[np.int32]
I64 = npt.NDArray[np.int64]
Changes = Mapping[str, F32]
"""By parameter, (P,) or (P, 3)."""


def painted(value: npt.ArrayLike, change: npt.ArrayLike, info: ParamInfo) -> npt.NDArray[Any]:
    """A parameter's value with paint on it, in its range."""
    plain, added = np.asarray(value, np.float64), np.asarray(change, np.float64)
    made = plain * np.exp(np.clip(added, -50, 50)) if info.scale == "log" else plain + added
    return np.clip(made, info.low, info.high)


@dataclass(frozen=True, eq=False)
class Coat:
    """Paint of one object as its shading vertices have it: weights of the points.

    `pictures` are those that the slots show, if the paint follows their looks.
    """

    paint: Paint
    mesh: ShadingMesh
    weights: Weights
    pictures: tuple[Texture | None, ...] = ()

    def changes(self, some: I64) -> Changes:
        """At some of the object's vertices."""
        share = self.weights.some(some)
        made = {name: share(self.paint.change(name)) for name in self.paint.changes}
        return {name: values[:, 0] if values.shape[1] == 1 else values for name, values in made.items()}


class Coats:
    """The coats of a scene's painted objects, kept while paint, mesh and pictures stay; moves change none."""

    def __init__(self, registry: Registry) -> None:
        self._held: dict[NodeId, Coat] = {}
        self._looks = PictureLooks(registry)

    def __call__(self, scene: Scene, mesh: WorldMesh) -> dict[int, Coat]:
        """By number of the object in the mesh."""
        made: dict[int, Coat] = {}
        held: dict[NodeId, Coat] = {}
        for number, placed in enumerate(mesh.objects):
            node = scene.nodes.get(placed.node)
            if not isinstance(node, MeshObject) or node.paint is None or not node.paint.changes:
                continue
            pictures = self._looks.pictures(scene, node) if node.paint.looks is not None else ()
            coat = self._held.get(placed.node)
            if coat is None or not _lies_on(coat, node.paint, placed.mesh, pictures):
                coat = self._coat(coat, node.paint, placed.mesh, pictures)
            elif coat.paint is not node.paint:
                coat = dataclasses.replace(coat, paint=node.paint)
            made[number] = held[placed.node] = coat
        self._held = held
        return made

    def _coat(
        self, before: Coat | None, paint: Paint, mesh: ShadingMesh, pictures: tuple[Texture | None, ...]
    ) -> Coat:
        if any(pictures):
            looks = self._looks.of_mesh(pictures, mesh)
            weights = paint.weights(mesh.positions, mesh.normals, mesh.slot, looks)
            return Coat(paint, mesh, weights, pictures)
        # Vertices that the mesh had before it was refined, or has still now that it no longer is.
        old = 0
        if before is not None and not any(before.pictures) and before.paint.points is paint.points:
            old = min(len(before.mesh), len(mesh))
            pairs = zip(_own(before.mesh), _own(mesh), strict=True)
            old = old if all(np.array_equal(a[:old], b[:old]) for a, b in pairs) else 0
        weights = paint.weights(*(array[old:] for array in _own(mesh)))
        if before is not None and old:
            kept = before.weights.some(np.arange(old))
            which = np.concatenate([kept.which, weights.which])
            weights = Weights(which, np.concatenate([kept.share, weights.share]))
        return Coat(paint, mesh, weights, pictures)


def _own(mesh: ShadingMesh) -> tuple[npt.NDArray[Any], ...]:
    return mesh.positions, mesh.normals, mesh.slot


def _lies_on(coat: Coat, paint: Paint, mesh: ShadingMesh, pictures: tuple[Texture | None, ...]) -> bool:
    same = coat.paint.points is paint.points and coat.paint.looks is paint.looks
    return same and coat.mesh is mesh and coat.pictures == pictures


class PaintTable:
    """Makes changes of coefficients, keeping those of objects whose paint and materials stay."""

    def __init__(self, registry: Registry) -> None:
        self._registry = registry
        self._coats = Coats(registry)
        self._held: dict[NodeId, tuple[tuple[object, ...], F32]] = {}
        self._nothing = np.zeros((0, 0), np.float32)
        self._made: tuple[tuple[object, ...], F32] = ((), self._nothing)

    def coats(self, scene: Scene, mesh: WorldMesh) -> Mapping[int, Coat]:
        """By number of the painted object in the mesh."""
        return self._coats(scene, mesh)

    def __call__(self, scene: Scene, materials: Sequence[MaterialId], mesh: WorldMesh, width: int) -> F32:
        """(V, width · 3) for vertices whose `material` counts in `materials`; (0, 0): nothing is painted.

        The same array while nothing changes.
        """
        coats = self._coats(scene, mesh)
        held: dict[NodeId, tuple[tuple[object, ...], F32]] = {}
        for number, coat in coats.items():
            node, own = mesh.objects[number].node, mesh.vertices_of(number)
            number_of = mesh.material[own]
            looks = tuple(scene.material(materials[m]) for m in np.unique(number_of[number_of >= 0]))
            key = (coat, width, *looks)
            known = self._held.get(node)
            if known is None or not _same(known[0], key):
                known = key, self._changes(scene, materials, coat, number_of, width)
            held[node] = known
        self._held = held
        if not coats:
            self._made = (), self._nothing
            return self._nothing
        key = (mesh.vertex_offsets, *(one[1] for one in held.values()))
        if not _same(self._made[0], key):
            made = np.zeros((len(mesh), width * 3), np.float32)
            for number in coats:
                made[mesh.vertices_of(number)] = held[mesh.objects[number].node][1]
            self._made = key, made
        return self._made[1]

    def _changes(
        self,
        scene: Scene,
        materials: Sequence[MaterialId],
        coat: Coat,
        number: I32,
        width: int,
    ) -> F32:
        made = np.zeros((len(number), width, 3), np.float32)
        for m in np.unique(number[number >= 0]).tolist():
            some = np.flatnonzero(number == m)
            changed = coefficient_changes(scene.material(materials[m]), self._registry, coat.changes(some))
            made[some, : changed.shape[1]] = changed
        return made.reshape(len(number), -1)


def coefficient_changes(material: Material, registry: Registry, changes: Changes) -> F32:
    """(P, T, 3) what paint adds to the coefficients of a material, from changes at P places."""
    resolved = resolve(material, registry)
    plain = _means(resolved)
    infos = param_infos(resolved.brdf.Params)
    known = {name: change for name, change in changes.items() if name in plain and name in infos}
    count = len(next(iter(changes.values())))
    if not known:
        return np.zeros((count, resolved.brdf.terms, 3), np.float32)
    before = {name: np.broadcast_to(value, (count, *value.shape)) for name, value in plain.items()}
    after = dict(before)
    for name, change in known.items():
        wide = change[:, None] if plain[name].ndim and change.ndim == 1 else change
        after[name] = painted(before[name], wide, infos[name]).astype(np.float32)
    made = resolved.brdf.coefficients(after) - resolved.brdf.coefficients(before)
    return np.asarray(made, np.float32)


def shape_changes(resolved: Resolved, changes: Changes) -> Changes:
    """Those of numbers that every vertex may have of its own."""
    return {name: changes[name] for name in shape_paints(resolved.brdf) if name in changes}


def _means(resolved: Resolved) -> dict[str, F32]:
    """Numbers and colours of a material, with the means of its pictures."""
    made = {}
    for name, value in resolved.values.items():
        if isinstance(value, str | bool):
            continue
        number = np.asarray(value, np.float32)
        if name in resolved.textures:
            mean = linear_rgb(resolved.textures[name].image).mean(axis=(0, 1), dtype=np.float64)
            number = number * np.asarray(mean[0] if number.ndim == 0 else mean, np.float32)
        made[name] = number
    return made


def _same(one: tuple[object, ...], other: tuple[object, ...]) -> bool:
    return len(one) == len(other) and all(map(operator.is_, one, other))


__all__ = ["Changes", "Coats", "PaintTable", "coefficient_changes", "painted", "shape_changes"]
