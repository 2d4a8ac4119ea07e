"""The paper's choices, element by element: least squares, one parameter, or a mixture (section 5.3).

For all elements and gloss levels at once, from the moments C = AᵀWA and d = AᵀWb of equation 3's two columns.
`literal` has equations 5 and 6 and the rescaling as printed; without it the one-parameter fits are the true
minimum of the weighted difference, and what returns too much light is brought back along the constraint.
Equation 4's choice is by the weighted residual throughout (as printed it is unweighted, which equation 3 does
not minimise), times 1, 5 and 25 for one, two and three parameters in the mixture.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from studio_plugins.slf.samples import F64

I64 = npt.NDArray[np.int64]
Bools = npt.NDArray[np.bool_]
Solver = Literal["l0", "mixed", "l2"]
WEIGHTS = (0.0, 1.0, 5.0, 25.0)
"""Of the residual, by how many parameters changed; one that changes nothing is weighed like one that does."""
KEPT, DIFFUSE, SPECULAR, BOTH = range(4)
PIVOT = 1e-6
"""Columns whose angle has a smaller squared sine are one column."""
TINY = 1e-300
ANYTHING = (True, True, True)


@dataclass(frozen=True, eq=False)
class Systems:
    """Of E elements at L levels in C channels, R = E · C: c11, d1, bb (R,), c12, c22, d2 (R, L).

    now (R, 2) are the matte and shiny reflectance, level (E,) the gloss. Channels of an element follow each
    other: reflectances are their own, gloss and which parameters change are shared.
    """

    c11: F64
    c12: F64
    c22: F64
    d1: F64
    d2: F64
    bb: F64
    now: F64
    level: I64
    channels: int = 1


@dataclass(frozen=True, eq=False)
class Chosen:
    """reflectance (R, 2), level (E,), which parameters are new (E,) as KEPT … BOTH, and the residual (E,).

    flagged (E,): elements without light or with numbers that are none; they stay as they are.
    """

    reflectance: F64
    level: I64
    kind: I64
    residual: F64
    flagged: Bools


def fits(systems: Systems, literal: bool) -> F64:
    """(R, L, 4, 2) reflectances by KEPT, DIFFUSE, SPECULAR, BOTH at every level; all feasible."""
    c11, c12, c22 = systems.c11[:, None], systems.c12, systems.c22
    d1, d2 = systems.d1[:, None], systems.d2
    rd, rs = systems.now[:, :1], systems.now[:, 1:]
    made = np.empty((*c22.shape, 4, 2))
    made[:, :, KEPT] = systems.now[:, None]
    made[:, :, DIFFUSE] = made[:, :, SPECULAR] = made[:, :, BOTH] = systems.now[:, None]
    if literal:
        diffuse = (c11 * (d1 - c12 * rs) + c12 * (d2 - c22 * rs)) / np.maximum(c11**2 + c12**2, TINY)
        specular = (c12 * (d1 - c11 * rd) + c22 * (d2 - c12 * rd)) / np.maximum(c12**2 + c22**2, TINY)
    else:
        diffuse = (d1 - c12 * rs) / np.maximum(c11, TINY)
        specular = (d2 - c12 * rd) / np.maximum(c22, TINY)
    there, shiny = c11 > TINY, c22 > TINY
    made[:, :, DIFFUSE, 0] = np.where(there, diffuse, rd)
    made[:, :, SPECULAR, 1] = np.where(shiny, specular, rs)
    pivot = c22 - c12**2 / np.maximum(c11, TINY)
    apart = there & shiny & (pivot > PIVOT * c22)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        s = (d2 - c12 * d1 / np.maximum(c11, TINY)) / np.where(apart, pivot, 1.0)
        d = (d1 - c12 * s) / np.maximum(c11, TINY)
    made[:, :, BOTH, 0] = np.where(apart, d, made[:, :, DIFFUSE, 0])
    made[:, :, BOTH, 1] = np.where(apart, s, rs)
    return _rescaled(made) if literal else _nearest(made, systems)


def _rescaled(made: F64) -> F64:
    """As in the paper: negative parts to 0, then both divided by their sum where it is over 1."""
    made = np.maximum(made, 0)
    return np.asarray(made / np.maximum(made.sum(axis=-1, keepdims=True), 1))


def _nearest(made: F64, systems: Systems) -> F64:
    """The minimum on the constraints' edges; of one-parameter fits, by clipping."""
    rd, rs = systems.now[:, 0][:, None], systems.now[:, 1][:, None]
    made[:, :, DIFFUSE, 0] = np.clip(made[:, :, DIFFUSE, 0], 0, np.maximum(1 - rs, 0))
    made[:, :, SPECULAR, 1] = np.clip(made[:, :, SPECULAR, 1], 0, np.maximum(1 - rd, 0))
    both = made[:, :, BOTH]
    outside = (both < 0).any(axis=-1) | (both.sum(axis=-1) > 1)
    e, level = np.nonzero(outside)
    if not len(e):
        return made
    c11, c12, c22 = systems.c11[e], systems.c12[e, level], systems.c22[e, level]
    d1, d2 = systems.d1[e], systems.d2[e, level]
    along = c11 - 2 * c12 + c22
    edges = np.stack(
        [
            np.stack([np.clip(d1 / np.maximum(c11, TINY), 0, 1), np.zeros(len(e))], axis=-1),
            np.stack([np.zeros(len(e)), np.clip(d2 / np.maximum(c22, TINY), 0, 1)], axis=-1),
        ]
    )
    s = np.clip((c11 - c12 - d1 + d2) / np.maximum(along, TINY), 0, 1)
    edges = np.concatenate([edges, np.stack([1 - s, s], axis=-1)[None]])
    x, y = edges[..., 0], edges[..., 1]
    cost = c11 * x * x + 2 * c12 * x * y + c22 * y * y - 2 * d1 * x - 2 * d2 * y
    made[e, level, BOTH] = edges[np.argmin(cost, axis=0), np.arange(len(e))]
    return made


