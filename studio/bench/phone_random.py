"""Phones drawn at random, from two sets of parameters that have nothing in common.

Methods may be tuned on phones of the first set; what is published is measured on the other one.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from studio.bench.phone import Arc, Phone
from studio.bench.phone_response import Curve
from studio_core.capturing.settings import SIDES
from studio_core.imaging.projection import EQUIDISTANT, EQUISOLID, KANNALA_BRANDT, STEREOGRAPHIC, Circle, Lens

Range = tuple[float, float]


@dataclass(frozen=True)
class Population:
    """Where parameters are drawn from; several ranges: one of them first. Arcs' azimuths are in sectors of
    15°, every second one."""

    lenses: tuple[tuple[str, tuple[float, ...]], ...]
    fov: tuple[Range, ...]
    curves: tuple[str, ...]
    gamma: tuple[Range, ...]
    falloff_family: str
    falloff: tuple[Range, ...]
    arc_width: tuple[Range, ...]
    arc_depth: tuple[Range, ...]
    arc_stops: tuple[Range, ...]
    sector: int
    full_well: tuple[Range, ...]
    glare: tuple[Range, ...]
    jpeg: tuple[int | None, ...]


TUNED = Population(
    lenses=((EQUIDISTANT, ()), (STEREOGRAPHIC, ())),
    fov=((191.0, 194.0), (197.0, 200.0)),
    curves=("sRGB", "gamma"),
    gamma=((2.0, 2.2),),
    falloff_family="polynomial",
    falloff=((0.0, 0.1), (0.3, 0.4)),
    arc_width=((25.0, 50.0), (90.0, 110.0)),
    arc_depth=((4.0, 5.5), (7.0, 8.5)),
    arc_stops=((0.5, 0.7), (0.9, 1.2), (1.6, 2.0)),
    sector=0,
    full_well=((6000.0, 10000.0),),
    glare=((0.0, 0.001), (0.003, 0.004)),
    jpeg=(95, None),
)
OTHER = Population(
    lenses=((EQUISOLID, ()), (KANNALA_BRANDT, (-0.02, 0.002)), (KANNALA_BRANDT, (0.015, -0.001))),
    fov=((190.0, 191.0), (194.0, 197.0), (200.0, 205.0)),
    curves=("filmic", "per channel"),
    gamma=((1.8, 2.0), (2.2, 2.5)),
    falloff_family="cosine",
    falloff=((0.1, 0.3), (0.4, 0.5)),
    arc_width=((15.0, 25.0), (50.0, 90.0), (110.0, 130.0)),
    arc_depth=((3.0, 4.0), (5.5, 7.0), (8.5, 9.5)),
    arc_stops=((0.7, 0.9), (1.2, 1.6), (2.0, 2.5)),
    sector=1,
    full_well=((3000.0, 6000.0), (10000.0, 20000.0)),
    glare=((0.001, 0.003), (0.004, 0.006)),
    jpeg=(90, 97),
)


def random_phone(
    seed: int,
    tuned: bool,
    *,
    radius: float = 200.0,
    reflections: bool | None = None,
    parallax: Range = (0, 2.5),
) -> Phone:
    """A phone of one of the sets, its circle about `radius` pixels; with 1 … 3 arcs, or none.

    `reflections` None: seven of ten have some. The back shot is up to 2° and 1 % off.
    """
    rng = np.random.default_rng([seed, 17 if tuned else 71])
    some = TUNED if tuned else OTHER

    def draw(ranges: tuple[Range, ...]) -> float:
        low, high = ranges[rng.integers(len(ranges))]
        return float(rng.uniform(low, high))

    model, coefficients = some.lenses[rng.integers(len(some.lenses))]
    lens = Lens(model, draw(some.fov), coefficients)
    reach = radius * rng.uniform(0.95, 1.05)
    width, height = int(reach * 2.9) // 2 * 2, int(reach * 2.25) // 2 * 2
    circle = Circle(width / 2 + rng.uniform(-6, 6), height / 2 + rng.uniform(-6, 6), reach)
    thrown = rng.random() < 0.7 if reflections is None else reflections
    arcs = []
    for _ in range(int(rng.integers(1, 4)) if thrown else 0):
        azimuth = float(rng.integers(12) * 30 + 15 * some.sector + rng.uniform(0, 15))
        side = SIDES[rng.integers(2)]
        arcs.append(Arc(side, azimuth, draw(some.arc_width), draw(some.arc_depth), draw(some.arc_stops)))
    curve = some.curves[rng.integers(len(some.curves))]
    return Phone(
        size=(width, height),
        lens=lens,
        circle=circle,
        evs=(-2.0, 0.0, 2.0),
        back_ev=float(rng.uniform(-0.7, 0.7)),
        curve=Curve(curve, draw(some.gamma), float(rng.uniform(0.3, 0.8))),
        full_well=draw(some.full_well),
        jpeg=some.jpeg[rng.integers(len(some.jpeg))],
        falloff=draw(some.falloff),
        falloff_family=some.falloff_family,
        arcs=tuple(arcs),
        glare=draw(some.glare),
        outside=float(rng.uniform(0, 0.03)),
        ring=float(rng.uniform(0, 0.2)) if rng.random() < 0.3 else 0.0,
        tilt=(0.0, float(rng.uniform(-4, 4)), float(rng.uniform(-3, 3))),
        misalignment=tuple(float(a) for a in rng.uniform(-2, 2, 3)),  # type: ignore[arg-type]
        back_scale=float(rng.uniform(0.99, 1.01)),
        back_shift=(float(rng.uniform(-3, 3)), float(rng.uniform(-3, 3))),
        shake=float(rng.uniform(0, 0.15)),
        parallax=float(rng.uniform(*parallax)),
    )
