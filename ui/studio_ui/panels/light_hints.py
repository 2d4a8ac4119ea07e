"""What the numbers of a light mean to somebody who lights rooms: words for kelvin, how bright paper gets."""

from __future__ import annotations

import math

from studio_core.colour import luminance
from studio_core.scene.nodes import AreaLamp, DirectionalLamp, Environment, Light, PointLamp, SpotLamp

_WORDS = (
    (2000, "candle light"),
    (2500, "very warm white, a dimmed bulb"),
    (3200, "warm white, a bulb"),
    (3800, "warm to neutral white"),
    (4600, "neutral white, an office"),
    (5600, "sunlight at noon"),
    (7000, "daylight"),
    (9000, "a clouded sky"),
    (math.inf, "blue sky"),
)


def kelvin_words(temperature: float) -> str:
    """What has such a colour temperature."""
    if temperature <= 0:
        return "as the tint has it"
    return next(words for limit, words in _WORDS if temperature < limit)


def to_ev(factor: float) -> float:
    """A factor in EV: one more is twice the light. -inf for 0."""
    return math.log2(factor) if factor > 0 else -math.inf


def paper_radiance(light: Light) -> float | None:
    """Luminance, in scene units, of white paper that faces a lamp: 1 m away, in the sun anywhere.

    White is a perfect diffuser, E / π; for rectangles E = π · radiance · F with the configuration factor of
    a parallel rectangle (Howell, catalogue C-3). None for light from all around.
    """
    gain = luminance(light.gain())
    if isinstance(light, AreaLamp):
        a, b = light.width / 2, light.height / 2
        return gain * 4 * (_corner(a, b) + _corner(b, a)) / (2 * math.pi)
    if isinstance(light, PointLamp | SpotLamp | DirectionalLamp):
        return gain / math.pi
    return None


def _corner(a: float, b: float) -> float:
    root = math.sqrt(1 + a * a)
    return a / root * math.atan(b / root)


def light_hint(light: Light, luminance_scale: float | None = None) -> str:
    """How bright white paper is shown at exposure 0, and candela where the scene is calibrated."""
    paper = paper_radiance(light)
    if paper is None:
        return ""
    where = "in it" if isinstance(light, DirectionalLamp) else "1 m away"
    told = f"White paper {where}: {_ev(to_ev(paper))}" if paper > 0 else "Gives no light"
    if luminance_scale is not None and isinstance(light, PointLamp | SpotLamp):
        told += f", {luminance(light.gain()) * luminance_scale:.3g} cd"
    return told


def _ev(value: float) -> str:
    if abs(value) < 0.05:
        return "display white"
    return f"{abs(value):.1f} EV {'over' if value > 0 else 'under'} white"


def calibration(lights: list[Environment]) -> float | None:
    """cd/m² of one scene unit, if an environment was calibrated."""
    return next((e.luminance_scale for e in lights if e.luminance_scale is not None), None)