def errors(systems: Systems, made: F64) -> F64:
    """(R, L, K) weighted squared differences that reflectances (R, L, K, 2) leave."""
    d, s = made[..., 0], made[..., 1]
    c11, d1, bb = (one[:, None, None] for one in (systems.c11, systems.d1, systems.bb))
    c12, c22, d2 = (one[..., None] for one in (systems.c12, systems.c22, systems.d2))
    cost = c11 * d * d + 2 * c12 * d * s + c22 * s * s - 2 * d1 * d - 2 * d2 * s
    return np.asarray(np.maximum(cost + bb, 0))


def choose(
    systems: Systems, solver: Solver, literal: bool = False, may: tuple[bool, bool, bool] = ANYTHING
) -> Chosen:
    """Equation 4 over a solver's candidates: `l0` one parameter, `l2` all of them, `mixed` any by weights.

    Of the matte part, the shine and the gloss only what `may` change does; `l2` changes all of that.
    """
    count, levels = systems.c22.shape
    channels, elements = systems.channels, len(systems.c22) // systems.channels
    arrays = (systems.c11, systems.d1, systems.bb, systems.now, systems.c12, systems.c22, systems.d2)
    good = np.logical_and.reduce([np.isfinite(one).reshape(count, -1).all(axis=1) for one in arrays])
    bright = (systems.c11 > TINY) | (systems.c22 > TINY).any(axis=1)
    of_all = good.reshape(elements, channels).all(axis=1) & bright.reshape(elements, channels).any(axis=1)
    lit = np.repeat(of_all, channels)
    names = ("c11", "c12", "c22", "d1", "d2", "bb")
    kept: dict[str, Any] = {
        name: np.where(_rows(lit, getattr(systems, name)), getattr(systems, name), 0) for name in names
    }
    clean = dataclasses.replace(systems, **kept, now=_rescaled(np.nan_to_num(systems.now)))
    made = fits(clean, literal)
    cost = errors(clean, made).reshape(elements, channels, levels, 4).sum(axis=1)
    own = np.arange(levels) == clean.level[:, None]
    changed = np.array([0, 1, 1, 2]) + np.where(own, 0, 1)[..., None]
    allowed = {"l0": changed <= 1, "l2": changed >= 2, "mixed": changed >= 0}[solver]
    matte, shine, gloss = may
    if solver == "l2":
        allowed = np.zeros_like(allowed)
        allowed[:, :, matte * DIFFUSE + shine * SPECULAR] = True
    if solver == "l0":
        allowed = allowed & ~((changed == 0) & (np.arange(4) == KEPT))  # as printed: one always changes
    allowed = allowed & np.array([True, matte, shine, matte and shine]) & (own | gloss)[..., None]
    weight = np.asarray(WEIGHTS)[np.maximum(changed, 1)] if solver == "mixed" else np.ones(changed.shape)
    rated = np.where(allowed, cost * weight, np.inf).reshape(elements, -1)
    best = np.argmin(rated, axis=1)
    level, kind = np.divmod(best, 4)
    chosen = made[np.arange(count), np.repeat(level, channels), np.repeat(kind, channels)]
    found = np.where(lit[:, None], chosen, clean.now)
    residual = np.where(of_all, cost[np.arange(elements), level, kind], 0.0)
    level = np.where(of_all, level, systems.level)
    return Chosen(found, level, np.where(of_all, kind, KEPT), residual, ~of_all)


def _rows(which: Bools, like: F64) -> Bools:
    return which.reshape(-1, *[1] * (like.ndim - 1))
