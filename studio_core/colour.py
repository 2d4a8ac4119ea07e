"""Colour of light: black-body temperature to linear Rec.709, luminance."""

from __future__ import annotations

import numpy as np

from studio_core.params import Colour

LUMINANCE: Colour = (0.2126, 0.7152, 0.0722)  # Rec.709


def luminance(rgb: Colour) -> float:
    """Relative luminance of linear Rec.709."""
    return sum(w * c for w, c in zip(LUMINANCE, rgb, strict=True))


def kelvin(temperature: float) -> Colour:
    """Linear Rec.709 of luminance 1 for a black body of 1667 to 25000 K.

    Chromaticity by Kang et al. 2002 (cubic fit to the Planckian locus); negative components of very warm
    lights are clamped before the luminance is set to 1.
    """
    t = float(np.clip(temperature, 1667.0, 25000.0))
    if t <= 4000:
        x = -0.2661239e9 / t**3 - 0.2343589e6 / t**2 + 0.8776956e3 / t + 0.179910
    else:
        x = -3.0258469e9 / t**3 + 2.1070379e6 / t**2 + 0.2226347e3 / t + 0.240390
    if t <= 2222:
        y = -1.1063814 * x**3 - 1.34811020 * x**2 + 2.18555832 * x - 0.20219683
    elif t <= 4000:
        y = -0.9549476 * x**3 - 1.37418593 * x**2 + 2.09137015 * x - 0.16748867
    else:
        y = 3.0817580 * x**3 - 5.87338670 * x**2 + 3.75112997 * x - 0.37001483
    xyz = np.array([x / y, 1.0, (1 - x - y) / y])
    to_rgb = np.array(
        [
            [3.2404542, -1.5371385, -0.4985314],
            [-0.9692660, 1.8760108, 0.0415560],
            [0.0556434, -0.2040259, 1.0572252],
        ]
    )
    rgb = np.maximum(to_rgb @ xyz, 0.0)
    red, green, blue = (float(c) for c in rgb / (rgb @ np.array(LUMINANCE)))
    return (red, green, blue)
