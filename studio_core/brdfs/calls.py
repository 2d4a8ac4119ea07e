"""The C functions of a reflectance model, called from Python on many directions at once.

Directions are unit vectors away from the surface in the shading frame (z = normal). Calls release the
interpreter lock.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt

from studio_core.contract import Brdf, SampledBrdf

F32 = npt.NDArray[np.float32]

_P, _I = ctypes.c_void_p, ctypes.c_int64
_EVALUATE = ctypes.CFUNCTYPE(None, _P, _P, _I, _P, _P)
_SAMPLE = ctypes.CFUNCTYPE(None, _P, _P, _I, _I, _P, _P)


def evaluate(brdf: Brdf, shape: F32, wo: npt.ArrayLike, wi: npt.ArrayLike) -> F32:
    """(N, terms) kernels b_k of one direction wo (3,) and many wi (N, 3), without the cosine."""
    return _values(_EVALUATE(brdf.address), brdf.terms, shape, wo, wi)


def evaluate_at(address: int, terms: int, shape: F32, wo: npt.ArrayLike, wi: npt.ArrayLike) -> F32:
    """`evaluate` where the model's address alone is known, as in `studio_core.shading.artifacts.Shapes`."""
    return _values(_EVALUATE(address), terms, shape, wo, wi)


def is_sampled(brdf: Brdf) -> bool:
    """Whether the model draws directions itself; `sample` and `density` need that."""
    return bool(getattr(brdf, "sampler", 0)) and bool(getattr(brdf, "density", 0))


def sample(brdf: SampledBrdf, shape: F32, wo: npt.ArrayLike, term: int, u: npt.ArrayLike) -> F32:
    """(N, 3) directions drawn for one term from u (N, 2) in [0, 1); z ≤ 0 where none was found."""
    data, direction, columns = _shape(shape), _one(wo), _columns(u, 2)
    made = np.zeros((3, columns.shape[1]), np.float32)
    _SAMPLE(brdf.sampler)(
        data.ctypes.data, direction.ctypes.data, term, columns.shape[1], columns.ctypes.data, made.ctypes.data
    )
    return made.T


def density(brdf: SampledBrdf, shape: F32, wo: npt.ArrayLike, wi: npt.ArrayLike) -> F32:
    """(N, terms) density per steradian with which `sample` draws the directions wi (N, 3) for each term."""
    return _values(_EVALUATE(brdf.density), brdf.terms, shape, wo, wi)


def repeatable(brdf: Brdf, shape: F32, wo: npt.ArrayLike, wi: npt.ArrayLike) -> Callable[[], F32]:
    """`evaluate` with everything prepared: each call runs the kernel alone, into the same array."""
    return _repeatable(_EVALUATE(brdf.address), brdf.terms, shape, wo, wi)


def _values(call: Any, terms: int, shape: F32, wo: npt.ArrayLike, wi: npt.ArrayLike) -> F32:
    return _repeatable(call, terms, shape, wo, wi)()


def _repeatable(call: Any, terms: int, shape: F32, wo: npt.ArrayLike, wi: npt.ArrayLike) -> Callable[[], F32]:
    data, direction, columns = _shape(shape), _one(wo), _columns(wi, 3)
    out = np.zeros((terms, columns.shape[1]), np.float32)
    arrays = data, direction, columns, out  # kept alive by the closure
    places = [array.ctypes.data for array in arrays]

    def again() -> F32:
        call(places[0], places[1], arrays[2].shape[1], places[2], places[3])
        return arrays[3].T

    return again


def _shape(shape: F32) -> F32:
    return np.ascontiguousarray(shape, np.float32)


def _one(direction: npt.ArrayLike) -> F32:
    made = np.ascontiguousarray(direction, np.float32)
    if made.shape != (3,):
        raise ValueError(f"one direction (3,) expected, not {made.shape}")
    return made


def _columns(values: npt.ArrayLike, width: int) -> F32:
    rows = np.asarray(values, np.float32)
    if rows.ndim != 2 or rows.shape[1] != width:
        raise ValueError(f"(N, {width}) expected, not {rows.shape}")
    return np.ascontiguousarray(rows.T)


__all__ = ["density", "evaluate", "evaluate_at", "is_sampled", "repeatable", "sample"]
