"""An imported model in other units or with another axis up: its meshes themselves, not their transforms."""

from __future__ import annotations

import dataclasses
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from studio_core.contract import ImportedModel
from studio_core.scene.geometry import Geometry
from studio_core.scene.nodes import Camera, Light, MeshObject, Node
from studio_core.scene.size import model_bounds
from studio_core.scene.transform import Transform, axis_angle, multiply, vec3

Up = Literal["y", "z"]
UPRIGHT = axis_angle((1.0, 0.0, 0.0), -90.0)
"""Turns a model whose z points up: (x, y, z) becomes (x, z, −y)."""
_LYING = 0.1  # of the height: further below the floor a model does not stand on it


def converted(model: ImportedModel, unit: float = 1.0, up: Up = "y") -> ImportedModel:
    """The model made `unit` times larger, and upright if its z axis points up.

    Instances stay instances; no node gets a scale. ValueError when the unit is no positive number.
    """
    if not (np.isfinite(unit) and unit > 0):
        raise ValueError("a unit must be a positive number of metres")
    if unit == 1.0 and up == "y":
        return model
    made: dict[int, Geometry] = {}
    nodes: list[Node] = []
    for node in model.nodes:
        changed = dataclasses.replace(node, transform=_converted(node.transform, unit, up))
        if isinstance(changed, MeshObject):
            key = id(changed.geometry)
            if key not in made:
                made[key] = _mesh(changed.geometry, unit, up)
            changed = dataclasses.replace(changed, geometry=made[key])
        elif isinstance(changed, Camera | Light) and up == "z":  # they look along an axis of their own
            turned = changed.transform @ Transform(rotation=UPRIGHT)
            changed = dataclasses.replace(changed, transform=turned)
        nodes.append(changed)
    return dataclasses.replace(model, nodes=tuple(nodes))


def likely_up(model: ImportedModel) -> Up:
    """Which axis of the file points up: z where the model stands on z = 0 but is sunk through y = 0."""
    low, high = model_bounds(model)
    size = high - low
    if (size <= 0).any():
        return "y"
    sunk = low[1] < -_LYING * size[1] and high[1] > _LYING * size[1]
    stands = abs(low[2]) < _LYING / 5 * size[2]
    return "z" if sunk and stands else "y"


def _converted(transform: Transform, unit: float, up: Up) -> Transform:
    """Conjugated: what it does to converted points is what it did to the file's."""
    moved, turned = np.array(transform.translation) * unit, transform.rotation
    if up == "z":
        back = (UPRIGHT[0], -UPRIGHT[1], -UPRIGHT[2], -UPRIGHT[3])
        moved = _upright(moved[None])[0]
        turned = multiply(multiply(UPRIGHT, turned), back)
    return Transform(vec3(moved), turned, transform.scale)


def _mesh(geometry: Geometry, unit: float, up: Up) -> Geometry:
    positions: npt.NDArray[np.floating[Any]] = geometry.positions.astype(np.float64) * unit
    normals = geometry.normals
    if up == "z":
        positions = _upright(positions)
        normals = None if normals is None else np.ascontiguousarray(_upright(normals), np.float32)
    return dataclasses.replace(geometry, positions=positions.astype(np.float32), normals=normals)


def _upright(points: npt.NDArray[np.floating[Any]]) -> npt.NDArray[np.floating[Any]]:
    """(N, 3), exactly: `UPRIGHT` without rounding."""
    return np.stack([points[:, 0], points[:, 2], -points[:, 1] + 0.0], axis=1)
