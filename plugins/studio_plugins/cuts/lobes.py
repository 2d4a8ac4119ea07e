"""How sharp a reflectance model's kernels are, found by asking the kernels themselves.

So no model has to say it, and models of other plugins are treated like our own.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from studio_core.jit import call_address, kernel
from studio_core.shading.artifacts import Shapes

F32 = npt.NDArray[np.float32]

FLAT = 1e-5  # relative variation up to which a kernel counts as constant
_ARC = np.concatenate([[0.0], np.geomspace(1e-4, 0.999 * np.pi / 2, 160)])


def _from(*degrees: float) -> tuple[F32, ...]:
    return tuple(np.array([np.sin(a), 0, np.cos(a)], np.float32) for a in np.radians(degrees))


def _hemisphere() -> F32:
    rng = np.random.default_rng(1)
    z = (np.arange(256) + 0.5) / 256
    turn = 2 * np.pi * rng.random(256)
    r = np.sqrt(1 - z * z)
    return np.stack([r * np.cos(turn), r * np.sin(turn), z]).astype(np.float32).ravel()


_VIEWS = _from(0.0, 35.0, 65.0)
_AROUND = _hemisphere()
_ALONG = np.stack([np.sin(_ARC), np.zeros_like(_ARC), np.cos(_ARC)]).astype(np.float32).ravel()


@kernel
def _evaluate(address: int, shape: F32, wo: F32, count: int, wi: F32, out: F32) -> None:
    call_address(address, shape, wo, count, wi, out)


@dataclass(frozen=True)
class Lobe:
    """`flat`: every kernel is the same for all directions of light. `slope`: the α of the microfacets whose
    lobe is as wide as the kernels together, seen from above; 0: they have no peak."""

    flat: bool
    slope: float


class LobeTable:
    """Lobes of rows of shapes, kept by kernel and shape."""

    def __init__(self) -> None:
        self._kept: dict[tuple[int, int, bytes], Lobe] = {}

    def __call__(self, shapes: Shapes) -> list[Lobe]:
        """One a row."""
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
    flat = True
    for view in _VIEWS:
        values = _values(address, terms, shape, view, _AROUND)
        spread = values.max(axis=1) - values.min(axis=1)
        flat &= bool((spread <= FLAT * np.abs(values).max(axis=1)).all())
    arc = _values(address, terms, shape, _VIEWS[0], _ALONG).sum(axis=0)
    if flat or not arc[0] > 0 or arc.min() >= (1 - FLAT) * arc[0]:
        return Lobe(flat, 0.0)
    below = np.flatnonzero(arc < 0.5 * (arc[0] + arc.min()))[0]
    # D of GGX (Walter et al. 2007, eq. 33) has fallen by half where tan θ_h = α √(√2 − 1).
    return Lobe(False, float(np.tan(_ARC[below] / 2) / np.sqrt(np.sqrt(2) - 1)))


def _values(address: int, terms: int, shape: F32, wo: F32, wi: F32) -> npt.NDArray[np.float64]:
    """(terms, N) of kernels for directions wi (3, N), flat."""
    count = len(wi) // 3
    out = np.zeros(terms * count, np.float32)
    _evaluate(address, shape, wo, count, wi, out)
    return out.reshape(terms, -1).astype(np.float64)
