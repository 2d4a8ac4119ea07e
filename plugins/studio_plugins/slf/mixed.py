"""The paper's choice (`paper.choose`, with true minima) as one pass, for all elements of a scene at once."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from studio_core.jit import kernel
from studio_plugins.slf.paper import (
    BOTH,
    DIFFUSE,
    KEPT,
    PIVOT,
    SPECULAR,
    TINY,
    WEIGHTS,
    Chosen,
    Solver,
    Systems,
)

F64 = npt.NDArray[np.float64]
I64 = npt.NDArray[np.int64]
Bools = npt.NDArray[np.bool_]
_SOLVERS: dict[Solver, int] = {"l0": 0, "mixed": 1, "l2": 2}
_ONE, _TWO, _THREE = WEIGHTS[1:]


def choose_all(systems: Systems, solver: Solver) -> Chosen:
    """As `paper.choose(systems, solver)`."""
    channels, levels = systems.channels, systems.c22.shape[1]
    elements = len(systems.c22) // channels
    now = np.maximum(np.nan_to_num(systems.now), 0)
    now = np.ascontiguousarray(now / np.maximum(now.sum(axis=1, keepdims=True), 1))
    found, residual = now.copy(), np.zeros(elements)
    level, kind = np.array(systems.level, np.int64), np.full(elements, KEPT)
    flagged = np.ones(elements, np.bool_)
    single = np.stack([systems.c11, systems.d1, systems.bb], axis=1)
    each = np.stack([systems.c12, systems.c22, systems.d2], axis=2)
    if levels:
        pick(channels, _SOLVERS[solver], single, each, now, found, level, kind, residual, flagged)
    return Chosen(found, level, kind, residual, flagged)


@kernel
def pick(
    channels: int,
    solver: int,
    single: F64,
    each: F64,
    now: F64,
    found: F64,
    level: I64,
    kind: I64,
    residual: F64,
    flagged: Bools,
) -> None:
    """single (R, 3): C_11, d_1, bb; each (R, L, 3): C_12, C_22, d_2.

    Writes what is chosen of elements with light; those without, or with numbers that are none, stay flagged.
    """
    levels = each.shape[1]
    best_fit, fit, cost = np.zeros((channels, 2)), np.zeros((4, channels, 2)), np.zeros(4)
    for e in range(len(level)):
        first = e * channels
        finite, lit = True, False
        for r in range(first, first + channels):
            total = single[r, 0] + single[r, 1] + single[r, 2] + now[r, 0] + now[r, 1]
            lit |= single[r, 0] > TINY
            for at in range(levels):
                total += each[r, at, 0] + each[r, at, 1] + each[r, at, 2]
                lit |= each[r, at, 1] > TINY
            finite &= np.isfinite(total)
        if not (finite and lit):
            continue
        least, own = np.inf, level[e]
        for at in range(levels):
            for way in range(4):
                cost[way] = 0.0
            for c in range(channels):
                r = first + c
                c11, d1, bb = single[r, 0], single[r, 1], single[r, 2]
                c12, c22, d2 = each[r, at, 0], each[r, at, 1], each[r, at, 2]
                rd, rs = now[r, 0], now[r, 1]
                there, shiny = c11 > TINY, c22 > TINY
                free = (d1 - c12 * rs) / c11 if there else rd
                d = min(max(free, 0.0), max(1.0 - rs, 0.0))
                s = min(max((d2 - c12 * rd) / c22 if shiny else rs, 0.0), max(1.0 - rd, 0.0))
                fit[KEPT, c, 0], fit[KEPT, c, 1] = rd, rs
                fit[DIFFUSE, c, 0], fit[DIFFUSE, c, 1] = d, rs
                fit[SPECULAR, c, 0], fit[SPECULAR, c, 1] = rd, s
                pivot = c22 - c12 * c12 / max(c11, TINY)
                x, y = free, rs
                if there and shiny and pivot > PIVOT * c22:
                    y = (d2 - c12 * d1 / c11) / pivot
                    x = (d1 - c12 * y) / c11
                if x < 0.0 or y < 0.0 or x + y > 1.0:
                    lowest, p, q = np.inf, x, y
                    for edge in range(3):
                        if edge == 0:
                            u, v = min(max(d1 / max(c11, TINY), 0.0), 1.0), 0.0
                        elif edge == 1:
                            u, v = 0.0, min(max(d2 / max(c22, TINY), 0.0), 1.0)
                        else:
                            along = max(c11 - 2.0 * c12 + c22, TINY)
                            v = min(max((c11 - c12 - d1 + d2) / along, 0.0), 1.0)
                            u = 1.0 - v
                        here = c11 * u * u + 2.0 * c12 * u * v + c22 * v * v - 2.0 * d1 * u - 2.0 * d2 * v
                        if here < lowest:
                            lowest, p, q = here, u, v
                    x, y = p, q
                fit[BOTH, c, 0], fit[BOTH, c, 1] = x, y
                for way in range(4):
                    u, v = fit[way, c, 0], fit[way, c, 1]
                    here = c11 * u * u + 2.0 * c12 * u * v + c22 * v * v - 2.0 * d1 * u - 2.0 * d2 * v
                    cost[way] += max(here + bb, 0.0)
            for way in range(4):
                changed = (0 if way == KEPT else 2 if way == BOTH else 1) + (0 if at == own else 1)
                if solver == 0 and (changed > 1 or changed == 0):
                    continue
                if solver == 2 and way != BOTH:
                    continue
                weight = 1.0
                if solver == 1:
                    weight = _ONE if changed < 2 else _TWO if changed == 2 else _THREE
                if cost[way] * weight < least:
                    least = cost[way] * weight
                    residual[e], level[e], kind[e] = cost[way], at, way
                    for c in range(channels):
                        best_fit[c, 0], best_fit[c, 1] = fit[way, c, 0], fit[way, c, 1]
        flagged[e] = False
        for c in range(channels):
            found[first + c, 0], found[first + c, 1] = best_fit[c, 0], best_fit[c, 1]


__all__ = ["choose_all"]
