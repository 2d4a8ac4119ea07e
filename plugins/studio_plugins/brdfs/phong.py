"""Phong: a matte part and a highlight around the mirror direction, normalised.

f_r = diffuse / π + specular · (n + 2) / (2π) · max(cos a, 0)^n, a the angle between ω_o and the mirror
image of ω_i (Phong 1975; normalised and reciprocal as in Lafortune & Willems 1994, eqs. 2–4). The lobe's
albedo is 1 at normal incidence and falls towards grazing angles.
Terms: b0 = 1, b1 = the lobe; c0 = diffuse / π, c1 = specular.

=============  ========  =====  ===========================================================
parameter      range     unit   meaning
=============  ========  =====  ===========================================================
diffuse        0…1       –      albedo of the matte part, linear Rec.709
specular       0…1       –      albedo of the highlight at normal incidence, linear Rec.709
exponent       1…1e5     –      sharpness n; the highlight's half width is about 67° / √n
=============  ========  =====  ===========================================================

Where diffuse + specular exceeds 1 in a channel, both are divided by their sum there: no more light comes
back than arrives, and the ratio of matte to shine is kept.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from studio_core.arrays import frozen_map
from studio_core.jit import batch_function
from studio_core.kernels.brdf import (
    DENSITY_SIGNATURE,
    HALF,
    ONE,
    SAMPLE_SIGNATURE,
    SIGNATURE,
    ZERO,
    carray,
    power_of_complement,
)
from studio_core.kernels.lobes import draw_cosine, draw_mirror_power, weigh_cosine, weigh_mirror_power
from studio_core.params import Value
from studio_plugins.brdfs.functions import Functions
from studio_plugins.brdfs.roles import Sharp
from studio_plugins.brdfs.two_lobes import TwoLobeParams, TwoLobes, exponent, sharpness


@dataclass(frozen=True)
class Params(TwoLobeParams):
    """Parameters of `Phong`."""

    exponent: float = sharpness(50.0)


@batch_function(SIGNATURE)
def evaluate(shape: Any, wo: Any, count: int, wi: Any, out: Any) -> None:
    """b0 = 1, b1 = (n + 2) / 2π · cos^n a; see `studio_core.contract.Brdf`. shape: n, (n + 2) / 2π."""
    s = carray(shape, 2)
    o = carray(wo, 3)
    n, peak = s[0], s[1]
    ox, oy, oz = o[0], o[1], o[2]
    directions = carray(wi, 3 * count)
    x, y, z = directions[:count], directions[count : 2 * count], directions[2 * count :]
    terms = carray(out, 2 * count)
    b0, b1 = terms[:count], terms[count:]
    for k in range(count):
        dx, dy, dz = x[k] + ox, y[k] + oy, z[k] - oz
        lit = ONE if (oz > ZERO and z[k] > ZERO) else ZERO
        t = HALF * (dx * dx + dy * dy + dz * dz)  # 1 − cos a
        b0[k] = lit
        b1[k] = lit * peak * power_of_complement(t, ONE - t, n)


@batch_function(SAMPLE_SIGNATURE)
def sample(shape: Any, wo: Any, term: int, count: int, u: Any, wi: Any) -> None:
    """By the cosine, and by cos^n a around the mirror direction; see `studio_core.contract.SampledBrdf`."""
    o, numbers, directions = carray(wo, 3), carray(u, 2 * count), carray(wi, 3 * count)
    if term == 0:
        draw_cosine(o, numbers, directions)
    else:
        draw_mirror_power(o, carray(shape, 2)[0], numbers, directions)


@batch_function(DENSITY_SIGNATURE)
def density(shape: Any, wo: Any, count: int, wi: Any, out: Any) -> None:
    """cos θ / π and (n + 1) / 2π · cos^n a; see `studio_core.contract.SampledBrdf`."""
    o, directions, terms = carray(wo, 3), carray(wi, 3 * count), carray(out, 2 * count)
    weigh_cosine(o, directions, terms[:count])
    weigh_mirror_power(o, carray(shape, 2)[0], directions, terms[count:])


class Phong(Sharp, Functions, TwoLobes):
    """See the module; satisfies `studio_core.contract.Brdf`."""

    id = "phong"
    label = "Phong"
    Params = Params
    functions = evaluate, sample, density
    roles: Mapping[str, str] = frozen_map({"diffuse": "diffuse", "specular": "specular", "gloss": "exponent"})

    def shape(self, values: Mapping[str, Value]) -> npt.NDArray[np.float32]:
        """(2,): exponent and the lobe's peak."""
        n = exponent(values)
        return np.array([n, (n + 2) / (2 * np.pi)], np.float32)


MODEL = Phong()
