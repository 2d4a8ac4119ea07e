"""Refined vertices while something moves: what they get from the vertices they lie between.

Where their irradiance is known it is theirs, so that shadows keep their edges while the eye moves; only how
much of it goes to the eye is taken from the neighbours. Elsewhere both are, and the picture is for so long
that of the unrefined mesh.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from studio_core.kernels.refinement import prolong

F32 = npt.NDArray[np.float32]
I64 = npt.NDArray[np.int64]
Bools = npt.NDArray[np.bool_]

_DARK = np.float32(1e-12)


def fill(between: I64, wanted: Bools, settled: Bools, terms: F32, irradiance: F32) -> None:
    """Sets terms (V, T, 3) and, but for the settled, irradiance (V, 3) of wanted vertices from `between`."""
    unknown = wanted & ~settled
    if unknown.any():
        prolong(between, ~unknown, irradiance)
    whole = np.maximum(irradiance, _DARK)[:, None]
    share = np.asarray(terms / whole, np.float32).reshape(len(terms), -1)
    prolong(between, ~wanted, share)
    terms[wanted] = share.reshape(terms.shape)[wanted] * irradiance[wanted][:, None]
