"""A view as OpenGL wants it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from studio_core.scene.transform import rotation_matrix
from studio_core.session import View
from studio_ui.canvas.projection import extent

F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Camera:
    """`from_world` (4, 4) leads to the eye in float64; `projection` (4, 4) from there to clip space."""

    from_world: F64
    projection: F32
    far: float

    @classmethod
    def of(cls, view: View, depths: tuple[float, float], point: tuple[float, float] | None = None) -> Camera:
        """The view between two depths; with a `point` (0…1 from the top left), one pixel of it alone."""
        turn = rotation_matrix(view.transform.rotation)
        from_world = np.eye(4)
        from_world[:3, :3] = turn.T
        from_world[:3, 3] = -turn.T @ np.asarray(view.transform.translation, np.float64)
        right, up = extent(view)
        near, far = depths
        made = np.zeros((4, 4))
        made[0, 0], made[1, 1] = 1 / right, 1 / up
        made[2, 2], made[2, 3] = -(far + near) / (far - near), -2 * far * near / (far - near)
        made[3, 2] = -1
        if point is not None:
            zoom = np.diag([float(view.width), float(view.height), 1.0, 1.0])
            zoom[0, 3] = -view.width * (2 * point[0] - 1)
            zoom[1, 3] = -view.height * (1 - 2 * point[1])
            made = zoom @ made
        return cls(from_world, made.astype(np.float32), far)
