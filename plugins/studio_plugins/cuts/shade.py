"""The BRDF sum: equation (3) of Iwasaki et al. per BRDF term, over the nodes of each vertex."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from studio_core.jit import call_address, kernel
from studio_core.kernels.radiance import local_view, surface_frame

F32 = npt.NDArray[np.float32]
I32 = npt.NDArray[np.int32]
I64 = npt.NDArray[np.int64]
Bools = npt.NDArray[np.bool_]


@kernel
def node_terms(
    block: int,
    points: I64,
    first: I64,
    data: F32,
    owner: I32,
    wanted: Bools,
    most: int,
    positions: F32,
    normals: F32,
    tangents: F32,
    material: I32,
    eye: F32,
    address: I64,
    terms: I64,
    offset: I64,
    shapes: F32,
    out_terms: F32,
) -> int:
    """Adds to terms (V, T, 3) of those of the points that are wanted and owned by this block.

    T_k = Σ_n E_n b_k(ω_n, ω_o) for the nodes n of a point, of which none has over `most`; ω_o leads to the
    eye. Returns how many nodes were looked at.
    """
    axes = np.empty((3, 3))
    wo = np.empty(3, np.float32)
    values = np.empty(out_terms.shape[1] * most, np.float32)
    looked = 0
    for number in range(len(points)):
        p = points[number]
        if p < 0 or owner[p] != block or not wanted[p]:
            continue
        count = first[number + 1] - first[number]
        if count == 0:
            continue
        looked += count
        m = material[p]
        surface_frame(normals[p], tangents[p], axes)
        local_view(positions[p], eye, axes, wo)
        base = 6 * first[number]
        call_address(address[m], shapes[offset[m] :], wo, count, data[base:], values)
        red = data[base + 3 * count : base + 4 * count]
        green = data[base + 4 * count : base + 5 * count]
        blue = data[base + 5 * count : base + 6 * count]
        for k in range(terms[m]):
            r, g, b = np.float32(0), np.float32(0), np.float32(0)
            for i in range(count):
                value = values[k * count + i]
                r += red[i] * value
                g += green[i] * value
                b += blue[i] * value
            out_terms[p, k, 0] += r
            out_terms[p, k, 1] += g
            out_terms[p, k, 2] += b
    return looked
