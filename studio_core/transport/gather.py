"""What a surface receives from others: cached hits times what the vertices that they met send back.

A vertex v sends matte radiance D[v] in all directions and Σ_k g_k(ω) L[v, k] beside it, together never less
than nothing: a separated BRDF (`separable`). D is (V, 3); L is flat, (3 S,), the functions of a vertex one
colour after the other from 3 · slot on. Kept hits name a vertex and the cell of the direction back, so light
goes on from surface to surface without a ray: D and L at the receiver are sums over its row (Iwasaki et al.
2007, equations 3 and 4, with rays in the place of radiance fields).
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from studio_core.jit import kernel
from studio_core.transport.hits import BLACK

F32 = npt.NDArray[np.float32]
I32 = npt.NDArray[np.int32]
I64 = npt.NDArray[np.int64]
U16 = npt.NDArray[np.uint16]
U32 = npt.NDArray[np.uint32]

ZERO = np.float32(0.0)
MOST = 256  # functions of a vertex


@kernel
def gather_bounce(
    start: int,
    stop: int,
    scale: F32,
    rows: I64,
    variant: I32,
    hit_vertex: U32,
    hit_cell: U16,
    ray_cell: U16,
    matte: F32,
    slot: I64,
    row: I32,
    base: I64,
    count: I64,
    outgoing: F32,
    incoming: F32,
    functions: F32,
    irradiance: F32,
    received: F32,
) -> None:
    """Adds to receivers rows[start:stop]: irradiance (V, 3), and received (S, 3) = Σ rays · h_k.

    hit_vertex, hit_cell (R, N) of cosine-distributed rays; scale (V,) is what one ray of a vertex weighs, π
    over how many it has in all; ray_cell (P, N) the cells of the rays of every variant of the pattern, in the
    receiver's frame, and variant (R,) the one of each row;
    matte (V, 3), functions (3 S,) what vertices send; slot (V,) where a vertex' functions start in S, or −1;
    row (V,) its row of the separated BRDFs, whose functions are base, count, outgoing and incoming.
    """
    many_rays = hit_vertex.shape[1]
    sums = np.zeros((3, MOST), np.float32)
    for i in range(start, stop):
        receiver = rows[i]
        first = slot[receiver]
        many, own = np.int64(0), np.int64(0)
        if first >= 0:
            many, own = np.int64(min(count[row[receiver]], MOST)), base[row[receiver]]
        for k in range(many):
            sums[0, k] = sums[1, k] = sums[2, k] = ZERO
        red, green, blue = ZERO, ZERO, ZERO
        for j in range(many_rays):
            vertex = np.int64(hit_vertex[i, j])
            if vertex >= BLACK:
                continue
            r, g, b = matte[vertex, 0], matte[vertex, 1], matte[vertex, 2]
            source = slot[vertex]
            if source >= 0:  # also in the final gather: handing arrays to a helper costs 20 times the sum
                its = count[row[vertex]]
                at = base[row[vertex]] + np.int64(hit_cell[i, j]) * its
                source *= 3
                for k in range(its):
                    weight = outgoing[at + k]
                    r += weight * functions[source + k]
                    g += weight * functions[source + its + k]
                    b += weight * functions[source + 2 * its + k]
                r, g, b = max(r, ZERO), max(g, ZERO), max(b, ZERO)
            red += r
            green += g
            blue += b
            if many > 0:
                at = own + np.int64(ray_cell[variant[i], j]) * many
                for k in range(many):
                    weight = incoming[at + k]
                    sums[0, k] += weight * r
                    sums[1, k] += weight * g
                    sums[2, k] += weight * b
        each = scale[receiver]
        irradiance[receiver, 0] += red * each
        irradiance[receiver, 1] += green * each
        irradiance[receiver, 2] += blue * each
        for k in range(many):
            received[first + k, 0] += sums[0, k] * each
            received[first + k, 1] += sums[1, k] * each
            received[first + k, 2] += sums[2, k] * each


@kernel
def send(
    start: int,
    stop: int,
    vertex: I64,
    cell: I64,
    matte: F32,
    slot: I64,
    row: I32,
    base: I64,
    count: I64,
    outgoing: F32,
    functions: F32,
    out: F32,
) -> None:
    """out (K, 3): what each of vertices (K,) sends towards a cell of its own, for start … stop−1."""
    for i in range(start, stop):
        v = vertex[i]
        r, g, b = matte[v, 0], matte[v, 1], matte[v, 2]
        source = slot[v]
        if source >= 0:
            its = count[row[v]]
            at = base[row[v]] + cell[i] * its
            source *= 3
            for k in range(its):
                weight = outgoing[at + k]
                r += weight * functions[source + k]
                g += weight * functions[source + its + k]
                b += weight * functions[source + 2 * its + k]
            r, g, b = max(r, ZERO), max(g, ZERO), max(b, ZERO)
        out[i, 0], out[i, 1], out[i, 2] = r, g, b


@kernel
def reflect(
    start: int,
    stop: int,
    irradiance: F32,
    received: F32,
    coefficients: F32,
    slot: I64,
    row: I32,
    matte_terms: F32,
    count: I64,
    first: I64,
    term: I32,
    matte: F32,
    functions: F32,
) -> None:
    """What vertices start … stop−1 send back of what they receive.

    D = Σ_t c_t m_t E with the constant terms m (R, T), L_k = c_t(k) · received_k; coefficients c (V, T, 3);
    functions of row r are first[r] … in `term`. Written to matte (V, 3) and functions (3 S,).
    """
    terms = min(matte_terms.shape[1], coefficients.shape[1])
    for v in range(start, stop):
        r = row[v]
        for c in range(3):
            matte[v, c] = 0.0
        if r < 0:
            continue
        for c in range(3):
            albedo = 0.0
            for t in range(terms):
                albedo += matte_terms[r, t] * coefficients[v, t, c]
            matte[v, c] = albedo * irradiance[v, c]
        own = slot[v]
        if own < 0:
            continue
        for k in range(count[r]):
            t = term[first[r] + k]
            for c in range(3):
                functions[3 * own + c * count[r] + k] = coefficients[v, t, c] * received[own + k, c]


@kernel
def uncover(
    start: int,
    stop: int,
    covered: I64,
    others: I32,
    weights: F32,
    slot: I64,
    row: I32,
    count: I64,
    irradiance: F32,
    received: F32,
) -> None:
    """Vertices covered[start:stop] receive what their neighbours others (C, N) do, as much as weights say.

    −1 among the others ends a row. Functions are taken over from neighbours of the same row of BRDFs.
    """
    for i in range(start, stop):
        v = covered[i]
        red, green, blue, total = ZERO, ZERO, ZERO, ZERO
        for n in range(others.shape[1]):
            u = others[i, n]
            if u < 0:
                break
            red += weights[i, n] * irradiance[u, 0]
            green += weights[i, n] * irradiance[u, 1]
            blue += weights[i, n] * irradiance[u, 2]
            total += weights[i, n]
        if total <= ZERO:
            continue
        irradiance[v, 0], irradiance[v, 1], irradiance[v, 2] = red / total, green / total, blue / total
        first = slot[v]
        if first < 0:
            continue
        total = ZERO
        many = count[row[v]]
        for k in range(many):
            for c in range(3):
                received[first + k, c] = ZERO
        for n in range(others.shape[1]):
            u = others[i, n]
            if u < 0:
                break
            if row[u] != row[v]:
                continue
            total += weights[i, n]
            for k in range(many):
                for c in range(3):
                    received[first + k, c] += weights[i, n] * received[slot[u] + k, c]
        if total > ZERO:
            for k in range(many):
                for c in range(3):
                    received[first + k, c] /= total
