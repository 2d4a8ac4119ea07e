"""The error of a fit: nMSE = Σ (difference²) / Σ (measured²) over what is lit and not clipped."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from studio_plugins.residual.samples import F32, Flags


@dataclass(frozen=True)
class Errors:
    """nMSE of all, of what is more than 10° from the highlight's middle, and of what is within."""

    whole: float
    outside: float
    within: float
    by_light: tuple[float, ...] = ()


def nmse(made: F32, seen: F32, use: Flags) -> float:
    """Over values (..., 3) where used (...); 0 where nothing is."""
    off = (made[use].astype(np.float64) - seen[use]) ** 2
    power = float((seen[use].astype(np.float64) ** 2).sum())
    return float(off.sum()) / power if power > 0 else 0.0


def errors(made: F32, seen: F32, use: Flags, outside: Flags) -> Errors:
    """Of predictions (n, h, w, 3); `use` and `outside` (n, h, w)."""
    by_light = tuple(nmse(made[i], seen[i], use[i]) for i in range(len(made)))
    return Errors(
        nmse(made, seen, use), nmse(made, seen, use & outside), nmse(made, seen, use & ~outside), by_light
    )
