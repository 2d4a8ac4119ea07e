"""The clear sky and the sun as they are seen from the ground.

Preetham, Shirley and Smits, "A Practical Analytic Model for Daylight", SIGGRAPH 1999: luminance and
chromaticity of the sky (its appendix A.2) and the attenuated spectrum of the sun (A.1, table 2).
Colour matching after Wyman, Sloan and Shirley, JCGT 2(2), 2013. All radiance is linear Rec.709 whose
luminance is in kcd/m².
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from .mesh import Array, Point

SUN_RADIUS = math.radians(0.53 / 2)
TO_RGB = np.array(
    [
        [3.2404542, -1.5371385, -0.4985314],
        [-0.9692660, 1.8760108, 0.0415560],
        [0.0556434, -0.2040259, 1.0572252],
    ]
)
# Perez coefficients A..E of Y, x and y: slope and offset in turbidity.
PEREZ = np.array(
    [
        [[0.1787, -1.4630], [-0.3554, 0.4275], [-0.0227, 5.3251], [0.1206, -2.5771], [-0.0670, 0.3703]],
        [[-0.0193, -0.2592], [-0.0665, 0.0008], [-0.0004, 0.2125], [-0.0641, -0.8989], [-0.0033, 0.0452]],
        [[-0.0167, -0.2608], [-0.0950, 0.0092], [-0.0079, 0.2102], [-0.0441, -1.6537], [-0.0109, 0.0529]],
    ]
)
# Zenith chromaticity: rows for T², T, 1; columns for θ³, θ², θ, 1.
ZENITH_X = np.array(
    [
        [0.00166, -0.00375, 0.00209, 0.0],
        [-0.02903, 0.06377, -0.03202, 0.00394],
        [0.11693, -0.21196, 0.06052, 0.25886],
    ]
)
ZENITH_Y = np.array(
    [
        [0.00275, -0.00610, 0.00317, 0.0],
        [-0.04214, 0.08970, -0.04153, 0.00516],
        [0.15346, -0.26756, 0.06670, 0.26688],
    ]
)
# Radiance of the sun outside the atmosphere, 380 to 750 nm by 10 nm, W / (m² nm sr).
SUN_SPECTRUM = 100.0 * np.array(
    [
        *(165.59, 162.337, 211.275, 258.882, 258.291, 242.323, 267.605, 296.583, 305.454, 300.575),
        *(306.637, 288.304, 287.121, 278.25, 271.006, 272.336, 263.613, 255.038, 250.602, 253.116),
        *(253.559, 251.342, 246.315, 241.732, 236.853, 232.121, 228.277, 223.398, 219.702, 215.267),
        *(210.979, 207.283, 202.404, 198.708, 194.272, 190.724, 186.289, 182.592),
    ]
)
# Absorption of ozone (cm⁻¹) and of water vapour, at wavelengths in nm.
OZONE_AT = np.array([355.0, *range(445, 605, 5), 605, *range(610, 800, 10)])
OZONE = np.array(
    [
        *(0.0, 0.003, 0.003, 0.004, 0.006, 0.008, 0.009, 0.012, 0.014, 0.017, 0.021, 0.025, 0.03, 0.035),
        *(0.04, 0.045, 0.048, 0.057, 0.063, 0.07, 0.075, 0.08, 0.085, 0.095, 0.103, 0.11, 0.12, 0.122),
        *(0.12, 0.118, 0.115, 0.12, 0.125, 0.13, 0.12, 0.105, 0.09, 0.079, 0.067, 0.057, 0.048, 0.036),
        *(0.028, 0.023, 0.018, 0.014, 0.011, 0.01, 0.009, 0.007, 0.004, 0.0, 0.0),
    ]
)
WATER_AT = np.array([689.0, *range(690, 810, 10)])
WATER = np.array([0.0, 0.016, 0.024, 0.0125, 1.0, 0.87, 0.061, 1e-3, 1e-5, 1e-5, 6e-4, 0.0175, 0.036])


@dataclass(frozen=True)
class Sky:
    """A clear sky of a turbidity (2 very clear … 6 hazy) with the sun at a unit vector `sun`, y up."""

    turbidity: float
    sun: Point

    def radiance(self, directions: Array) -> Array:
        """(N, 3) of unit directions (N, 3); those below the horizon get the horizon's."""
        cos_theta = np.maximum(directions[:, 1], 1e-3)
        flat = directions * [1.0, 0.0, 1.0]
        below = directions[:, 1] < 1e-3
        lifted = np.where(
            below[:, None], flat / np.maximum(np.linalg.norm(flat, axis=1), 1e-9)[:, None], directions
        )
        gamma = np.arccos(np.clip(lifted @ np.array(self.sun), -1, 1))
        sun_theta = math.acos(self.sun[1])
        zenith = self.zenith()
        ratio = [
            _perez(k, self.turbidity, cos_theta, gamma)
            / _perez(k, self.turbidity, np.ones(1), np.array([sun_theta]))
            for k in range(3)
        ]
        luminance, x, y = (zenith[k] * ratio[k] for k in range(3))
        xyz = np.stack([x / y, np.ones_like(x), (1 - x - y) / y], 1) * luminance[:, None]
        return np.asarray(np.maximum(xyz @ TO_RGB.T, 0.0))

    def zenith(self) -> Point:
        """Luminance (kcd/m²) and chromaticity x, y straight up."""
        t, theta = self.turbidity, math.acos(self.sun[1])
        chi = (4 / 9 - t / 120) * (math.pi - 2 * theta)
        luminance = (4.0453 * t - 4.9710) * math.tan(chi) - 0.2155 * t + 2.4192
        powers_t, powers = np.array([t * t, t, 1.0]), np.array([theta**3, theta**2, theta, 1.0])
        return (luminance, float(powers_t @ ZENITH_X @ powers), float(powers_t @ ZENITH_Y @ powers))

    def sun_radiance(self) -> Array:
        """(3,) mean radiance of the sun's disc: its spectrum outside, five times attenuated."""
        theta = math.acos(self.sun[1])
        mass = 1 / (self.sun[1] + 0.15 * (93.885 - math.degrees(theta)) ** -1.253)
        nm = np.arange(380.0, 751.0, 10.0)
        um = nm / 1000
        beta = 0.04608365822050 * self.turbidity - 0.04586025928522
        rayleigh = np.exp(-0.008735 * um**-4.08 * mass)
        aerosol = np.exp(-beta * um**-1.3 * mass)
        ozone = np.exp(-np.interp(nm, OZONE_AT, OZONE) * 0.35 * mass)
        gas = np.interp(nm, [759, 760, 770, 771], [0.0, 3.0, 0.21, 0.0]) * mass
        gases = np.exp(-1.41 * gas / (1 + 118.93 * gas) ** 0.45)
        water = np.interp(nm, WATER_AT, WATER, left=0.0) * 2.0 * mass
        vapour = np.exp(-0.2385 * water / (1 + 20.07 * water) ** 0.45)
        spectrum = SUN_SPECTRUM * rayleigh * aerosol * ozone * gases * vapour
        xyz = spectrum @ colour_matching(nm) * 10.0  # nm a step
        return np.asarray(np.maximum(TO_RGB @ xyz, 0.0) * 683 / 1000)


