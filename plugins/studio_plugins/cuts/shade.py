"""The BRDF sum: equation (3) of Iwasaki et al. per BRDF term, over the nodes of each vertex."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from studio_core.jit import call_address, kernel
from studio_core.kernels.radiance import local_view, surface_frame
from studio_core.kernels.tilted import LEANS, LEAST_LIGHT, compose_frames, lean_weights, leaning_frame

F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]
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
    tilt: F32,
    out_terms: F32,
    out_tilts: F32,
) -> int:
    """Adds to terms (V, T, 3) of those of the points that are wanted and owned by this block.

    T_k = Σ_n E_n b_k(ω_n, ω_o) for the nodes n of a point, of which none has over `most`; ω_o leads to the
    eye. Where rows have a `tilt` (R,), the same at leaning normals is added to tilts (V, FIELDS, T, 3); both
    are empty where none has. Returns how many nodes were looked at.
    """
    lean = np.empty((3, 3))
    leaning = np.empty(6 * most if len(out_tilts) else 0, np.float32)
    axes, turned = np.empty((3, 3)), np.empty((3, 3))
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
        steep = float(tilt[m]) if len(out_tilts) else 0.0
        if steep > 0:
            _add(LEANS, steep, values, count, terms[m], data[base + 3 * count :], out_tilts[p])
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
        if steep > 0:
            for lean_number in range(LEANS):
                leaning_frame(lean_number, steep, lean)
                _lean(lean, data[base:], count, leaning)
                compose_frames(lean, axes, turned)
                local_view(positions[p], eye, turned, wo)
                call_address(address[m], shapes[offset[m] :], wo, count, leaning, values)
                _add(lean_number, steep, values, count, terms[m], leaning[3 * count :], out_tilts[p])
            looked += LEANS * count
    return looked


@kernel
def _lean(frame: F64, nodes: F32, count: int, out: F32) -> None:
    """Nodes as they are in a leaning frame: turned, with the light that arrives at its surface.

    Light that sets there, or is lower than a kernel has values for, is none.
    """
    for i in range(count):
        x, y, z = nodes[i], nodes[count + i], nodes[2 * count + i]
        up = np.float32(frame[2, 0] * x + frame[2, 1] * y + frame[2, 2] * z)
        out[i] = frame[0, 0] * x + frame[0, 1] * y + frame[0, 2] * z
        out[count + i] = frame[1, 0] * x + frame[1, 1] * y + frame[1, 2] * z
        out[2 * count + i] = max(up, LEAST_LIGHT)
        share = max(up, np.float32(0)) / max(z, LEAST_LIGHT)
        for line in range(3, 6):
            out[line * count + i] = share * nodes[line * count + i]


@kernel
def _add(lean: int, steep: float, values: F32, count: int, terms: int, light: F32, out: F32) -> None:
    """Adds a sum over nodes, light (3·count,), to the fields out (FIELDS, T, 3) as it counts in them."""
    field, weight, bend = lean_weights(lean, steep)
    for k in range(terms):
        for c in range(3):
            total = np.float32(0)
            for i in range(count):
                total += light[c * count + i] * values[k * count + i]
            out[field, k, c] += weight * total
            out[2, k, c] += bend * total
