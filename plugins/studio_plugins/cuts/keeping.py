"""Visibility on disk: what was traced for a scene is found again when it is opened another time.

Kept under everything it depends on: meshes, which faces stop light, where objects stand, how finely light
is looked at. What a changed scene has in common with another is not looked for.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from studio_core.shading.artifacts import Surfaces
from studio_core.shading.cache import DiskCache
from studio_plugins.cuts.occluders import Occluders
from studio_plugins.cuts.store import VisibilityStore

METHOD = "cuts visibility, 1"
I64 = npt.NDArray[np.int64]


def key_of(k: int, surfaces: Surfaces, occluders: Occluders) -> tuple[object, ...]:
    """What the visibility of the unrefined vertices depends on."""
    mesh = surfaces.unrefined.mesh
    objects = tuple((placed.mesh.edge, len(placed.mesh), placed.transform) for placed in mesh.objects)
    return (k, objects, occluders.keys, occluders.transforms)


def unrefined_rows(surfaces: Surfaces) -> I64:
    """The vertices that the unrefined meshes have too."""
    mesh, base = surfaces.mesh, surfaces.unrefined.mesh
    starts, counts = mesh.vertex_offsets[:-1], np.diff(base.vertex_offsets)
    rows = [np.arange(start, start + count) for start, count in zip(starts, counts, strict=True)]
    return np.concatenate([*rows, np.zeros(0, np.int64)]).astype(np.int64)


def load(cache: DiskCache, store: VisibilityStore, surfaces: Surfaces, occluders: Occluders) -> bool:
    """Whether the store now knows what its unrefined vertices see."""
    found = cache.get(METHOD, *key_of(store.k, surfaces, occluders))
    if found is None or not {"pool", "length"} <= found.keys():
        return False
    return store.unpack(unrefined_rows(surfaces), found["pool"], found["length"])


def save(cache: DiskCache, store: VisibilityStore, surfaces: Surfaces, occluders: Occluders) -> int:
    """Keeps what the store knows of all unrefined vertices; bytes."""
    pool, length = store.packed(unrefined_rows(surfaces))
    cache.put({"pool": pool, "length": length}, METHOD, *key_of(store.k, surfaces, occluders))
    return pool.nbytes + length.nbytes
