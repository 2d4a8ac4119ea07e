"""From "faster" to "truer": what the one control means."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Quality:
    """Tolerances.

    tolerance: share of a vertex' irradiance that a node may hold, times its light's spread; lobe: share of
    its radiance that one node may be wrong by; picture: relative RMSE of the picture at which refinement
    ends; moving_lamp_samples: shadow rays to an area lamp while something moves.
    """

    tolerance: float
    lobe: float
    picture: float
    moving_lamp_samples: int


def quality(control: float) -> Quality:
    """0 is fastest, 1 truest; each tenth shrinks a node's tolerance by a third."""
    control = min(max(control, 0.0), 1.0)
    return Quality(
        tolerance=2e-4 * 10 ** (-1.5 * control),
        lobe=1e-2 * 10 ** (-2.0 * control),
        picture=0.04 * 4.0**-control,
        moving_lamp_samples=round(8 + 16 * control),
    )
