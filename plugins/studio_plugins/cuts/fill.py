"""Refined vertices while something moves: what they get from the vertices they lie between.

Where their irradiance is known it is theirs, so that shadows keep their edges while the eye moves; only how
much of it goes to the eye is taken from the neighbours, in proportion to the light they have: dark ones have
no say. Elsewhere both are, and the picture is for so long that of the unrefined mesh.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from studio_core.jit import kernel

F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]
I32 = npt.NDArray[np.int32]
I64 = npt.NDArray[np.int64]
Bools = npt.NDArray[np.bool_]

USUAL = 1 / 64
"""Weight of what is usual for a material, in shares of a vertex' own light: it decides between dark ones."""


def fill(
    between: I64, material: I32, summed: Bools, wanted: Bools, settled: Bools, terms: F32, irradiance: F32
) -> None:
    """Sets terms (V, T, 3) and, but for the settled, irradiance (V, 3) of wanted vertices.

    `between` (V, 2) are vertices of lower number, twice itself where refinement did not make the vertex: each
    is `summed`, and gives its own, or lies between others that are, wanted or not. With terms t₁, t₂ and
    irradiance e₁, e₂ there, a settled one gets its own irradiance times (t₁ + t₂) / (e₁ + e₂).
    """
    count = len(terms)
    flat = terms.reshape(count, -1)
    kinds = int(material.max(initial=-1)) + 2  # −1 is none, and the last
    usual = np.zeros((kinds, flat.shape[1]))
    through, level = np.empty_like(flat), np.empty_like(irradiance)
    _usual(material, summed, flat, irradiance, np.zeros((kinds, 3)), usual)
    _fill(
        between,
        material,
        summed,
        wanted,
        settled & wanted,
        wanted.copy(),
        usual,
        flat,
        irradiance,
        through,
        level,
    )


@kernel
def lean_on(between: I64, summed: Bools, needed: Bools) -> None:
    """Marks also those between which the needed vertices lie, down to the summed ones."""
    for i in range(len(between) - 1, -1, -1):
        if needed[i] and not summed[i]:
            needed[between[i, 0]] = True
            needed[between[i, 1]] = True


@kernel
def lift(
    between: I64, summed: Bools, wanted: Bools, settled: Bools, standing: F32, known: Bools, irradiance: F32
) -> Bools:
    """Irradiance (V, 3) of wanted vertices that are not settled, where it can be told; (V,) where it was.

    `standing` (V, 3), where `known`, is that past all that stands still. What moves takes as much of
    it from a vertex as from the two it lies `between`: fine shadows of what stands still stay as they are.
    """
    half = np.float32(0.5)
    lifted = np.zeros(len(between), np.bool_)
    for i in range(len(between)):
        one, other = between[i, 0], between[i, 1]
        if summed[i] or settled[i] or not wanted[i] or one == other:
            continue
        sure = known[i] and known[one] and known[other]
        if not (sure and (summed[one] or settled[one] or lifted[one])):
            continue
        if not (summed[other] or settled[other] or lifted[other]):
            continue
        for c in range(3):
            moved = irradiance[one, c] - standing[one, c] + irradiance[other, c] - standing[other, c]
            irradiance[i, c] = max(standing[i, c] + half * moved, np.float32(0))
        lifted[i] = True
    return lifted


@kernel
def _usual(material: I32, summed: Bools, terms: F32, irradiance: F32, light: F64, usual: F64) -> None:
    """Terms over irradiance of all summed vertices together, by material."""
    for i in range(len(summed)):
        if summed[i]:
            for c in range(3):
                light[material[i], c] += irradiance[i, c]
            for c in range(terms.shape[1]):
                usual[material[i], c] += terms[i, c]
    for m in range(len(usual)):
        for c in range(usual.shape[1]):
            usual[m, c] = usual[m, c] / light[m, c % 3] if light[m, c % 3] > 0 else 0.0


@kernel
def _fill(
    between: I64,
    material: I32,
    summed: Bools,
    wanted: Bools,
    settled: Bools,
    needed: Bools,
    usual: F64,
    terms: F32,
    irradiance: F32,
    through: F32,
    level: F32,
) -> None:
    half = np.float32(0.5)
    lean_on(between, summed, needed)
    for i in range(len(between)):
        if summed[i]:
            for c in range(3):
                level[i, c] = irradiance[i, c]
            for c in range(terms.shape[1]):
                through[i, c] = terms[i, c]
        elif needed[i]:
            one, other = between[i, 0], between[i, 1]
            for c in range(3):
                level[i, c] = irradiance[i, c] if settled[i] else half * (level[one, c] + level[other, c])
            for c in range(terms.shape[1]):
                both = through[one, c] + through[other, c]
                if settled[i]:
                    own = float(level[i, c % 3])
                    few = USUAL * own
                    light = level[one, c % 3] + level[other, c % 3] + few
                    through[i, c] = own * (both + few * usual[material[i], c]) / light if light > 0 else 0.0
                else:
                    through[i, c] = half * both
            if wanted[i]:  # what others only lie between keeps what it has
                for c in range(3):
                    irradiance[i, c] = level[i, c]
                for c in range(terms.shape[1]):
                    terms[i, c] = through[i, c]
