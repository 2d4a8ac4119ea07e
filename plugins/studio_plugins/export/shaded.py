"""Meshes as they are shaded: repaired, with the normals that the studio makes where a file has none."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from studio_core.scene.geometry import Geometry
from studio_core.scene.shading_mesh import prepare


@dataclass(frozen=True, eq=False)
class ShadedPart:
    """The faces of one material: `slot` in front, `back` behind.

    positions (P, 3), normals (P, 3), uvs (P, 2) or None (v up), faces (F, 3).
    """

    slot: int
    back: int
    positions: npt.NDArray[np.float32]
    normals: npt.NDArray[np.float32]
    uvs: npt.NDArray[np.float32] | None
    faces: npt.NDArray[np.uint32]


def shaded_parts(geometry: Geometry) -> tuple[ShadedPart, ...]:
    """The geometry by pairs of material slots, in its own frame; empty for a mesh without area."""
    mesh = prepare(geometry)
    behind = np.where(mesh.back[:, 0] >= 0, mesh.slot[mesh.back[:, 0]], mesh.slots)
    pairs = np.stack([mesh.slots, behind], axis=1).astype(np.int64).reshape(-1, 2)
    found = []
    for slot, back in np.unique(pairs, axis=0):
        faces = mesh.faces[(pairs == (slot, back)).all(axis=1)]
        used, index = np.unique(faces, return_inverse=True)
        found.append(
            ShadedPart(
                int(slot),
                int(back),
                mesh.points[mesh.weld[used]].astype(np.float32),
                mesh.normals[used].astype(np.float32),
                None if geometry.uvs is None else mesh.uvs[used].astype(np.float32),
                index.reshape(-1, 3).astype(np.uint32),
            )
        )
    return tuple(found)
