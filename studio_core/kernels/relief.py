"""Normal maps in pixels: what the light of a hit changes by with the normal that its map has there.

Vertices carry one colour for each component (x, y, 1 − z) of a normal: `bend` (V, 18) has Σ plain · tilt of
the three, then the same with slope, for materials whose coefficients are affine in a texel. Those with
coefficients of a map of their own have the first with typical coefficients, and in 9:12 what these make of
the vertex' light: there the light of a hit changes in proportion.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from studio_core.jit import kernel
from studio_core.kernels.compose import (
    AFFINE,
    CONSTANT,
    GENERAL,
    map_level,
    mix,
    neighbours,
    repeated,
    texels_covered,
)

F32 = npt.NDArray[np.float32]
I32 = npt.NDArray[np.int32]
I64 = npt.NDArray[np.int64]
U32 = npt.NDArray[np.uint32]
Bools = npt.NDArray[np.bool_]

BEND = 18
"""Floats of a vertex."""
DARK = 1e-12
"""Typical light that nothing can be in proportion to."""
SHORTEST = np.float32(0.1)
"""Least length of a mean normal that is made stronger."""
_ZERO, _ONE = np.float32(0), np.float32(1)


@kernel
def add_tilts(
    start: int,
    stop: int,
    terms: F32,
    tilts: F32,
    gain: F32,
    valid: Bools,
    material: I32,
    kind: I64,
    mapped: Bools,
    plain: F32,
    slope: F32,
    typical: F32,
    painted: F32,
    bend: F32,
) -> None:
    """Adds one light layer's tilts (V, 3, T·3) at `gain` (3,) to bend (V, BEND) of vertices start … stop−1.

    Only of those that are valid and of materials with maps, mapped (M,); terms (V, T·3), plain, slope and
    typical (M, T·3), painted (V, T·3) or empty.
    """
    width = terms.shape[1]
    for v in range(start, stop):
        m = material[v]
        if not valid[v] or m < 0 or not mapped[m]:
            continue
        rows = typical if kind[m] == GENERAL else plain
        coated = len(painted) > 0
        for f in range(3):
            for c in range(3):
                base, rise = _ZERO, _ZERO
                for k in range(c, width, 3):
                    own = rows[m, k] + painted[v, k] if coated else rows[m, k]
                    base += own * tilts[v, f, k]
                    rise += slope[m, k] * tilts[v, f, k]
                bend[v, 3 * f + c] += gain[c] * base
                if kind[m] == AFFINE:
                    bend[v, 9 + 3 * f + c] += gain[c] * rise
        if kind[m] == GENERAL:
            for c in range(3):
                base = _ZERO
                for k in range(c, width, 3):
                    base += rows[m, k] * terms[v, k]
                bend[v, 9 + c] += gain[c] * base


@kernel
def strengthened(
    x: np.float32, y: np.float32, z: np.float32, strong: np.float32
) -> tuple[np.float32, np.float32, np.float32]:
    """Components x, y, 1 − z of a mean normal whose slopes are multiplied by `strong`.

    What it is shorter by than a unit normal, the spread of what it is a mean of, grows by the square.
    """
    if strong == _ONE:
        return x, y, z
    up = _ONE - z
    spread = max(_ONE - np.sqrt(x * x + y * y + up * up), _ZERO)
    x, y = strong * x, strong * y
    length = max(_ONE - strong * strong * spread, SHORTEST)
    length /= max(np.sqrt(x * x + y * y + up * up), DARK)
    return x * length, y * length, _ONE - up * length


@kernel
def add_relief(
    start: int,
    stop: int,
    face: I32,
    u: F32,
    v: F32,
    distance: F32,
    shown: U32,
    height: F32,
    face_material: I32,
    kind: I64,
    record: F32,
    texels: F32,
    first: I64,
    size: I64,
    levels: I64,
    uv_map: F32,
    pixel_angle: float,
    density: F32,
    bend: F32,
    fine: F32,
    where: I64,
    extent: I64,
    depth: I64,
    laid: F32,
    tightness: F32,
    out: F32,
) -> None:
    """Changes the radiance out (stop − start, 3) of hits start … stop−1 on what has a normal map.

    As for `compose.shade_hits`, whose colours `out` has; normal maps are `fine` (R, 3), where (M, L),
    extent (M, L, 2), depth (M,) levels (0: the material has none), laid (M, 11), and
    tightness (F,) their texels a metre. No colour falls below 0.
    """
    for n in range(start, stop):
        f = face[n]
        if f < 0:
            continue
        m = face_material[f]
        if m < 0 or depth[m] == 0:
            continue
        i, j, k = np.int64(shown[f, 0]), np.int64(shown[f, 1]), np.int64(shown[f, 2])
        w1, w2 = u[n], v[n]
        su = mix(record[i, 6], record[j, 6], record[k, 6], w1, w2)
        sv = mix(record[i, 7], record[j, 7], record[k, 7], w1, w2)
        tu = repeated(su, sv, laid[m, 0], laid[m, 1], laid[m, 2])
        tv = repeated(su, sv, laid[m, 3], laid[m, 4], laid[m, 5])
        level = map_level(depth[m], texels_covered(distance[n], height[f], tightness[f], pixel_angle))
        begin, wide = where[m, level], extent[m, level, 1]
        top, bottom, fy = neighbours(tv, extent[m, level, 0])
        left, right, fx = neighbours(tu, wide)
        a, b = begin + top * wide + left, begin + top * wide + right
        c, d = begin + bottom * wide + left, begin + bottom * wide + right
        wa, wb = (_ONE - fx) * (_ONE - fy), fx * (_ONE - fy)
        wc, wd = (_ONE - fx) * fy, fx * fy
        p = wa * fine[a, 0] + wb * fine[b, 0] + wc * fine[c, 0] + wd * fine[d, 0]
        q = wa * fine[a, 1] + wb * fine[b, 1] + wc * fine[c, 1] + wd * fine[d, 1]
        z = wa * fine[a, 2] + wb * fine[b, 2] + wc * fine[c, 2] + wd * fine[d, 2]
        p, q, z = strengthened(p, q, z, laid[m, 10])
        x, y = laid[m, 6] * p + laid[m, 7] * q, laid[m, 8] * p + laid[m, 9] * q
        coloured = kind[m] == AFFINE
        r, g, s = _ZERO, _ZERO, _ZERO
        if coloured:
            tu = repeated(su, sv, uv_map[m, 0], uv_map[m, 1], uv_map[m, 2])
            tv = repeated(su, sv, uv_map[m, 3], uv_map[m, 4], uv_map[m, 5])
            level = map_level(levels[m], texels_covered(distance[n], height[f], density[f], pixel_angle))
            begin, wide = first[m, level], size[m, level, 1]
            top, bottom, fy = neighbours(tv, size[m, level, 0])
            left, right, fx = neighbours(tu, wide)
            a, b = begin + top * wide + left, begin + top * wide + right
            c, d = begin + bottom * wide + left, begin + bottom * wide + right
            wa, wb = (_ONE - fx) * (_ONE - fy), fx * (_ONE - fy)
            wc, wd = (_ONE - fx) * fy, fx * fy
            r = wa * texels[a, 0] + wb * texels[b, 0] + wc * texels[c, 0] + wd * texels[d, 0]
            g = wa * texels[a, 1] + wb * texels[b, 1] + wc * texels[c, 1] + wd * texels[d, 1]
            s = wa * texels[a, 2] + wb * texels[b, 2] + wc * texels[c, 2] + wd * texels[d, 2]
        for channel in range(3):
            more = x * mix(bend[i, channel], bend[j, channel], bend[k, channel], w1, w2)
            more += y * mix(bend[i, 3 + channel], bend[j, 3 + channel], bend[k, 3 + channel], w1, w2)
            more += z * mix(bend[i, 6 + channel], bend[j, 6 + channel], bend[k, 6 + channel], w1, w2)
            before = out[n - start, channel]
            if coloured:
                rise = x * mix(bend[i, 9 + channel], bend[j, 9 + channel], bend[k, 9 + channel], w1, w2)
                rise += y * mix(bend[i, 12 + channel], bend[j, 12 + channel], bend[k, 12 + channel], w1, w2)
                rise += z * mix(bend[i, 15 + channel], bend[j, 15 + channel], bend[k, 15 + channel], w1, w2)
                more += rise * (r if channel == 0 else (g if channel == 1 else s))
            elif kind[m] != CONSTANT:
                usual = mix(bend[i, 9 + channel], bend[j, 9 + channel], bend[k, 9 + channel], w1, w2)
                more *= before / usual if usual > DARK else _ZERO
            out[n - start, channel] = max(before + more, _ZERO)


__all__ = ["BEND", "DARK", "SHORTEST", "add_relief", "add_tilts", "strengthened"]