def _perez(kind: int, turbidity: float, cos_theta: Array, gamma: Array) -> Array:
    a, b, c, d, e = PEREZ[kind] @ np.array([turbidity, 1.0])
    return np.asarray((1 + a * np.exp(b / cos_theta)) * (1 + c * np.exp(d * gamma) + e * np.cos(gamma) ** 2))


def colour_matching(nm: npt.NDArray[np.float64]) -> Array:
    """(N, 3) CIE 1931 x̄, ȳ, z̄ at wavelengths in nm: Wyman et al.'s sums of Gaussian lobes."""

    def lobe(height: float, centre: float, below: float, above: float) -> Array:
        t = (nm - centre) * np.where(nm < centre, below, above)
        return np.asarray(height * np.exp(-0.5 * t * t))

    x = lobe(0.362, 442.0, 0.0624, 0.0374) + lobe(1.056, 599.8, 0.0264, 0.0323)
    x = x + lobe(-0.065, 501.1, 0.0490, 0.0382)
    y = lobe(0.821, 568.8, 0.0213, 0.0247) + lobe(0.286, 530.9, 0.0613, 0.0322)
    z = lobe(1.217, 437.0, 0.0845, 0.0278) + lobe(0.681, 459.0, 0.0385, 0.0725)
    return np.stack([x, y, z], 1)


def sun_at(elevation: float, azimuth: float) -> Point:
    """Unit vector to the sun: degrees above the horizon, degrees from +z towards +x."""
    height, turn = math.radians(elevation), math.radians(azimuth)
    return (math.cos(height) * math.sin(turn), math.sin(height), math.cos(height) * math.cos(turn))
