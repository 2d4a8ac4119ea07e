"""From a face before refinement to the faces it was split into: where a point of it lies now.

Refinement leaves every point of a surface in its place, so what a ray met on the unrefined mesh needs no
second ray: its barycentrics in the old face are carried down to the part of it that holds them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from studio_core.arrays import readonly
from studio_core.scene.shading_mesh import ShadingMesh
from studio_core.scene.topology import Ints, counting

I32 = npt.NDArray[np.int32]
PARTS = 4  # most faces that one becomes in a round
NO_PART = np.iinfo(np.int32).max


@dataclass(frozen=True, eq=False)
class FaceTree:
    """Which parts the faces of a mesh were split into, over several rounds. Read-only arrays.

    A reference is a node (≥ 0) or, as ~f, face f of the refined mesh. root (F,): reference of each face of
    the unrefined mesh. part (N, 4): references of a node's parts, NO_PART where it has fewer. within
    (N, 4, 6) float32: barycentrics (u, v) in a node are (w0 + w1 u + w2 v, w3 + w4 u + w5 v) in its part;
    refinement halves edges, so all these are whole numbers.
    """

    root: I32
    part: I32
    within: npt.NDArray[np.float32]

    @staticmethod
    def unsplit(faces: int) -> FaceTree:
        """Of a mesh that is as it was."""
        return _tree(~np.arange(faces), np.zeros((0, PARTS)), np.zeros((0, PARTS, 6)))

    def origins(self) -> I32:
        """(F,) of each face of the refined mesh, the face of the unrefined mesh that it is (a part of)."""
        leaves = (self.root < 0).sum() + (self.part < 0).sum()
        made = np.empty(int(leaves), np.int32)
        reference, face = self.root, np.arange(len(self.root), dtype=np.int32)
        while len(reference):
            whole = reference < 0
            made[~reference[whole]] = face[whole]
            reference, face = self.part[reference[~whole]], np.repeat(face[~whole], PARTS)
            there = reference.reshape(-1) != NO_PART
            reference, face = reference.reshape(-1)[there], face[there]
        return made

    def grown(self, before: ShadingMesh, after: ShadingMesh, parent: Ints) -> FaceTree:
        """After one more round, which made `after`; `parent` as `refined` gives it."""
        count = np.bincount(parent, minlength=len(before.faces))
        first = np.cumsum(count) - count
        split = np.flatnonzero(count > 1)
        number = np.full(len(before.faces), -1, np.int64)
        number[split] = len(self.part) + np.arange(len(split))
        now = np.where(number >= 0, number, ~first)
        child = first[split, None] + np.arange(PARTS)
        there = np.arange(PARTS) < count[split, None]
        within = np.zeros((len(split), PARTS, 6))
        row = np.repeat(np.arange(len(split)), count[split])
        within[row, counting(count[split])] = _within(before, after, split[row], child[there])
        return _tree(
            _renamed(self.root, now),
            np.concatenate([_renamed(self.part, now), np.where(there, ~child, NO_PART)]),
            np.concatenate([self.within, within]),
        )


def _tree(root: npt.ArrayLike, part: npt.ArrayLike, within: npt.ArrayLike) -> FaceTree:
    return FaceTree(readonly(root, np.int32), readonly(part, np.int32), readonly(within, np.float32))


def _renamed(references: I32, now: Ints) -> Ints:
    made = references.astype(np.int64)
    made[references < 0] = now[~references[references < 0]]
    return made


def _within(before: ShadingMesh, after: ShadingMesh, face: Ints, child: Ints) -> npt.NDArray[np.float64]:
    """(N, 6) maps of barycentrics in faces of `before` to those in their parts `child` of `after`."""
    corners = before.faces[face].astype(np.int64)
    ends = after.parents[after.faces[child]].astype(np.int64)  # (N, 3, 2), twice itself where it is old
    old = after.faces[child] < len(before)
    ends = np.where(old[..., None], after.faces[child][..., None], ends)
    places = (ends[..., None] == corners[:, None, None, :]).mean(axis=2)  # corners of the part, as rows
    a, b, c = (places[:, k] for k in range(3))
    columns = np.stack([np.cross(b, c), np.cross(c, a), np.cross(a, b)], axis=2)
    inverse = np.rint(columns / (a * columns[:, :, 0]).sum(axis=1)[:, None, None])
    # λ = (1 - u - v, u, v) in the face is λ · inverse in the part.
    u, v = inverse[:, :, 1], inverse[:, :, 2]
    rows = (u[:, 0], u[:, 1] - u[:, 0], u[:, 2] - u[:, 0], v[:, 0], v[:, 1] - v[:, 0], v[:, 2] - v[:, 0])
    return np.stack(rows, axis=1)


def joined(trees: Sequence[FaceTree]) -> FaceTree:
    """The trees of objects one after the other, faces and nodes numbered through."""
    roots: list[npt.NDArray[np.int64]] = []
    parts: list[npt.NDArray[np.int64]] = []
    face = node = 0
    for tree in trees:
        root, part = tree.root.astype(np.int64), tree.part.astype(np.int64)
        roots.append(np.where(root < 0, root - face, root + node))
        parts.append(np.where(part == NO_PART, part, np.where(part < 0, part - face, part + node)))
        leaves = (part < 0).sum() + (root < 0).sum()
        face, node = face + int(leaves), node + len(part)
    within = np.concatenate([np.zeros((0, PARTS, 6), np.float32), *(tree.within for tree in trees)])
    none = np.zeros((0, PARTS), np.int64)
    return _tree(np.concatenate([none[:, 0], *roots]), np.concatenate([none, *parts]), within)
