"""A reflectance model at many pairs of directions, each of them another view."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from studio_core.contract import Brdf
from studio_core.jit import call_address, kernel

F32 = npt.NDArray[np.float32]


@kernel
def _evaluate(address: int, shape: F32, wo: F32, wi: F32, out: F32) -> None:
    for n in range(len(wo)):
        call_address(address, shape, wo[n], 1, wi[n], out[n])


def evaluate_pairs(brdf: Brdf, shape: F32, wo: F32, wi: F32) -> F32:
    """(N, terms) kernels b_k of pairs wo (N, 3) and wi (N, 3), without the cosine."""
    seen, lit = np.ascontiguousarray(wo, np.float32), np.ascontiguousarray(wi, np.float32)
    if seen.ndim != 2 or seen.shape[1] != 3 or seen.shape != lit.shape:
        raise ValueError(f"two arrays (N, 3) expected, not {seen.shape} and {lit.shape}")
    out = np.zeros((len(seen), brdf.terms), np.float32)
    data = np.append(np.asarray(shape, np.float32).ravel(), np.float32(0))  # never empty
    _evaluate(brdf.address, data, seen, lit, out)
    return out
