"""Meshes for the ray caster: checked, kept around their middle, handed to embree or to our own tracer."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from studio_core.errors import InputError
from studio_core.kernels.bvh import BvhDevice
from studio_core.kernels.embree import EmbreeDevice, EmbreeUnavailableError

F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]
Bools = npt.NDArray[np.bool_]

LARGEST_COORDINATE = 1e9


@dataclass(frozen=True)
class CasterObject:
    """A placed mesh. Objects with equal `key` (and equal `occludes`) share one structure.

    positions (P, 3) float32, faces (F, 3) unsigned, transform (4, 4) float64 affine, object to world;
    occludes (F,) says which faces stop light (None: all).
    """

    positions: F32
    faces: npt.NDArray[np.uint32]
    key: str
    transform: F64
    occludes: Bools | None = None


class Scene(Protocol):
    """What the caster needs of a tracer's scene."""

    pointer: int

    def move(self, number: int, transform: F64 | None) -> None:
        """Places an instance anew; None takes it out."""

    def close(self) -> None:
        """Frees it."""


class Device(Protocol):
    """What the caster needs of a tracer."""

    name: str
    occluded8: int
    intersect8: int

    def mesh(self, positions: F32, faces: npt.NDArray[np.uint32], opaque: int) -> Any:
        """Builds a mesh whose first `opaque` faces are opaque."""

    def scene(self, meshes: Sequence[Any], transforms: Sequence[F64 | None]) -> Scene:
        """Places meshes."""

    def alone(self, mesh: Any) -> Any:
        """A scene, told by its `pointer`, of one mesh where it stands."""


@dataclass(frozen=True)
class SharedMesh:
    """A mesh as the tracer holds it: around its middle, opaque faces first, degenerate ones dropped.

    `alone` is a scene of it (both None when no face is left); `radius` reaches from the middle to its
    farthest point.
    """

    mesh: Any
    alone: Any
    shape: tuple[int, int]
    middle: F64
    half: F64
    radius: float
    face_ids: npt.NDArray[np.int32]
    opaque: int


def choose_device(backend: str = "auto") -> tuple[Device, str]:
    """The tracer to use and why; `LUCARNE_RAYCASTER` answers for "auto"."""
    asked = os.environ.get("LUCARNE_RAYCASTER", "auto") if backend == "auto" else backend
    if asked not in ("auto", "embree", "bvh"):
        raise InputError(f"the ray caster must be auto, embree or bvh, not {asked!r}")
    if asked == "bvh":
        return BvhDevice(), "asked for"
    try:
        return EmbreeDevice(), "found with embreex"
    except EmbreeUnavailableError as error:
        if asked == "embree":
            raise
        return BvhDevice(), str(error)


def prepare_mesh(device: Device, item: CasterObject) -> SharedMesh:
    """Checks a mesh and builds its structure; raises `InputError` naming mesh and cause."""
    name = f"mesh {item.key!r}"
    positions = np.asarray(item.positions)
    faces = np.asarray(item.faces)
    if positions.ndim != 2 or positions.shape[1] != 3 or not np.issubdtype(positions.dtype, np.number):
        raise InputError(f"{name} has no list of three-dimensional positions")
    if faces.ndim != 2 or faces.shape[1] != 3 or not np.issubdtype(faces.dtype, np.integer):
        raise InputError(f"{name} has no list of triangles")
    if len(faces) and (int(faces.min()) < 0 or int(faces.max()) >= len(positions)):
        raise InputError(f"{name} has a triangle whose corner is not in its list of positions")
    if not (np.abs(positions) <= LARGEST_COORDINATE).all():
        raise InputError(f"{name} has a position that is not finite or farther than {LARGEST_COORDINATE:g} m")
    opaque = np.ones(len(faces), bool) if item.occludes is None else np.asarray(item.occludes, bool)
    if opaque.shape != (len(faces),):
        raise InputError(f"{name} has {len(faces)} faces but says of {opaque.size} whether they stop light")
    used = positions[np.unique(faces)].astype(np.float64) if len(faces) else np.zeros((1, 3))
    low, high = used.min(axis=0), used.max(axis=0)
    middle = (low + high) / 2
    around = (positions.astype(np.float64) - middle).astype(np.float32)
    a, b, c = (around[faces[:, i]].astype(np.float64) for i in range(3))
    whole = (np.cross(b - a, c - a) != 0).any(axis=1)
    kept = np.concatenate([np.flatnonzero(whole & opaque), np.flatnonzero(whole & ~opaque)])
    count = int((whole & opaque).sum())
    mesh = alone = None
    if len(kept):
        triangles = np.ascontiguousarray(faces[kept], np.uint32)
        mesh = device.mesh(around, triangles, count)
        alone = device.alone(mesh)
    shape = (len(positions), len(faces))
    radius = float(np.linalg.norm(used - middle, axis=1).max())
    return SharedMesh(mesh, alone, shape, middle, (high - low) / 2, radius, kept.astype(np.int32), count)


def affine(transform: npt.ArrayLike, key: str) -> F64:
    """The placement as a finite affine matrix; raises `InputError` naming the mesh."""
    matrix = np.array(transform, np.float64)
    if matrix.shape != (4, 4) or not (np.abs(matrix) <= LARGEST_COORDINATE).all():
        raise InputError(f"the placement of mesh {key!r} is not a finite 4×4 matrix")
    if not np.array_equal(matrix[3], [0.0, 0.0, 0.0, 1.0]):
        raise InputError(f"the placement of mesh {key!r} is not affine")
    return matrix
