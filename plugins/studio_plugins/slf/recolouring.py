"""The edit that changes one object's slot alike everywhere, whoever shares its material."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from studio_core.edits import Add, Assign, Compound, Edit, SetPaint
from studio_core.scene.geometry import Geometry
from studio_core.scene.nodes import MeshObject, NodeId, Scene, new_id
from studio_core.scene.paint import Paint
from studio_core.strokes.stroke import Stroke
from studio_plugins.slf.changeable import Changeable, Look

F64 = npt.NDArray[np.float64]
LABEL = "Paint what is reflected"
POINTS = 64
"""Places at which paint lies that is the same everywhere: others may be painted between them."""


def edit_of(scene: Scene, region: Changeable, look: Look, values: Mapping[str, F64]) -> Edit:
    """Paint on one slot that gives it these values by role, in a model that has them."""
    node = scene[region.node]
    assert isinstance(node, MeshObject)
    changes = {look.roles[role]: look.change(role, value) for role, value in values.items()}
    old = scene.material(node.materials[region.slot])
    if look.material.model == old.model:
        return SetPaint(node.id, painted_alike(node, region.slot, changes, {}), LABEL)
    made = dataclasses.replace(region.material, id=new_id("material"))
    names = {name: look.roles[role] for role, name in region.now.roles.items()}
    paint = painted_alike(node, region.slot, changes, names)
    return Compound(
        LABEL, (Add((), (made,)), Assign(node.id, made.id, region.slot), SetPaint(node.id, paint))
    )


@dataclass(frozen=True)
class PutBack:
    """What strokes changed elsewhere is as in `before` again, so that something else can explain them."""

    strokes: tuple[NodeId, ...]
    before: Mapping[NodeId, MeshObject]
    label: str = LABEL

    def __call__(self, scene: Scene) -> Scene:
        """See `studio_core.edits.Edit`."""
        for name in self.strokes:
            stroke = scene[name]
            for changed in stroke.reached if isinstance(stroke, Stroke) else ():
                node, then = scene.nodes.get(changed), self.before.get(changed)
                if then is not None and isinstance(node, MeshObject):
                    as_then = dataclasses.replace(node, paint=then.paint, materials=then.materials)
                    scene = scene.with_nodes(as_then)
        return scene


def painted_alike(node: MeshObject, slot: int, changes: Mapping[str, F64], names: Mapping[str, str]) -> Paint:
    """An object's paint with `changes` added all over a slot; `names` are new ones of its parameters."""
    old = node.paint
    there = np.zeros(0, np.int64) if old is None else old.slots
    places, normals = (np.zeros((0, 3)), np.zeros((0, 3))) if old is None else (old.places, old.normals)
    if not (there == slot).any():
        more, facing = spread_points(node.geometry, slot)
        places, normals = np.concatenate([places, more]), np.concatenate([normals, facing])
        there = np.concatenate([there, np.full(len(more), slot)])
    own = there == slot
    made: dict[str, npt.NDArray[np.floating]] = {}

    def add(name: str, which: npt.NDArray[np.bool_], values: npt.ArrayLike) -> None:
        given = np.asarray(values, np.float64)
        wide = given.reshape(len(given), -1) if given.ndim == 2 else given.reshape(1, -1)
        total = made.setdefault(name, np.zeros((len(there), wide.shape[1])))
        total[which] += wide

    for name in () if old is None else old.changes:
        assert old is not None
        known = np.arange(len(there)) < len(old.slots)
        values = old.change(name)
        for which, now in ((known & own, names.get(name, name)), (known & ~own, name)):
            if which.any():
                add(now, which, values[which[: len(values)]])
    for name, change in changes.items():
        add(name, own, change)
    return Paint.of(places, normals, there, made)


def spread_points(geometry: Geometry, slot: int) -> tuple[F64, F64]:
    """Middles and normals (N, 3) of some of a slot's faces, in the object's frame."""
    faces = geometry.faces
    if geometry.slots is not None:
        faces = faces[geometry.slots == slot]
    if len(faces) > POINTS:
        faces = faces[np.random.default_rng(0).permutation(len(faces))[:POINTS]]
    corners = geometry.positions[faces].astype(np.float64)
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(across, axis=1, keepdims=True)
    normals = np.where(length > 0, across / np.maximum(length, 1e-30), (0.0, 1.0, 0.0))
    return corners.mean(axis=1), normals


__all__ = ["PutBack", "edit_of", "painted_alike", "spread_points"]
