"""Directions above a surface as cells: 16 rings of equal angle × 64 equal parts of a turn, in its own frame.

A function of two directions that knows no azimuth of its own is block-circulant over such cells, so it comes
apart by Fourier series around the normal.
"""

from __future__ import annotations

import functools
import math

import numpy as np
import numpy.typing as npt

from studio_core.jit import kernel
from studio_core.kernels.directions import arctangent

F32 = npt.NDArray[np.float32]
U16 = npt.NDArray[np.uint16]

RINGS, PARTS = 16, 64
CELLS = RINGS * PARTS
_PER_RADIAN = RINGS / (math.pi / 2)
_PER_TURN = PARTS / (2 * math.pi)


@kernel
def cell_of(x: float, y: float, z: float) -> int:
    """The cell of a unit direction in the surface's frame (z is the normal); of z ≤ 0 the nearest one."""
    across, up = np.sqrt(x * x + y * y), max(z, 0.0)
    ring = min(int(_angle(across, up) * _PER_RADIAN), RINGS - 1)
    turn = _angle(abs(y), abs(x))
    if x < 0.0:
        turn = math.pi - turn
    if y < 0.0:
        turn = 2.0 * math.pi - turn
    return ring * PARTS + min(int(turn * _PER_TURN), PARTS - 1)


@kernel
def _angle(y: float, x: float) -> float:
    """atan2(y, x) for y, x ≥ 0 within 1e-7."""
    larger = max(x, y, 1e-30)
    made = float(arctangent(np.float32(min(x, y) / larger)))
    return math.pi / 2 - made if y > x else made


@kernel
def cells_of(directions: F32, out: U16) -> None:
    """out (N,): the cells of unit directions (N, 3)."""
    for i in range(len(directions)):
        out[i] = cell_of(directions[i, 0], directions[i, 1], directions[i, 2])


@functools.cache
def cell_directions() -> F32:
    """(CELLS, 3) unit directions in the middle of the cells."""
    theta = (np.arange(RINGS) + 0.5) / _PER_RADIAN
    phi = (np.arange(PARTS) + 0.5) / _PER_TURN
    theta, phi = np.repeat(theta, PARTS), np.tile(phi, RINGS)
    made = np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], axis=1)
    found: F32 = made.astype(np.float32)
    found.setflags(write=False)
    return found


@functools.cache
def cell_solid_angles() -> F32:
    """(CELLS,) steradians; 2π in all."""
    edges = np.cos(np.arange(RINGS + 1) / _PER_RADIAN)
    found: F32 = np.repeat((edges[:-1] - edges[1:]) / _PER_TURN, PARTS).astype(np.float32)
    found.setflags(write=False)
    return found


@functools.cache
def cell_projected_angles() -> F32:
    """(CELLS,) steradians times the cosine with the normal, exactly; π in all."""
    edges = np.cos(np.arange(RINGS + 1) / _PER_RADIAN) ** 2
    found: F32 = np.repeat((edges[:-1] - edges[1:]) / (2 * _PER_TURN), PARTS).astype(np.float32)
    found.setflags(write=False)
    return found
