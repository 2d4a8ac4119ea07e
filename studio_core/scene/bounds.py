"""How large a scene is, and the things in it."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
import numpy.typing as npt

from studio_core.scene.nodes import Environment, MeshObject, NodeId, Scene

F64 = npt.NDArray[np.float64]
_STRAIGHT = 1e-9  # sine of the smallest angle that makes the box of a mesh larger than its mesh


def scene_bounds(scene: Scene) -> tuple[F64, F64]:
    """Lowest and highest corner of all shown meshes, (3,) each; a unit box when there are none.

    What only catches shadows is left out where there is anything else.
    """
    found: dict[bool, list[F64]] = {False: [], True: []}
    for node in scene.of(MeshObject):
        if scene.shown(node.id) and len(node.geometry.positions):
            matrix = scene.world(node.id).matrix()
            low, high = node.geometry.bounds
            box = np.array(
                [[x, y, z] for x in (low[0], high[0]) for y in (low[1], high[1]) for z in (low[2], high[2])]
            )
            found[only_catches(scene, node)].append(box @ matrix[:3, :3].T + matrix[:3, 3])
    corners = found[False] or found[True]
    if not corners:
        return np.array([-0.5, 0.0, -0.5]), np.array([0.5, 1.0, 0.5])
    points = np.concatenate(corners)
    return points.min(axis=0), points.max(axis=0)


def only_catches(scene: Scene, node: MeshObject) -> bool:
    """Whether a mesh belongs to the photographed room: all of it catches shadows."""
    return bool(node.materials) and all(scene.material(m).catches for m in node.materials)


def exact_bounds(scene: Scene, nodes: Iterable[NodeId]) -> tuple[F64, F64] | None:
    """Lowest and highest corner, (3,) each, of what is shown at and under `nodes`: around every vertex.

    What has no mesh at or under it counts as a point (lamps, cameras); an environment is nowhere. None when
    nothing of it is shown.
    """
    found: list[F64] = []
    for node in nodes:
        if not scene.shown(node):
            continue
        boxes = [mesh_box(scene, below) for below in scene.subtree(node) if _has_mesh(scene, below)]
        if not boxes and not isinstance(scene[node], Environment):
            boxes = [np.array([scene.world(node).translation] * 2)]
        found += boxes
    if not found:
        return None
    ends = np.stack(found)
    return ends[:, 0].min(axis=0), ends[:, 1].max(axis=0)


def mesh_box(scene: Scene, node: NodeId) -> F64:
    """(2, 3) lowest and highest corner of a mesh object in the world; raises TypeError for other nodes."""
    made = scene[node]
    if not isinstance(made, MeshObject):
        raise TypeError(f"{made.name!r} has no mesh")
    world = scene.world(node).matrix()
    turn = world[:3, :3]
    straight = (np.abs(turn) > _STRAIGHT * np.abs(turn).max()).sum() == 3
    points = made.geometry.bounds if straight else made.geometry.positions
    placed = rows_in_world(points, world)
    return np.stack([placed.min(axis=1), placed.max(axis=1)])


def rows_in_world(points: npt.NDArray[Any], matrix: F64) -> F64:
    """(3, P) x, y and z of points (P, 3) after a transform (4, 4).

    Row by row, as a product of such thin matrices can take a hundred times as long in a busy BLAS.
    """
    x, y, z = np.ascontiguousarray(points.T, np.float64)
    return np.stack([a * x + b * y + c * z + d for a, b, c, d in matrix[:3]])


def _has_mesh(scene: Scene, node: NodeId) -> bool:
    made = scene[node]
    return isinstance(made, MeshObject) and len(made.geometry.positions) > 0 and scene.shown(node)
