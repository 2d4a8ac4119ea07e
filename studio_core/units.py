"""Units by what they measure, and the units in which lengths can be shown."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

INCH, FOOT = 0.0254, 0.3048
FEET_AND_INCHES = "ft-in"


@dataclass(frozen=True)
class Family:
    """Units of one kind: `units` maps every spelling to how many of the family's first unit it is."""

    label: str
    units: Mapping[str, float]


LENGTH = Family(
    "a length",
    {
        "m": 1.0,
        "metre": 1.0,
        "metres": 1.0,
        "meter": 1.0,
        "meters": 1.0,
        "cm": 0.01,
        "mm": 0.001,
        "dm": 0.1,
        "km": 1000.0,
        "µm": 1e-6,
        "in": INCH,
        "inch": INCH,
        "inches": INCH,
        '"': INCH,
        "ft": FOOT,
        "foot": FOOT,
        "feet": FOOT,
        "'": FOOT,
        "yd": 3 * FOOT,
    },
)
ANGLE = Family(
    "an angle",
    {
        "°": 1.0,
        "deg": 1.0,
        "degree": 1.0,
        "degrees": 1.0,
        "'": 1 / 60,
        '"': 1 / 3600,
        "rad": 180 / math.pi,
        "grad": 0.9,
        "gon": 0.9,
        "turn": 360.0,
        "turns": 360.0,
    },
)
RATIO = Family("a ratio", {"": 1.0, "%": 0.01, "‰": 0.001})
FAMILIES = (
    LENGTH,
    ANGLE,
    RATIO,
    Family("a colour temperature", {"K": 1.0, "kelvin": 1.0, "kK": 1000.0}),
    Family("an exposure", {"EV": 1.0, "stop": 1.0, "stops": 1.0}),
    Family("a luminous flux", {"lm": 1.0, "lumen": 1.0, "klm": 1000.0}),
    Family("a luminous intensity", {"cd": 1.0, "candela": 1.0, "mcd": 0.001, "kcd": 1000.0}),
    Family("an illuminance", {"lx": 1.0, "lux": 1.0, "klx": 1000.0}),
    Family("a luminance", {"cd/m²": 1.0, "cd/m2": 1.0, "nit": 1.0, "nits": 1.0}),
    Family("a power", {"W": 1.0, "watt": 1.0, "kW": 1000.0}),
    Family("a time", {"s": 1.0, "sec": 1.0, "ms": 0.001, "min": 60.0, "h": 3600.0}),
    Family("an amount of storage", {"MB": 1.0, "GB": 1024.0, "kB": 1 / 1024}),
    Family("a number of pixels", {"px": 1.0}),
)


@dataclass(frozen=True)
class LengthUnit:
    """How lengths are shown: decimals that make sense for furniture, and one step of a field in metres."""

    name: str
    label: str
    decimals: int
    step: float


LENGTH_UNITS = {
    unit.name: unit
    for unit in (
        LengthUnit("m", "Metres", 3, 0.01),
        LengthUnit("cm", "Centimetres", 1, 0.01),
        LengthUnit("mm", "Millimetres", 0, 0.01),
        LengthUnit("in", "Inches", 2, INCH),
        LengthUnit(FEET_AND_INCHES, "Feet and inches", 2, INCH),
    )
}
"""What a person can choose from, by the name that `format_quantity` takes."""


def family_of(unit: str) -> Family:
    """The family in which `unit` is written so; an unknown unit is alone in its own."""
    if unit == FEET_AND_INCHES:
        return LENGTH
    return next((f for f in FAMILIES if unit in f.units), Family(f"a number of {unit}", {unit: 1.0}))


def factor(unit: str) -> float:
    """How many of its family's first unit `unit` is."""
    return INCH if unit == FEET_AND_INCHES else family_of(unit).units[unit]


def find(word: str, expected: Family) -> tuple[Family, float] | None:
    """The family and factor of a word that a person wrote, in the expected family if it can be.

    Capitals count only where they tell units apart.
    """
    for family in (expected, *FAMILIES):
        if word in family.units:
            return family, family.units[word]
    folded = word.casefold()
    for family in (expected, *FAMILIES):
        found = {size for name, size in family.units.items() if name.casefold() == folded}
        if len(found) == 1:
            return family, found.pop()
    return None
