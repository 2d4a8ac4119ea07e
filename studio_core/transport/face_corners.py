"""Which vertices a caster's faces lead to; one table for all operators that trace against it."""

from __future__ import annotations

import weakref
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from studio_core.kernels.raycast import CasterHandles
from studio_core.scene.shading_mesh import NO_BACK
from studio_core.scene.world_mesh import WorldMesh


@dataclass(frozen=True, eq=False)
class FaceCorners:
    """(slots, 6): front and back vertices of opaque faces, within their object, in the caster's order."""

    face_ids: npt.NDArray[np.int32]
    table: npt.NDArray[np.uint32]

    @classmethod
    def of(cls, mesh: WorldMesh, handles: CasterHandles) -> FaceCorners:
        """The same as long as somebody holds it; a caster's own list of faces tells which it is."""
        known = _KEPT.get(id(handles.face_ids))
        if known is not None:
            return known
        table = np.full((len(handles.face_ids), 6), NO_BACK, np.uint32)
        for placed, (start, stop) in zip(mesh.objects, handles.face_start.tolist(), strict=True):
            if start < stop:
                ids = handles.face_ids[start:stop]
                table[start:stop, :3] = placed.mesh.faces[ids]
                table[start:stop, 3:] = placed.mesh.back_faces[ids]
        made = _KEPT[id(handles.face_ids)] = cls(handles.face_ids, table)
        return made


_KEPT: weakref.WeakValueDictionary[int, FaceCorners] = weakref.WeakValueDictionary()
"""By the identity of `face_ids`, which each holds and so keeps from being another's."""

__all__ = ["FaceCorners"]
