"""What strokes in indirect mode ask for: rows of wanted changes, and rows that are to stay as they are.

Light that comes by way of other surfaces is known at vertices and interpolated between them, so what marks
say is put together at the nearest vertex that faces their way: a row for each vertex and eye. Fixates are
rows that want no change. All rows count by how much of its own light each of them would change, as in
`samples`.
"""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from studio_core.scene.nodes import NodeId
from studio_core.scene.world_mesh import WorldMesh
from studio_core.shading.artifacts import Surfaces
from studio_core.strokes.marks import Marks
from studio_core.strokes.stroke import FIXATE, Stroke

F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]
I64 = npt.NDArray[np.int64]
Bools = npt.NDArray[np.bool_]

MOST = 256
"""Rows of one stroke: of more, some stand for their neighbours."""
DARK = 1.0
"""Of the mean light, beside a row's own, to which its change is relative: what arrives changes everywhere."""
POOLS = 48
"""Means of neighbouring rows that are told apart in a stroke."""
BESIDE, FAINT = 0.6, 0.1
"""How far about a flat stroke its neighbours count, of its size, and how much."""
NEAR = 8  # vertices among which a mark looks for one that faces its way
FACING = 0.3
LIGHT = 1e30
"""More is none: tables of marks have large numbers where there are none."""
NOBODY = np.zeros(0, np.int64)


@dataclass(frozen=True, eq=False)
class Rows:
    """P rows: vertex (P,) of the unrefined meshes, eye (P, 3) relative to their origin, stroke (P,).

    change (P, 3) is wanted of the radiance towards the eye, all 0 where `fixed` (P,); light (P, 3) the larger
    of what is there and what is wanted; weight (P,) of the brush and the stroke, each stroke's rows 1 in all.
    """

    vertex: I64
    eye: F64
    change: F64
    light: F64
    weight: F64
    stroke: I64
    fixed: Bools

    def __len__(self) -> int:
        return len(self.vertex)

    def some(self, which: npt.NDArray[np.generic]) -> Rows:
        """These of them."""
        return Rows(*(getattr(self, field.name)[which] for field in dataclasses.fields(self)))

    def joined(self, other: Rows) -> Rows:
        """Both."""
        names = [field.name for field in dataclasses.fields(Rows)]
        return Rows(*(np.concatenate([getattr(self, name), getattr(other, name)]) for name in names))

    @property
    def importance(self) -> F64:
        """(P, 3) weights of squared differences: Σ importance · change² is 1.

        Relative to each row's own light and the mean: dark rows count more, but not alone.
        """
        floor = DARK * self.light.mean() if self.light.size else 0.0
        made = self.weight[:, None] / np.maximum(self.light + floor, 1e-30) ** 2
        wanted = float((made * self.change**2).sum())
        return np.asarray(made / wanted if wanted > 0 else made * 0)

    def pooled(self, positions: F32) -> tuple[Rows, F64]:
        """Means of neighbours, at most POOLS of each stroke's, and shares (K, P) of the rows in them.

        Rays leave columns noisy row by row, and marks are no less so: means of both are less, without bias.
        """
        places = positions[self.vertex].astype(np.float64)
        pool = np.zeros(len(self), np.int64)
        for number in np.unique(self.stroke).tolist():
            own = np.flatnonzero(self.stroke == number)
            eyes = np.unique(self.eye[own], axis=0, return_inverse=True)[1].reshape(-1)
            apart = 10 * max(float(np.ptp(places[own], axis=0).max()), 1e-9)
            points = np.concatenate([places[own], apart * eyes[:, None]], axis=1)
            pool[own] = pool.max(initial=-1) + 1 + nearest_chosen(points, POOLS)
        pool = np.unique(pool, return_inverse=True)[1].reshape(-1)
        weight = np.asarray(np.bincount(pool, self.weight), np.float64)
        share = np.zeros((len(weight), len(self)))
        share[pool, np.arange(len(self))] = self.weight / np.maximum(weight, 1e-30)[pool]
        first = np.unique(pool, return_index=True)[1]
        made = dataclasses.replace(
            self.some(first), change=share @ self.change, light=share @ self.light, weight=weight
        )
        return made, share


def nearest_chosen(points: F64, count: int) -> I64:
    """(N,) of points (N, D): the nearest of at most `count` that are chosen, each the farthest from those
    before.
    """
    distance, nearest = np.full(len(points), np.inf), np.zeros(len(points), np.int64)
    chosen = 0
    for number in range(min(count, len(points))):
        away = ((points - points[chosen]) ** 2).sum(axis=1)
        nearest = np.where(away < distance, number, nearest)
        distance = np.minimum(distance, away)
        chosen = int(np.argmax(distance))
        if distance[chosen] <= 0:
            break
    return nearest


def rows_of(
    strokes: Sequence[Stroke],
    surfaces: Surfaces,
    covered: I64 = NOBODY,
    now: Mapping[NodeId, F64] | None = None,
) -> Rows:
    """Rows of all strokes; `now` (N, 3) is what is modelled at the marks of a stroke at present, by stroke.

    A stroke with offsets that is not among these wants what it wanted when it was painted. `covered` are
    vertices that something stands on: they see nothing, and stand for no mark.
    """
    free = np.ones(len(surfaces.mesh), np.bool_)
    free[covered] = False
    parts = [
        _rows(number, stroke, surfaces, free, None if now is None else now.get(stroke.id))
        for number, stroke in enumerate(strokes)
        if stroke.marks is not None
    ]
    if not parts:
        none, nowhere = np.zeros(0), np.zeros((0, 3))
        numbers = np.zeros(0, np.int64)
        return Rows(numbers, nowhere, nowhere, nowhere, none, numbers, np.zeros(0, np.bool_))
    return functools.reduce(Rows.joined, parts)


