"""An object as a source: its mesh, what of it stops light, and how each of its vertices reflects."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from studio_core.kernels.raycast import CasterObject, RayCaster
from studio_core.scene.shading_mesh import ShadingMesh

F32 = npt.NDArray[np.float32]
I64 = npt.NDArray[np.int64]
Bools = npt.NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Reflection:
    """How vertices of one object send light on: f_r ≈ Σ_k g_k h_k, by `row` (V,) of R different ones.

    Function 0 is the matte part where `matte`: g = h = 1. Functions after it are those of separated BRDFs:
    incoming and outgoing (R, K, CELLS), zeros where a row has fewer.
    """

    row: I64
    matte: bool
    incoming: F32
    outgoing: F32

    @property
    def functions(self) -> int:
        """How many there are, the matte one with them."""
        return int(self.matte) + int(self.incoming.shape[1])

    def digest(self) -> str:
        """A hash of all of it."""
        made = hashlib.blake2b(digest_size=16)
        for array in (self.row, self.incoming, self.outgoing):
            made.update(repr(array.shape).encode())
            made.update(np.ascontiguousarray(array).tobytes())
        return f"{made.hexdigest()} {self.matte}"


@dataclass(frozen=True, eq=False)
class Body:
    """One object in its own frame, or the part of it that has some of its vertices, rising.

    `key` names the mesh by content; opaque (F,) are the faces that count.
    """

    key: str
    mesh: ShadingMesh
    opaque: Bools
    reflection: Reflection
    some: I64 | None = None

    @cached_property
    def content(self) -> str:
        """A name of all that its fields depend on."""
        made = hashlib.blake2b(np.packbits(self.opaque).tobytes(), digest_size=16)
        made.update(self.vertices.tobytes())
        return f"{self.key} {made.hexdigest()} {self.reflection.digest()}"

    @property
    def vertices(self) -> I64:
        """Those it consists of."""
        return np.arange(len(self.mesh), dtype=np.int64) if self.some is None else self.some

    def caster(self, previous: RayCaster | None = None) -> RayCaster:
        """Rays against this object alone; `previous` lends its meshes."""
        item = CasterObject(self.mesh.positions, self.mesh.faces, self.key, np.eye(4), self.opaque)
        return RayCaster([item], previous=previous)


__all__ = ["Body", "Reflection"]
