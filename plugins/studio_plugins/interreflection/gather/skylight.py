"""Where paths look for the sky: at what is bright and, from somewhere in the scene, open.

Drawn by radiance alone, most samples of a room that is lit through a window are stopped by its walls. What
the pilot of the vertices' own samples found open (`studio_core.transport.sky_samples`) serves paths as well;
a share by radiance alone stays, so that nothing is left out and the mean is the same.
"""

from __future__ import annotations

import dataclasses

import numpy as np
import numpy.typing as npt

from studio_core.shading.path_world import PathWorld
from studio_core.transport.sky_samples import probabilities

F64 = npt.NDArray[np.float64]


def looking_out(world: PathWorld, worth: F64 | None) -> PathWorld:
    """A world in which leaves of the sky are chosen by their light times `worth` (2^n,) of their cell.

    The same where nothing is known, or where there is no sky.
    """
    lights = world.lights
    if worth is None or lights.k == 0:
        return world
    inside = len(lights.upto) // len(worth)
    power = np.diff(lights.upto[inside - 1 :: inside], prepend=0.0)
    chosen = probabilities(power, worth[None])[0]
    factor = np.divide(chosen * power.sum(), power, out=np.ones_like(power), where=power > 0)
    each = np.repeat(factor, inside)
    upto = np.cumsum(np.diff(lights.upto, prepend=0.0) * each)
    chance = (lights.chance * each * (lights.upto[-1] / upto[-1])).astype(np.float32)
    return dataclasses.replace(world, lights=lights._replace(upto=upto, chance=chance))
