"""A room as a map, made by numbers, that simulated phones photograph."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt


def room(seed: int = 0, height: int = 256) -> npt.NDArray[np.float32]:
    """(height, 2 height, 3): walls, furniture-like blocks, lamps, and texture of every width."""
    import cv2

    rng = np.random.default_rng(seed)
    width = 2 * height
    tone = np.zeros((height, width))
    for size in (4, 8, 16, 32, 64, 128):
        grain = rng.normal(size=(size, 2 * size))
        grain = np.concatenate([grain, grain[:, :1]], axis=1)
        tone += 0.35 * cv2.resize(grain, (width, height), interpolation=cv2.INTER_CUBIC) * (8 / size) ** 0.4
    for _ in range(40):
        y, x = rng.integers(0, height), rng.integers(0, width)
        rows, columns = rng.integers(6, height // 4), rng.integers(6, width // 8)
        tone[y : y + rows, (x + np.arange(columns)) % width] += rng.normal(0, 0.8)
    light = 2.0 ** tone[..., None] * (1 + 0.2 * rng.normal(size=3))
    for _ in range(4):
        y, x = rng.integers(0, height // 2), rng.integers(0, width)
        light[y : y + 6, (x + np.arange(8)) % width] = 60.0
    return np.ascontiguousarray(np.maximum(light, 1e-3), np.float32)
