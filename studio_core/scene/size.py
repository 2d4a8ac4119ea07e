"""How large an imported model is, and whether that can be meant."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from studio_core.contract import ImportedModel
from studio_core.scene.nodes import Scene

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
