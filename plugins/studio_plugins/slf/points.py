"""Where paint needs points: a mesh refined for what varies over it, and the vertices that suffice."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from studio_core.jit import kernel
from studio_core.scene.between import Cloud, weigh
from studio_core.scene.shading_mesh import NO_BACK, ShadingMesh, places_between

F32 = npt.NDArray[np.float32]
I64 = npt.NDArray[np.int64]
Bools = npt.NDArray[np.bool_]

WITHIN = 0.008
"""What may be lost at vertices when points are left out, of values up to 1."""
STEEP = 0.04
"""Both ends of edges between values that differ by more are points."""
STEP = 0.15
"""Edges between values that differ by more are cut."""
ROUNDS = 12
MOST = 20_000
"""Vertices from which on a mesh is refined no further."""
CELLS = 24
"""Along an object: so far apart are points where nothing varies."""
CHECKS = 4
UNLIKE = 0.02
"""Looks that are farther apart than this may have other changes; black and white are 1 apart."""


@dataclass(frozen=True, eq=False)
class Known:
    """Of a mesh's vertices: values (V, C) that are wanted, and how they look.

    looks (V, 3) are what paint follows, None if it follows none; vertices that stand for surface of one look
    are `clear` (V,); original (V, K) are the looks by which values were found.
    """

    values: F32
    looks: F32 | None
    clear: Bools
    original: F32


def finer(
    mesh: ShadingMesh,
    known: Callable[[ShadingMesh, Known | None], Known],
    seeds: tuple[F32, F32],
    shortest: float,
) -> tuple[ShadingMesh, Known]:
    """The mesh with edges cut down to `shortest` where values vary, and what is known of it.

    known: of a mesh, and what was known before it had its last vertices. seeds: places (N, 3) and values
    (N, C) that the vertices next to them are to have as well. Ends that look different may have different
    values: paint follows looks by itself.
    """
    here = known(mesh, None)
    near, away = np.zeros(len(seeds[0]), np.int64), np.full(len(seeds[0]), np.inf)
    first = 0
    for _ in range(ROUNDS):
        room = MOST - len(mesh)
        pairs = _pairs(mesh)
        gap = _gap(here, pairs)
        length = np.zeros(len(pairs), np.float32)
        add_lengths(mesh.positions, pairs, length)
        lonely = np.zeros(len(mesh), np.bool_)
        if len(seeds[0]):
            distance, found = cKDTree(mesh.positions[first:]).query(seeds[0])
            near, away = np.where(distance < away, found + first, near), np.minimum(distance, away)
            lonely[near[np.abs(here.values[near] - seeds[1]).max(axis=1) > STEP]] = True
        marked = np.flatnonzero(((gap > STEP) | lonely[pairs].any(axis=1)) & (length > shortest))
        if not len(marked) or room <= 0:
            break
        if len(marked) > room:
            marked = marked[np.argsort(-length[marked], kind="stable")[:room]]
        first = len(mesh)
        mesh = places_between(mesh, pairs[marked])
        here = known(mesh, here)
    return mesh, here


def sufficient(mesh: ShadingMesh, here: Known) -> I64:
    """Vertices between which all others have their values (V, C), within WITHIN; none where all are 0.

    In slots without any change there are no points; where it is the same all over, there is one. Those that
    are not clear have no say.
    """
    values, clear = here.values, here.clear
    pairs, slots = _pairs(mesh), mesh.slot.astype(np.int64)
    chosen = np.zeros(len(mesh), np.bool_)
    chosen[pairs[_gap(here, pairs) > STEEP]] = True
    chosen[pairs[chosen[pairs].any(axis=1)]] = True
    chosen &= clear
    open_slots = []
    for slot in np.unique(slots[clear]).tolist():
        own = np.flatnonzero((slots == slot) & clear)
        if not np.abs(values[own]).max() > 0:
            chosen[own] = False
        elif float(np.ptp(values[own], axis=0).max()) <= WITHIN:
            chosen[own] = False
            chosen[own[0]] = True
        else:
            open_slots.append(slot)
    rest = np.flatnonzero(np.isin(slots, open_slots) & clear)
    if not len(rest):
        return np.flatnonzero(chosen)
    chosen[rest[_sparse(mesh, rest)]] = True
    cloud = Cloud(mesh.positions, mesh.normals, slots, here.looks)
    for _ in range(CHECKS):
        points = np.flatnonzero(chosen)
        made = weigh(_some(cloud, points), _some(cloud, rest))(values[points])
        off = np.abs(made - values[rest]).max(axis=1) > WITHIN
        off &= ~chosen[rest]
        if not off.any():
            break
        chosen[rest[off]] = True
    return np.flatnonzero(chosen)


def _some(cloud: Cloud, which: I64) -> Cloud:
    looks = None if cloud.looks is None else cloud.looks[which]
    return Cloud(cloud.places[which], cloud.normals[which], cloud.slots[which], looks)


def _pairs(mesh: ShadingMesh) -> I64:
    """(N, 2) vertices that share an edge on one side; edges between faces twice."""
    back = mesh.back_faces[mesh.back_faces[:, 0] != NO_BACK]
    faces = np.concatenate([mesh.faces, back]).astype(np.int64)
    return np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])


def _across(values: F32, pairs: I64) -> F32:
    return np.asarray(values[pairs[:, 0]] - values[pairs[:, 1]])


@kernel
def add_lengths(places: F32, pairs: I64, out: F32) -> None:
    """out (N,) += how far apart the places (V, 3) of pairs (N, 2) are."""
    for n in range(len(pairs)):
        square = np.float32(0)
        for c in range(3):
            difference = places[pairs[n, 0], c] - places[pairs[n, 1], c]
            square += difference * difference
        out[n] += np.sqrt(square)


@kernel
def add_most_across(values: F32, pairs: I64, out: F32) -> None:
    """out (N,) = the largest difference between the values (V, C) of pairs (N, 2), if it is larger."""
    for n in range(len(pairs)):
        for c in range(values.shape[1]):
            out[n] = max(out[n], abs(values[pairs[n, 0], c] - values[pairs[n, 1], c]))


def _gap(here: Known, pairs: I64) -> F32:
    """(N,) how much values differ of ends that look alike; 0 of others."""
    made = np.zeros(len(pairs), np.float32)
    add_most_across(here.values, pairs, made)
    if here.looks is not None:
        made[np.abs(_across(here.original, pairs)).max(axis=1) > UNLIKE] = 0
        made[~here.clear[pairs].all(axis=1)] = 0
    return made


def _sparse(mesh: ShadingMesh, some: I64) -> I64:
    """Which of some vertices are the first of their slot that face their way in a cell of a coarse grid."""
    places = mesh.positions[some]
    size = max(float(np.ptp(places, axis=0).max()) / CELLS, 1e-9)
    cells = np.floor((places - places.min(axis=0)) / size).astype(np.int64)
    facing = np.rint(mesh.normals[some]).astype(np.int64) + 1
    key = cells[:, 0]
    for part in (cells[:, 1], cells[:, 2]):
        key = key * (CELLS + 2) + part
    for part in (facing[:, 0], facing[:, 1], facing[:, 2]):
        key = key * 3 + part
    key = key * (int(mesh.slot.max()) + 1) + mesh.slot[some]
    return np.asarray(np.unique(key, return_index=True)[1])


__all__ = ["MOST", "STEP", "WITHIN", "Known", "finer", "sufficient"]