def _rows(number: int, stroke: Stroke, surfaces: Surfaces, free: Bools, now: F64 | None) -> Rows:
    marks = stroke.marks
    assert marks is not None
    wanted = marks.wanted.astype(np.float64)
    if now is not None:
        wanted, shown = wanted - np.nan_to_num(marks.offset), np.asarray(now, np.float64)
    else:
        shown = marks.shown.astype(np.float64)
    fixed = stroke.tool == FIXATE
    change = np.zeros_like(shown) if fixed else wanted - shown
    light = np.maximum(shown, 0) if fixed else np.maximum(np.maximum(shown, wanted), 0)
    vertex = nearest_vertices(marks, stroke.objects, surfaces, free)
    numbers = (np.abs(change) < LIGHT).all(axis=1) & (light < LIGHT).all(axis=1) & np.isfinite(marks.weight)
    good = np.flatnonzero((vertex >= 0) & numbers & (marks.weight > 0))
    eyes, eye = np.unique(marks.eye[good], axis=0, return_inverse=True)
    pairs, row = np.unique(np.stack([vertex[good], eye.reshape(-1)], axis=1), axis=0, return_inverse=True)
    row = _thinned(surfaces.mesh.positions, pairs, row.reshape(-1))
    kept, row = np.unique(row, return_inverse=True)
    pairs, count = pairs[kept], len(kept)
    weight = np.asarray(np.bincount(row, marks.weight[good], count), np.float64)

    def mean(values: F64) -> F64:
        sums = [np.bincount(row, marks.weight[good] * values[good, c], count) for c in range(3)]
        return np.asarray(np.stack(sums, axis=1) / np.maximum(weight, 1e-30)[:, None])

    changed, lit = mean(change), mean(light)
    if stroke.flat and not fixed and count:
        changed[:] = weight @ changed / weight.sum()
    share = np.asarray(weight * (stroke.weight / max(float(weight.sum()), 1e-30)), np.float64)
    eye_of = eyes[pairs[:, 1]].astype(np.float64) - surfaces.mesh.origin
    made = Rows(pairs[:, 0], eye_of, changed, lit, share, np.full(count, number), np.full(count, fixed))
    return made if fixed or not stroke.flat or not count else _with_neighbours(made, surfaces.mesh, free)


def _with_neighbours(rows: Rows, mesh: WorldMesh, free: Bools) -> Rows:
    """A flat stroke tells nothing by its shape, but by where it ends: what is beside it hardly changes."""
    first = rows.vertex[0]
    placed = mesh.objects[int(mesh.object[first])].mesh
    own = np.arange(len(mesh))[mesh.vertices_of(int(mesh.object[first]))]
    start = int(own[0])
    alike = placed.slot == placed.slot[first - start]
    alike &= free[own] & ~np.isin(own, rows.vertex)
    alike &= ((rows.eye[0] - mesh.positions[own]) * mesh.normals[own]).sum(axis=1) > 0
    others = own[alike]
    places = mesh.positions[rows.vertex]
    reach = BESIDE * float(np.linalg.norm(np.ptp(places, axis=0)))
    if not len(others):
        return rows
    distance, nearest = cKDTree(places).query(mesh.positions[others], distance_upper_bound=max(reach, 1e-9))
    some = np.flatnonzero(np.isfinite(distance))
    some = some[np.argsort(distance[some], kind="stable")[: len(rows)]]
    beside = rows.some(nearest[some])
    return rows.joined(
        dataclasses.replace(
            beside, vertex=others[some], change=np.zeros_like(beside.change), weight=FAINT * beside.weight
        )
    )


def _thinned(positions: F32, pairs: I64, row: I64) -> I64:
    """Row numbers of marks, at most MOST of them different: others go to the nearest of the same eye."""
    if len(pairs) <= MOST:
        return row
    rng = np.random.default_rng(0)
    chosen = np.sort(rng.permutation(len(pairs))[:MOST])
    where = np.concatenate([positions[pairs[:, 0]], 1e6 * pairs[:, 1:]], axis=1)
    nearest = cKDTree(where[chosen]).query(where)[1]
    return np.asarray(chosen[nearest][row])


def nearest_vertices(marks: Marks, objects: Sequence[NodeId], surfaces: Surfaces, free: Bools) -> I64:
    """(N,) the vertex of the unrefined meshes, of those free (V,), that stands for each mark; −1: none."""
    found = np.full(len(marks), -1, np.int64)
    mesh = surfaces.mesh
    numbers = {placed.node: number for number, placed in enumerate(mesh.objects)}
    for index, node in enumerate(objects):
        own = np.flatnonzero(marks.object == index)
        if node not in numbers or not len(own):
            continue
        number = numbers[node]
        shape = mesh.objects[number].mesh
        near = min(NEAR, len(shape.positions))
        distance, vertex = cKDTree(shape.positions).query(marks.place[own], k=near)
        distance, vertex = distance.reshape(len(own), near), vertex.reshape(len(own), near)
        alike = np.einsum("nkc,nc->nk", shape.normals[vertex], marks.normal[own])
        fits = (alike > FACING) & (shape.slot[vertex] == marks.slot[own][:, None])
        fits &= free[mesh.vertices_of(number)][vertex]
        best = np.argmin(np.where(fits, distance, np.inf), axis=1)
        at = np.arange(len(own))
        chosen = vertex[at, best] + mesh.vertex_offsets[number]
        found[own] = np.where(fits[at, best], chosen, -1)
    return found


__all__ = ["MOST", "Rows", "nearest_vertices", "rows_of"]
