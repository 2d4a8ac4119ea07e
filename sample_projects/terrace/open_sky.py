"""The light of a terrace: a clear sky with the sun's disc over a lawn, trees and hills."""

from __future__ import annotations

import numpy as np

from studio_core.colour import LUMINANCE

from ..modelling import equirect
from ..modelling.landscape import Landscape
from ..modelling.mesh import Array
from ..modelling.sky import SUN_RADIUS, Sky, sun_at

SKY = Sky(turbidity=2.3, sun=sun_at(49.0, 312.0))
UPWARD_IRRADIANCE = 3.9  # what the paving gets, in units of radiance · sr


def sunny_sky(height: int = 512) -> tuple[Array, float]:
    """The picture (height, 2·height, 3), white-balanced and exposed, and cd/m² for a unit of luminance."""
    picture = equirect.painted(Landscape(SKY).painter(), height)
    picture = equirect.add_disc(picture, np.array(SKY.sun), SUN_RADIUS, SKY.sun_radiance())
    light = equirect.irradiance(picture, np.array([0.0, 1.0, 0.0]))
    scale = UPWARD_IRRADIANCE / float(light @ np.array(LUMINANCE))
    return picture * equirect.balance(light, 0.7) * scale, 1000.0 / scale
