"""Shapes that vary over a surface: a picture of the roughness gives every shading vertex a row of its own.

Kernels look up a vertex' shape by a row of `Shapes`. A material with a picture of a shape parameter gets,
beside the row of its mean, one for every value that its vertices have: the picture is averaged over the part
of the surface that belongs to the vertex (mip levels, as sharp as the mesh is fine) and rounded to steps of
1/255, or of a half, a quarter, … of that while no more than 255 of them lead from its darkest to its
brightest texel. So a value is wrong by less than 1/255 of the picture's range, and texels of eight bits from
black to white are not rounded at all. Several pictures of a material share at most MOST rows, with longer
steps where need be. Numbers that strokes changed on an object (`scene.paint`) vary in the same way.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from studio_core.contract import Registry
from studio_core.params import Value, param_infos
from studio_core.scene.geometry import Image, Texture
from studio_core.scene.nodes import MaterialId, Scene
from studio_core.scene.world_mesh import WorldMesh
from studio_core.shading.artifacts import Shapes
from studio_core.shading.materials import Resolved, finite_shapes, first_channel, resolve, scalar, shapes
from studio_core.shading.normal_maps import mean_slope
from studio_core.shading.painting import Changes, Coat, Coats, painted, shape_changes
from studio_core.shading.texels import picture_areas, trilinear

F32 = npt.NDArray[np.float32]
I32 = npt.NDArray[np.int32]
I64 = npt.NDArray[np.int64]

MOST = 1024
LEAST_RANGE = 2.0**-12


@dataclass(frozen=True, eq=False)
class Grey:
    """A picture's first channel, linear, rows from v = 0 up, halved level by level down to one texel."""

    levels: tuple[F32, ...]

    @classmethod
    def of(cls, image: Image) -> Grey:
        """Of a picture."""
        level = np.ascontiguousarray(first_channel(image)[::-1])
        levels = [level]
        while max(level.shape) > 1:
            level = _halved(_halved(level).T).T
            levels.append(np.ascontiguousarray(level))
        return cls(tuple(levels))

    @cached_property
    def mean(self) -> float:
        """Of all texels."""
        return float(self.levels[0].mean(dtype=np.float64))

    @cached_property
    def range(self) -> tuple[float, float]:
        """The darkest and the brightest texel."""
        return float(self.levels[0].min()), float(self.levels[0].max())

    def at(self, uvs: F32, area: F32) -> F32:
        """(P,) means over squares about uvs (P, 2) that cover `area` (P,) of the picture, which repeats."""
        return trilinear(self.levels, uvs, area)


