"""Between the world and the canvas: rays through points of the picture, points of the world on it.

Canvas coordinates are (x, y) in 0…1 from the top left of the picture.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from studio_core.scene.nodes import Environment, MeshObject, NodeId, Scene
from studio_core.session import View

F64 = npt.NDArray[np.float64]
NEAR = 1e-3


def eye_of(view: View) -> F64:
    """(3,) where the view is seen from."""
    return np.array(view.transform.translation)


def axes_of(view: View) -> F64:
    """(3, 3) rows: right, up and back of the camera in the world."""
    turned: F64 = view.transform.matrix()[:3, :3].T / view.transform.scale
    return turned


def extent(view: View) -> tuple[float, float]:
    """Half width and half height of the picture at distance 1."""
    top = float(np.tan(np.radians(view.fov) / 2))
    return top * view.width / view.height, top


def ray(view: View, x: float, y: float) -> F64:
    """(3,) unit direction through a point of the canvas."""
    right, top = extent(view)
    local = np.array([(2 * x - 1) * right, (1 - 2 * y) * top, -1.0])
    made: F64 = local @ axes_of(view)
    return made / np.linalg.norm(made)


def project(view: View, points: npt.ArrayLike) -> F64:
    """(N, 2) canvas coordinates of world points (N, 3); NaN for those behind the eye."""
    local = (np.asarray(points, np.float64).reshape(-1, 3) - eye_of(view)) @ axes_of(view).T
    right, top = extent(view)
    depth = np.where(local[:, 2] < -NEAR, -local[:, 2], np.nan)
    x = local[:, 0] / (depth * right)
    y = local[:, 1] / (depth * top)
    return np.stack([(x + 1) / 2, (1 - y) / 2], axis=1)


def project_segments(view: View, segments: npt.ArrayLike) -> F64:
    """(N, 2, 2) canvas coordinates of world segments (N, 2, 3), cut at the eye's plane; none behind it."""
    ends = np.asarray(segments, np.float64).reshape(-1, 2, 3)
    depth = -((ends - eye_of(view)) @ axes_of(view)[2])
    keep = (depth > NEAR).any(axis=1)
    ends, depth = ends[keep], depth[keep]
    for near, far in ((0, 1), (1, 0)):
        cut = depth[:, near] <= NEAR
        share = (2 * NEAR - depth[cut, near]) / (depth[cut, far] - depth[cut, near])
        ends[cut, near] += share[:, None] * (ends[cut, far] - ends[cut, near])
    return project(view, ends).reshape(-1, 2, 2)


def own_corners(scene: Scene, node: NodeId) -> F64:
    """(8, 3) corners of the box around a node's own mesh, in the world; (0, 3) where it has none."""
    made = scene[node]
    if not isinstance(made, MeshObject) or not len(made.geometry.positions):
        return np.zeros((0, 3))
    low, high = made.geometry.bounds
    box = np.array(np.meshgrid(*zip(low, high, strict=True))).reshape(3, -1).T
    matrix = scene.world(node).matrix()
    found: F64 = box @ matrix[:3, :3].T + matrix[:3, 3]
    return found


def corners(scene: Scene, node: NodeId) -> F64:
    """(N, 3) corners of the boxes around all meshes at and under a node, in the world."""
    return np.concatenate([np.zeros((0, 3)), *(own_corners(scene, below) for below in scene.subtree(node))])


def bounds(scene: Scene, nodes: Any = None) -> tuple[F64, F64] | None:
    """Lowest and highest corner of what is shown of `nodes` (None: everything); lamps count as points."""
    points = [np.zeros((0, 3))]
    chosen = [n.id for n in scene.children(None)] if nodes is None else list(nodes)
    for node in chosen:
        if not scene.shown(node):
            continue
        boxes = corners(scene, node)
        if nodes is not None and not len(boxes) and not isinstance(scene[node], Environment):
            boxes = np.array([scene.world(node).translation])
        points.append(boxes)
    all_points = np.concatenate(points)
    return (all_points.min(axis=0), all_points.max(axis=0)) if len(all_points) else None


def box_segments(low: npt.ArrayLike, high: npt.ArrayLike) -> F64:
    """(12, 2, 3) the edges of a box."""
    low, high = np.asarray(low, np.float64), np.asarray(high, np.float64)
    made = []
    for axis in range(3):
        for corner in range(4):
            start = low.copy()
            for bit, other in enumerate(a for a in range(3) if a != axis):
                if corner >> bit & 1:
                    start[other] = high[other]
            end = start.copy()
            end[axis] = high[axis]
            made.append((start, end))
    return np.array(made)
