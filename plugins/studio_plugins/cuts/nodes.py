"""Cut nodes of shading points: the light that arrives, as a few directions with an irradiance each.

Equation (3) of Iwasaki et al., B(x, ω_o) ≈ Σ_k l_k v_k f_r(ω_k, ω_o): node k of a point is the direction
ω_k in the point's shading frame and l_k v_k, what it adds to the irradiance. Both paths make them, the
exact one and the paper's; only the sum over BRDFs follows.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

F32 = npt.NDArray[np.float32]
I64 = npt.NDArray[np.int64]

FLOATS = 6  # a node: x, y, z, red, green, blue


@dataclass(frozen=True)
class NodeBlock:
    """The nodes of some points, as BRDF kernels read them.

    points (P,) rows of the mesh; first (P + 1,) number of each point's first node; data (6 N,): of a point
    with n nodes, from 6·first: x[n], y[n], z[n] (unit, in the shading frame of `kernels.radiance.frame`),
    red[n], green[n], blue[n] (L·V·cosθ·Δω of the node).
    """

    points: I64
    first: I64
    data: F32

    @property
    def nbytes(self) -> int:
        """Bytes of all arrays."""
        return self.points.nbytes + self.first.nbytes + self.data.nbytes
