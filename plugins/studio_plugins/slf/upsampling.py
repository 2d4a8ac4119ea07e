"""From elements to all else: what was solved for a few points, between them (section 6.5, figure 13).

Joint bilateral upsampling of *changes*: place, direction and original look decide which elements count, so
that an edge in the look is one in the change, and what the surface looked like stays underneath. The shares
are those of `studio_core.scene.between`, as painted pictures have them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from studio_core.scene.between import Cloud, Weights, weigh
from studio_plugins.slf.spots import Spots

F32 = npt.NDArray[np.float32]


def cloud_of(spots: Spots) -> Cloud:
    """Of spots, parts apart."""
    return Cloud(spots.place, spots.normal, spots.part, spots.look)


@dataclass(frozen=True, eq=False)
class Upsampling:
    """Shares of elements at places: good as long as no part's shape, material or picture changes."""

    weights: Weights

    @staticmethod
    def of(elements: Spots, places: Spots) -> Upsampling:
        """Places of parts without elements stay as they are. Moved objects keep their shares."""
        return Upsampling(weigh(cloud_of(elements), cloud_of(places)))

    def __call__(self, changes: F32, weight: F32 | None = None) -> F32:
        """(P, C) from changes (E, C), each times its weight (E,)."""
        return self.weights(changes if weight is None else changes * weight[:, None])


__all__ = ["Upsampling", "cloud_of"]
