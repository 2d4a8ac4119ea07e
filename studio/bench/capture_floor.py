"""What is left of a room in a lens' picture when everything is known: the floor under a capture's errors.

The exact light of both lenses, without reflections, noise and response, is laid out with the true geometry:
each direction from the lens that looks there. Pixels, glare and parallax are what is left.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from studio.bench.phone import Shots
from studio_core.capturing.artifacts import Calibration, Captured, CaptureState
from studio_core.capturing.settings import BACK, FRONT
from studio_core.capturing.standing import HALF_TURN
from studio_core.imaging.latlong import pixel_directions
from studio_core.imaging.projection import project
from studio_core.scene.geometry import Image

F32 = npt.NDArray[np.float32]
FINER = 3


def floor(shots: Shots, width: int) -> CaptureState:
    """A capture in the room's frame turned by half, with only a picture, `width` columns wide."""
    truth = shots.truth
    height, n = width // 2, FINER
    light = np.zeros((height, width, 3), np.float32)
    rows = max(1, 200_000 // (width * n * n))
    for top in range(0, height, rows):
        bottom = min(top + rows, height)
        finished = pixel_directions(height * n, width * n, slice(top * n, bottom * n))
        part = _seen(shots, (finished @ HALF_TURN).reshape(-1, 3))
        light[top:bottom] = part.reshape(bottom - top, n, width, n, 3).mean((1, 3))
    unresolved = np.zeros((height, width), np.uint8)
    captured = Captured(Image(light), np.zeros((6, 1, 1, 3), np.float32), unresolved, Calibration())
    state = CaptureState(captured=captured)
    return replace(state, notes=(f"{truth.clipped:.3g} of the energy is clipped.",))


def _seen(shots: Shots, in_front: npt.NDArray[np.float64]) -> F32:
    """(N, 3) light in directions of the front lens' frame."""
    import cv2

    truth, phone = shots.truth, shots.truth.phone
    made = np.zeros((len(in_front), 3), np.float32)
    for side in (FRONT, BACK):
        one = truth.side(side)
        directions = in_front if side == FRONT else in_front @ truth.rotation
        mine = (in_front[:, 2] <= 0) if side == FRONT else (in_front[:, 2] > 0)
        points, _ = project(phone.lens, one.circle, directions[mine])
        theta = np.arccos(np.clip(-directions[mine, 2], -1, 1))
        x, y = (points - 0.5).astype(np.float32).T
        found = np.empty((len(x), 3), np.float32)
        for start in range(0, len(x), 30_000):
            cut = slice(start, start + 30_000)
            at = (np.ascontiguousarray(x[cut, None]), np.ascontiguousarray(y[cut, None]))
            found[cut] = cv2.remap(one.clean, *at, cv2.INTER_LINEAR)[:, 0]
        made[mine] = found / phone.falloff_at(theta / phone.lens.half)[:, None]
    return made
