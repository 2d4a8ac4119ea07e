"""Blinn–Phong: a matte part and a highlight around the half vector, normalised.

f_r = diffuse / π + specular · N(n) · (n·h)^n with N(n) = (n + 2)(n + 4) / (8π (2^(−n/2) + n))
(Blinn 1977; N gives the lobe the albedo 1 at normal incidence exactly: ∫ cos^n(θ/2) cos θ dω = 1/N,
Sloan & Hoffman in Akenine-Möller et al., "Real-Time Rendering", 3rd ed., 7.6). The albedo is highest
there and falls towards grazing angles, so it never exceeds 1.
Terms: b0 = 1, b1 = the lobe; c0 = diffuse / π, c1 = specular.

=============  ========  =====  ===========================================================
parameter      range     unit   meaning
=============  ========  =====  ===========================================================
diffuse        0…1       –      albedo of the matte part, linear Rec.709
specular       0…1       –      albedo of the highlight at normal incidence, linear Rec.709
exponent       1…1e5     –      sharpness n; about four times Phong's for the same highlight
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
    LEAST_HEIGHT,
    ONE,
    SAMPLE_SIGNATURE,
    SIGNATURE,
    ZERO,
    carray,
    power_of_complement,
)
from studio_core.kernels.lobes import draw_cosine, draw_half_power, weigh_cosine, weigh_half_power
from studio_core.params import Value
from studio_plugins.brdfs.functions import Functions
from studio_plugins.brdfs.roles import Sharp
from studio_plugins.brdfs.two_lobes import TwoLobeParams, TwoLobes, exponent, sharpness


@dataclass(frozen=True)
class Params(TwoLobeParams):
    """Parameters of `BlinnPhong`."""

    exponent: float = sharpness(200.0)


@batch_function(SIGNATURE)
def evaluate(shape: Any, wo: Any, count: int, wi: Any, out: Any) -> None:
    """b0 = 1, b1 = N (n·h)^n; see `studio_core.contract.Brdf`. shape: n, N(n)."""
    s = carray(shape, 2)
    o = carray(wo, 3)
    half_n, peak = HALF * s[0], s[1]
    ox, oy, oz = o[0], o[1], o[2]
    directions = carray(wi, 3 * count)
    x, y, z = directions[:count], directions[count : 2 * count], directions[2 * count :]
    terms = carray(out, 2 * count)
    b0, b1 = terms[:count], terms[count:]
    for k in range(count):
        lit = ONE if (oz > ZERO and z[k] > ZERO) else ZERO
        hx, hy, hz = x[k] + ox, y[k] + oy, max(z[k] + oz, LEAST_HEIGHT)
        flat, height = hx * hx + hy * hy, hz * hz
        whole = flat + height
        b0[k] = lit
        b1[k] = lit * peak * power_of_complement(flat / whole, height / whole, half_n)  # sin² of h, cos²


@batch_function(SAMPLE_SIGNATURE)
def sample(shape: Any, wo: Any, term: int, count: int, u: Any, wi: Any) -> None:
    """By the cosine, and half vectors by (n·h)^(n+1); see `studio_core.contract.SampledBrdf`."""
    o, numbers, directions = carray(wo, 3), carray(u, 2 * count), carray(wi, 3 * count)
    if term == 0:
        draw_cosine(o, numbers, directions)
    else:
        draw_half_power(o, carray(shape, 2)[0] + ONE, numbers, directions)


@batch_function(DENSITY_SIGNATURE)
def density(shape: Any, wo: Any, count: int, wi: Any, out: Any) -> None:
    """cos θ / π and (n + 2) / 2π · (n·h)^(n+1) / (4 ω_o·h); see `studio_core.contract.SampledBrdf`."""
    o, directions, terms = carray(wo, 3), carray(wi, 3 * count), carray(out, 2 * count)
    weigh_cosine(o, directions, terms[:count])
    weigh_half_power(o, carray(shape, 2)[0] + ONE, directions, terms[count:])


class BlinnPhong(Sharp, Functions, TwoLobes):
    """See the module; satisfies `studio_core.contract.Brdf`."""

    id = "blinn-phong"
    label = "Blinn–Phong"
    Params = Params
    functions = evaluate, sample, density
    roles: Mapping[str, str] = frozen_map({"diffuse": "diffuse", "specular": "specular", "gloss": "exponent"})

    def shape(self, values: Mapping[str, Value]) -> npt.NDArray[np.float32]:
        """(2,): exponent and the lobe's peak."""
        n = exponent(values)
        return np.array([n, (n + 2) * (n + 4) / (8 * np.pi * (2 ** (-n / 2) + n))], np.float32)


MODEL = BlinnPhong()
