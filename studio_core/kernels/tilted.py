"""Frames about normals that lean away from a vertex' own, and what differences between them say.

A leaning frame is given in the vertex' frame: rows t, b, n with n leaning by `slope` along +x, −x, +y, −y
(numbers 0 … 3), t as near to x as it can be. From light sums at the four, and at the vertex' own normal, come
the fields of `LayerRadiance.tilts`: with s the sine and c the cosine of the lean, (T₀ − T₁) / 2s for x,
(T₂ − T₃) / 2s for y, and ((T₀ + T₁ + T₂ + T₃) / 4 − T) / (1 − c) for 1 − z.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from studio_core.jit import kernel

F64 = npt.NDArray[np.float64]

LEANS = 4
FIELDS = 3
"""Components x, y and 1 − z of a normal."""
LEAST_LIGHT = np.float32(1e-3)
"""Smallest cosine that light's share of irradiance is divided by, and that kernels are asked for."""


@kernel
def leaning_frame(number: int, slope: float, out: F64) -> None:
    """Rows t, b, n of lean `number` in the vertex' frame."""
    length = np.sqrt(1.0 + slope * slope)
    s, c = slope / length, 1.0 / length
    if number % 2 == 1:
        s = -s
    if number < 2:
        out[0, 0], out[0, 1], out[0, 2] = c, 0.0, -s
        out[1, 0], out[1, 1], out[1, 2] = 0.0, 1.0, 0.0
        out[2, 0], out[2, 1], out[2, 2] = s, 0.0, c
    else:
        out[0, 0], out[0, 1], out[0, 2] = 1.0, 0.0, 0.0
        out[1, 0], out[1, 1], out[1, 2] = 0.0, c, -s
        out[2, 0], out[2, 1], out[2, 2] = 0.0, s, c


@kernel
def compose_frames(inner: F64, outer: F64, out: F64) -> None:
    """Rows of a frame that is given in another one, where that one is given."""
    for i in range(3):
        for j in range(3):
            out[i, j] = inner[i, 0] * outer[0, j] + inner[i, 1] * outer[1, j] + inner[i, 2] * outer[2, j]


@kernel
def lean_weights(number: int, slope: float) -> tuple[int, float, float]:
    """What a light sum at lean `number` counts: field 0 or 1, its weight there, and the weight in field 2.

    Number LEANS is the sum at the vertex' own normal: it counts in field 2 alone.
    """
    length = np.sqrt(1.0 + slope * slope)
    bend = slope * slope / (length * (length + 1.0))  # 1 − cosine
    if number == LEANS:
        return 0, 0.0, -1.0 / bend
    half = 0.5 * length / slope
    return number // 2, half if number % 2 == 0 else -half, 0.25 / bend


__all__ = ["FIELDS", "LEANS", "LEAST_LIGHT", "compose_frames", "lean_weights", "leaning_frame"]
