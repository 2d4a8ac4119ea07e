"""How sharp a reflectance model's kernels are, found by asking the kernels themselves.

So no model has to say it, and models of other plugins are treated like our own.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from studio_core.jit import call_address, kernel
from studio_core.shading.artifacts import Shapes

F32 = npt.NDArray[np.float32]

FLAT = 1e-5  # relative variation up to which a kernel counts as constant
_VIEWS = np.radians([0.0, 35.0, 65.0])
_ARC = np.concatenate([[0.0], np.geomspace(1e-4, np.pi / 2, 160)])


@kernel
def _evaluate(address: int, shape: F32, wo: F32, count: int, wi: F32, out: F32) -> None:
    call_address(address, shape, wo, count, wi, out)


@dataclass(frozen=True)
class Lobe:
    """`flat`: every kernel is the same for all directions of light. `width`: radians from the mirror
    direction towards the normal to where the kernels together have fallen by half; inf without a peak."""

    flat: bool
    width: float


class LobeTable:
    """Lobes of materials, kept by kernel and shape."""

    def __init__(self) -> None:
        self._kept: dict[tuple[int, int, bytes], Lobe] = {}

    def __call__(self, shapes: Shapes) -> list[Lobe]:
        """One a material."""
        bounds = np.append(shapes.offset, len(shapes.data))
        made = []
        for m in range(len(shapes.address)):
            shape = np.ascontiguousarray(shapes.data[bounds[m] : bounds[m + 1]])
            key = int(shapes.address[m]), int(shapes.terms[m]), shape.tobytes()
            if key not in self._kept:
                if len(self._kept) > 4096:
                    self._kept.clear()
                self._kept[key] = probe(key[0], key[1], shape)
            made.append(self._kept[key])
        return made


def probe(address: int, terms: int, shape: F32) -> Lobe:
    """The lobe of one kernel; see `Lobe`."""
    if len(shape) == 0:
        shape = np.zeros(1, np.float32)
    flat, width = True, float("inf")
    every = _hemisphere()
    for view in _VIEWS:
        values = _values(address, terms, shape, view, every)
        spread = values.max(axis=1) - values.min(axis=1)
        flat &= bool((spread <= FLAT * np.abs(values).max(axis=1)).all())
        # From the mirror direction towards the normal and beyond, in the plane of incidence.
        angles = view - _ARC
        along = np.stack([-np.sin(angles), np.zeros_like(angles), np.cos(angles)], axis=1)
        seen = along[:, 2] > 1e-3
        arc = _values(address, terms, shape, view, along[seen]).sum(axis=0)
        if arc[0] > 0 and arc.min() < (1 - FLAT) * arc[0]:
            half = 0.5 * (arc[0] + arc.min())
            width = min(width, float(_ARC[seen][np.flatnonzero(arc < half)[0]]))
    return Lobe(flat, width)


def _hemisphere() -> npt.NDArray[np.float64]:
    rng = np.random.default_rng(1)
    z = (np.arange(256) + 0.5) / 256
    turn = 2 * np.pi * rng.random(256)
    r = np.sqrt(1 - z * z)
    return np.stack([r * np.cos(turn), r * np.sin(turn), z], axis=1)


def _values(address: int, terms: int, shape: F32, view: float, directions: Any) -> npt.NDArray[np.float64]:
    wo = np.array([np.sin(view), 0, np.cos(view)], np.float32)
    wi = np.ascontiguousarray(np.asarray(directions, np.float32).T).ravel()
    out = np.zeros(terms * len(directions), np.float32)
    _evaluate(address, shape, wo, len(directions), wi, out)
    return out.reshape(terms, -1).astype(np.float64)
