"""How large an imported model is, and whether that can be meant."""

from __future__ import annotations

import dataclasses

import numpy as np
import numpy.typing as npt

from studio_core.contract import ImportedModel
from studio_core.scene.nodes import MeshObject, NodeId, Scene
from studio_core.scene.transform import Transform, rotation_matrix, vec3

LARGEST, SMALLEST = 30.0, 0.02
"""Metres between which the longest side of furniture and rooms lies."""
_UNITS = ((0.01, "centimetres"), (0.001, "millimetres"), (0.0254, "inches"), (0.3048, "feet"))


def model_bounds(model: ImportedModel) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
    """Lowest and highest corner of all objects, exactly, in the model's frame; zeros without any."""
    scene = Scene().with_nodes(*model.nodes)
    low, high = np.full(3, np.inf), np.full(3, -np.inf)
    for node in model.objects:
        matrix = scene.world(node.id).matrix()
        placed = node.geometry.positions.astype(np.float64) @ matrix[:3, :3].T + matrix[:3, 3]
        if len(placed):
            low, high = np.minimum(low, placed.min(axis=0)), np.maximum(high, placed.max(axis=0))
    return (low, high) if np.isfinite(low).all() else (np.zeros(3), np.zeros(3))


def model_size(model: ImportedModel) -> tuple[float, float, float]:
    """Width (x), depth (z) and height (y) in metres of the box around all objects; zeros without any."""
    low, high = model_bounds(model)
    width, height, depth = (float(side) for side in high - low)
    return width, depth, height


def own_box(scene: Scene, node: NodeId) -> npt.NDArray[np.float64] | None:
    """(2, 3) lowest and highest corner of what hangs under a node, in its own frame; None without a mesh.

    A thing that was turned is as wide as before: width is along its own x.
    """
    local = scene.world(node).inverse()
    corners = []
    for below in scene.subtree(node):
        mesh = scene[below]
        if isinstance(mesh, MeshObject) and len(mesh.geometry.positions):
            matrix = (local @ scene.world(below)).matrix()
            low, high = mesh.geometry.bounds
            box = np.array(np.meshgrid(*zip(low, high, strict=True))).reshape(3, -1).T
            corners.append(box @ matrix[:3, :3].T + matrix[:3, 3])
    if not corners:
        return None
    points = np.concatenate(corners)
    return np.stack([points.min(axis=0), points.max(axis=0)])


def own_size(scene: Scene, node: NodeId) -> tuple[float, float, float] | None:
    """Width, depth and height of a node along its own axes, metres in the world; None without a mesh."""
    box = own_box(scene, node)
    if box is None:
        return None
    width, height, depth = (float(side) for side in (box[1] - box[0]) * scene.world(node).scale)
    return width, depth, height


def resized(scene: Scene, node: NodeId, factor: float) -> Transform:
    """The node's transform once it is `factor` times as large about the middle of its base.

    What stands on the floor goes on standing there. ValueError when the factor is not positive.
    """
    old = scene[node].transform
    made = dataclasses.replace(old, scale=old.scale * factor)
    box = own_box(scene, node)
    if box is None:
        return made
    base = np.array([(box[0, 0] + box[1, 0]) / 2, box[0, 1], (box[0, 2] + box[1, 2]) / 2])
    shift = (old.scale - made.scale) * (rotation_matrix(old.rotation) @ base)
    return dataclasses.replace(made, translation=vec3(np.array(old.translation) + shift))


def suspicious_size(model: ImportedModel) -> str | None:
    """A question about the file's unit when the size is absurd for a room or furniture, else None."""
    size = model_size(model)
    longest = max(size)
    if longest == 0 or SMALLEST <= longest <= LARGEST:
        return None
    told = " × ".join(f"{side:.3g}" for side in size)
    fits = [name for factor, name in _UNITS if 0.2 <= longest * factor <= 5]
    guess = f"is the file in {' or '.join(fits[:2])}?" if longest > LARGEST and fits else "which unit has it?"
    return f"The model would be {told} m (width × depth × height); {guess}"


def pivot_words(scene: Scene, node: NodeId) -> str:
    """Where a node's origin is in what hangs under it, about which it turns and scales; "" without a mesh."""
    box = own_box(scene, node)
    if box is None:
        return ""
    scale = scene.world(node).scale
    above = -float(box[0, 1]) * scale
    aside = float(np.hypot(*(box[:, [0, 2]].mean(axis=0)))) * scale
    tall = float(box[1, 1] - box[0, 1]) * scale
    slack = 0.02 * max(float((box[1] - box[0]).max()) * scale, 1e-9)
    if abs(above) <= slack:
        height = "at its base"
    elif abs(above - tall) <= slack:
        height = "at its top"
    elif abs(above - tall / 2) <= slack:
        height = "at half its height"
    else:
        height = f"{abs(above):.2f} m {'above' if above > 0 else 'below'} its base"
    return f"{height}, {'in the middle' if aside <= slack else f'{aside:.2f} m from the middle'}"
