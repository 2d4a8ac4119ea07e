"""How large a scene is."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from studio_core.scene.nodes import MeshObject, Scene

F64 = npt.NDArray[np.float64]


def scene_bounds(scene: Scene) -> tuple[F64, F64]:
    """Lowest and highest corner of all shown meshes, (3,) each; a unit box when there are none."""
    corners = []
    for node in scene.of(MeshObject):
        if scene.shown(node.id) and len(node.geometry.positions):
            matrix = scene.world(node.id).matrix()
            low, high = node.geometry.bounds
            box = np.array(
                [[x, y, z] for x in (low[0], high[0]) for y in (low[1], high[1]) for z in (low[2], high[2])]
            )
            corners.append(box @ matrix[:3, :3].T + matrix[:3, 3])
    if not corners:
        return np.array([-0.5, 0.0, -0.5]), np.array([0.5, 1.0, 0.5])
    points = np.concatenate(corners)
    return points.min(axis=0), points.max(axis=0)