def _halved(level: F32) -> F32:
    """Means of two rows each; a single row stays, and a last odd one is left out."""
    if len(level) == 1:
        return level
    even = level[: len(level) // 2 * 2]
    return np.asarray(np.float32(0.5) * (even[::2] + even[1::2]))


@dataclass(frozen=True, eq=False)
class Steps:
    """texels (R, K) that points have, and of each point (P,) which of them.

    First are those of the pictures of a material's shape, then what strokes changed of its parameters
    `painted`.
    """

    texels: npt.NDArray[np.float64]
    which: I64
    painted: tuple[str, ...] = ()

    def values(self, resolved: Resolved, row: int) -> Mapping[str, Value]:
        """A material's values with one of the rows."""
        count = len(resolved.shaping)
        made = dict(resolved.scaled(self.texels[row, :count].tolist()))
        infos = param_infos(resolved.brdf.Params)
        for name, change in zip(self.painted, self.texels[row, count:].tolist(), strict=True):
            made[name] = float(painted(scalar(made[name]), change, infos[name]))
        return made


@dataclass(frozen=True, eq=False)
class _Coated:
    """What strokes changed of a material's shape at its vertices `own` (P,): by parameter (P, K)."""

    names: tuple[str, ...]
    changes: F32
    coats: tuple[Coat, ...]
    own: I64

    def at(self, corners: I64, shares: F32) -> _Coated:
        """At points between such vertices (Q, K), of which each counts so much (Q, K)."""
        changes = self.changes[np.searchsorted(self.own, corners)]
        return dataclasses.replace(self, changes=np.einsum("qk,qkc->qc", shares, changes))


@dataclass(frozen=True, eq=False)
class Between:
    """P points between vertices of a mesh: numbers (P, K), each of one object, and shares (P, K) of 1."""

    mesh: WorldMesh
    corners: I64
    shares: F32


NO_VERTICES = np.zeros(0, np.int64)
UNPAINTED = _Coated((), np.zeros((0, 0), np.float32), (), NO_VERTICES)


class ShapeTable:
    """Makes `Shapes` with rows for what varies, keeping pictures and rows that did not change."""

    def __init__(self, registry: Registry) -> None:
        self._registry = registry
        self._pictures: dict[str, Grey] = {}
        self._slopes: dict[str, float] = {}
        self._uvs: F32 | None = None
        self._areas: F32 = np.zeros(0, np.float32)
        self._coats = Coats(registry)
        self._kept: dict[MaterialId, tuple[Mapping[str, Texture], I64, tuple[Coat, ...], Steps]] = {}

    def __call__(self, scene: Scene, materials: Sequence[MaterialId], mesh: WorldMesh) -> Shapes:
        """For the vertices of a mesh whose `material` counts in `materials`."""
        base, varying = self._begun(scene, materials)
        coated = self._coated(scene, materials, mesh)
        varying |= {m: resolve(scene.material(materials[m]), self._registry) for m in coated}
        if not varying:
            self._uvs, self._kept = None, {}
            return base
        if self._uvs is not mesh.uvs:  # moved objects share it, refined ones do not
            self._uvs, self._areas, self._kept = mesh.uvs, picture_areas(mesh), {}
        found = []
        kept = {}
        for number, resolved in varying.items():
            name, own = materials[number], np.flatnonzero(mesh.material == number)
            coat = coated.get(number, UNPAINTED)
            textures, before, coats, steps = self._kept.get(name, ({}, own, (), None))
            same = textures == resolved.shaping and coats == coat.coats and np.array_equal(before, own)
            if steps is None or not same:
                steps = self._steps(resolved, mesh.uvs[own], self._areas[own], coat)
            kept[name] = (resolved.shaping, own, coat.coats, steps)
            found.append((number, resolved, own, steps))
        self._kept = kept
        return _extended(base, mesh.material, found)

    def at(
        self,
        scene: Scene,
        materials: Sequence[MaterialId],
        material: I32,
        uvs: F32,
        between: Between | None = None,
    ) -> Shapes:
        """For points of our own, material (P,) and uvs (P, 2), at which pictures are not averaged.

        Paint is what vertices that they lie `between` have of it.
        """
        base, varying = self._begun(scene, materials)
        coated = {} if between is None else self._coated(scene, materials, between.mesh)
        varying |= {m: resolve(scene.material(materials[m]), self._registry) for m in coated}
        found = []
        for number, resolved in varying.items():
            own = np.flatnonzero(material == number)
            nothing = np.zeros(len(own), np.float32)
            coat = UNPAINTED
            if between is not None and number in coated:
                coat = coated[number].at(between.corners[own], between.shares[own])
            found.append((number, resolved, own, self._steps(resolved, uvs[own], nothing, coat)))
        return _extended(base, material, found) if found else base

    def _begun(self, scene: Scene, materials: Sequence[MaterialId]) -> tuple[Shapes, dict[int, Resolved]]:
        """The rows of materials, and those materials that vary, by number; other pictures are forgotten."""
        found = {}
        for number, name in enumerate(materials):
            material = scene.material(name)
            if material.textures and (resolved := resolve(material, self._registry)).shaping:
                found[number] = resolved
        used = {t.image.key: t.image for resolved in found.values() for t in resolved.shaping.values()}
        self._pictures = {key: self._pictures.get(key) or Grey.of(image) for key, image in used.items()}
        slopes, self._slopes = self._slopes, {}

        def steep(image: Image) -> float:
            if image.key not in self._slopes:
                known = slopes.get(image.key)
                self._slopes[image.key] = mean_slope(image) if known is None else known
            return self._slopes[image.key]

        base = shapes(scene, materials, self._registry, lambda image: self._pictures[image.key].mean, steep)
        return base, found

    def _coated(self, scene: Scene, materials: Sequence[MaterialId], mesh: WorldMesh) -> dict[int, _Coated]:
        """Materials, by number, of which strokes changed the shape somewhere."""
        parts: dict[int, list[tuple[Coat, I64, Changes]]] = {}
        for index, coat in self._coats(scene, mesh).items():
            start, number = mesh.vertex_offsets[index], mesh.material[mesh.vertices_of(index)]
            for m in np.unique(number[number >= 0]).tolist():
                some = np.flatnonzero(number == m)
                resolved = resolve(scene.material(materials[m]), self._registry)
                changes = shape_changes(resolved, coat.changes(some))
                if changes:
                    parts.setdefault(m, []).append((coat, some + start, changes))
        made = {}
        for m, coats in parts.items():
            own = np.flatnonzero(mesh.material == m)
            names = tuple(dict.fromkeys(name for _, _, changes in coats for name in changes))
            changed = np.zeros((len(own), len(names)), np.float32)
            for _, vertices, changes in coats:
                rows = np.searchsorted(own, vertices)
                for column, name in enumerate(names):
                    if name in changes:
                        changed[rows, column] = changes[name]
            made[m] = _Coated(names, changed, tuple(coat for coat, _, _ in coats), own)
        return made

    def _steps(self, resolved: Resolved, uvs: F32, area: F32, coat: _Coated) -> Steps:
        """What the pictures of a material, and strokes, come to at some points."""
        values, ranges = [], []
        for texture in resolved.shaping.values():
            grey = self._pictures[texture.image.key]
            values.append(grey.at(texture.placed(uvs), area * np.float32(texture.area)))
            ranges.append(grey.range)
        for column in coat.changes.T if coat.names else ():
            values.append(column)
            ranges.append((float(column.min(initial=0)), float(column.max(initial=0))))
        made = stepped(np.stack(values, axis=1), ranges)
        return dataclasses.replace(made, painted=coat.names)


def stepped(values: F32, ranges: Sequence[tuple[float, float]]) -> Steps:
    """Values (P, K), each of a picture with a range, rounded to whole steps so that there are few rows."""
    step = np.array([step_of(low, high) for low, high in ranges])
    while True:
        rounded = np.rint(values / step).astype(np.int64)
        keys = rounded[:, 0] if len(step) == 1 else rounded  # of rows it takes ten times as long
        _, first, which = np.unique(keys, axis=0, return_index=True, return_inverse=True)
        if len(first) <= MOST:
            return Steps(rounded[first] * step, which.reshape(-1))
        step *= 2


def step_of(low: float, high: float) -> float:
    """The step of a picture's values: 1/255 times a power of two, at most 255 of them from low to high."""
    return float(2.0 ** math.ceil(math.log2(max(high - low, LEAST_RANGE))) / 255)


def _extended(base: Shapes, material: I32, found: Sequence[tuple[int, Resolved, I64, Steps]]) -> Shapes:
    """The table with rows for what varies; `row` says which a point has."""
    row = material.copy()
    owner = [np.arange(len(base.address))]
    offset, data = base.offset.tolist(), [base.data[:-1]]
    length = len(base.data) - 1
    for number, resolved, own, steps in found:
        row[own] = len(offset) + steps.which
        rows = [steps.values(resolved, step) for step in range(len(steps.texels))]
        for shape in finite_shapes(resolved.brdf, rows):
            offset.append(length)
            data.append(shape)
            length += len(shape)
        owner.append(np.full(len(steps.texels), number))
    of = np.concatenate(owner).astype(np.int64)
    flat = np.concatenate([*data, np.zeros(1, np.float32)])
    return dataclasses.replace(
        base,
        address=base.address[of],
        terms=base.terms[of],
        offset=np.array(offset, np.int64),
        data=flat,
        owner=of,
        row=row,
        tilt=None if base.tilt is None else base.tilt[of],
    )


__all__ = ["MOST", "Between", "Grey", "ShapeTable", "Steps", "step_of", "stepped"]
