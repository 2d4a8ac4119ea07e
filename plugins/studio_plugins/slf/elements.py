"""Elements: about ten thousand points that stand for all surfaces, evenly spread over their area.

They are vertices of the shading meshes, so that light, materials and what rays meet (`studio_core.transport`)
are known there already. Chosen is a Poisson-disc subset: in random order, each vertex that no chosen one of
its object, facing its way, is nearer to than a radius, which is found by bisection from how many are wanted.
Every other vertex belongs to the nearest element of its object that faces its way.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from studio_core.jit import kernel
from studio_core.scene.world_mesh import WorldMesh

F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]
I32 = npt.NDArray[np.int32]
I64 = npt.NDArray[np.int64]
Bools = npt.NDArray[np.bool_]

COUNT = 10_000
ALIKE = 0.5
"""Cosine between normals of points that may stand for each other."""
NEAR = 12  # elements among which a vertex looks for its own
HALVINGS = 18
CLOSE_ENOUGH = 0.01  # of the count
_BUCKETS = 1 << 15


@dataclass(frozen=True, eq=False)
class Elements:
    """vertex (E,): which vertices of the unrefined meshes they are; owner (V,): to which element each vertex
    belongs, −1 for those that are not wanted. area (E,) in m² of all that belongs to an element.
    """

    vertex: I64
    owner: I32
    area: F64

    def __len__(self) -> int:
        return len(self.vertex)

    @classmethod
    def of(cls, mesh: WorldMesh, wanted: Bools, count: int = COUNT) -> Elements:
        """Elements of the vertices `wanted` (V,), `count` of them or all if there are fewer."""
        some = np.flatnonzero(wanted)
        if not len(some):
            return cls(some, np.full(len(wanted), -1, np.int32), np.zeros(0))
        chosen = some if len(some) <= count else some[_spread(mesh, some, count)]
        owner = np.full(len(wanted), -1, np.int32)
        owner[some] = _owners(mesh, some, chosen)
        area = np.bincount(owner[some], mesh.area[some].astype(np.float64), len(chosen))
        return cls(chosen, owner, area.astype(np.float64))


def _spread(mesh: WorldMesh, some: I64, count: int) -> I64:
    """Which of the vertices `some` are chosen, sorted."""
    order = some[np.random.default_rng(0).permutation(len(some))]
    low, high, best = 0.0, 2 * math.sqrt(mesh.area[some].sum() / count), np.arange(len(some))
    for _ in range(HALVINGS):
        radius = (low + high) / 2
        chosen = np.zeros(len(mesh), np.bool_)
        heads, links = np.full(_BUCKETS, -1, np.int32), np.empty(len(mesh), np.int32)
        thin(radius, order, mesh.positions, mesh.normals, mesh.object, heads, links, chosen)
        found = np.flatnonzero(chosen[some])
        if abs(len(found) - count) < abs(len(best) - count):
            best = found
        if abs(len(found) - count) <= CLOSE_ENOUGH * count:
            break
        low, high = (radius, high) if len(found) > count else (low, radius)
    return np.asarray(best)


@kernel
def thin(
    radius: float,
    order: I64,
    positions: F32,
    normals: F32,
    owner: I32,
    heads: I32,
    links: I32,
    chosen: Bools,
) -> None:
    """Chooses vertices in an order unless a chosen one of the same owner that faces alike is within a radius.

    chosen (V,) is all False before. Chosen ones lie in buckets by a hash of their place: heads (2^k,) all −1
    before, links (V,).
    """
    mask = len(heads) - 1
    limit = radius * radius
    for item in range(len(order)):
        i = order[item]
        a, b, c = positions[i, 0], positions[i, 1], positions[i, 2]
        x, y, z = int(np.floor(a / radius)), int(np.floor(b / radius)), int(np.floor(c / radius))
        free = True
        for cell in range(27):
            u, v, w = x + cell // 9 - 1, y + cell // 3 % 3 - 1, z + cell % 3 - 1
            j = heads[(u * 73856093 ^ v * 19349663 ^ w * 83492791) & mask]
            while j >= 0:
                if owner[j] == owner[i]:
                    p, q, r = positions[j, 0] - a, positions[j, 1] - b, positions[j, 2] - c
                    cosine = normals[i, 0] * normals[j, 0] + normals[i, 1] * normals[j, 1]
                    if p * p + q * q + r * r < limit and cosine + normals[i, 2] * normals[j, 2] > ALIKE:
                        free = False
                        break
                j = links[j]
            if not free:
                break
        if free:
            chosen[i] = True
            bucket = (x * 73856093 ^ y * 19349663 ^ z * 83492791) & mask
            links[i], heads[bucket] = heads[bucket], i


def _owners(mesh: WorldMesh, some: I64, chosen: I64) -> I32:
    """(N,) the element of each vertex: the nearest of its object that faces alike, else the nearest."""
    places = mesh.positions
    near = min(NEAR, len(chosen))
    distance, found = cKDTree(places[chosen]).query(places[some], k=near)
    distance, found = distance.reshape(len(some), near), found.reshape(len(some), near)
    vertex = chosen[found]
    same = mesh.object[vertex] == mesh.object[some][:, None]
    alike = (mesh.normals[vertex] * mesh.normals[some][:, None]).sum(axis=2) > ALIKE
    rank = np.where(same & alike, 0, np.where(same, 1, 2))
    best = np.lexsort((distance, rank), axis=1)[:, 0]
    return np.asarray(found[np.arange(len(some)), best], np.int32)
