"""Oren–Nayar: matte surfaces of rough facets, such as plaster, clay, concrete and cloth seen from afar.

The energy-preserving form (Portsmouth, Kutz & Hill, "EON: A practical energy-preserving rough diffuse
BRDF", 2024), which keeps Oren & Nayar's flattened shading (1994; single scattering in Fujii's form) and
gives back the light that bounces between facets. The full model of 1994 adds one bounce, loses the rest
and has kinks at its cases; Fujii's alone loses up to 18 %. This one is reciprocal, a white surface returns
all light from every direction, and it needs two terms only:

f_r = c0 b0 + c1 b1 with A = 1 / (1 + (1/2 − 2/3π) r), s = ω_i·ω_o − cosθ_i cosθ_o,
b0 = A/π (1 + r s / t), t = max(cosθ_i, cosθ_o) where s > 0 and 1 elsewhere, c0 = ρ;
b1 = (1 − E(θ_i)) (1 − E(θ_o)) / (π (1 − Ē)), c1 = ρ² Ē / (1 − ρ (1 − Ē)).
E, the albedo of b0, is known in closed form: E(θ) = A (1 + r G(θ)/π) with
G = sinθ (θ − sinθ cosθ) + 2/3 (tanθ (1 − sin³θ) − sinθ), and Ē = A (1 + (2/3 − 28/15π) r).

=============  ======  =====  =================================================================
parameter      range   unit   meaning
=============  ======  =====  =================================================================
base_color     0…1     –      albedo ρ of the facets, linear Rec.709; rough colours saturate a little
roughness      0…1     –      r: 0 is Lambert's, 1 as rough as it gets
=============  ======  =====  =================================================================
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from studio_core.arrays import frozen_map
from studio_core.jit import batch_function, kernel
from studio_core.kernels.brdf import (
    DENSITY_SIGNATURE,
    HALF,
    INV_PI,
    ONE,
    SAMPLE_SIGNATURE,
    SIGNATURE,
    ZERO,
    arc_cosine,
    carray,
)
from studio_core.kernels.sampling import cosine_density, cosine_direction, even_direction
from studio_core.params import Colour, Value, param
from studio_plugins.brdfs.functions import Functions

_FALL = 0.5 - 2 / (3 * np.pi)
_MEAN = 2 / 3 - 28 / (15 * np.pi)
_GRAZING = np.float32(_FALL)  # where G / π ends, so that E ends at 1
_TWO_THIRDS = np.float32(2 / 3)
_LEAST = np.float32(1e-30)
_LEAST_SHARE = np.float32(1e-6)  # what is less has no inverse to count with


@dataclass(frozen=True)
class Params:
    """Parameters of `OrenNayar`."""

    base_color: Colour = param((0.8, 0.8, 0.8), "Colour", "Albedo of the facets", low=0.0, high=1.0)
    roughness: float = param(
        0.5, "Roughness", "0 is plain matte; 1 looks flat, like chalk or the moon", low=0.0, high=1.0
    )


@kernel
def _bulge(cosine: np.float32) -> np.float32:
    """G(θ) / π of the module, without a tangent."""
    sine = np.sqrt(max(ONE - cosine * cosine, ZERO))
    raised = cosine * (ONE + sine + sine * sine) / (ONE + sine)  # (1 − sin³) / cos
    around = sine * (arc_cosine(cosine) - sine * cosine)
    made: np.float32 = (around + _TWO_THIRDS * sine * (raised - ONE)) * INV_PI
    return made


@batch_function(SIGNATURE)
def evaluate(shape: Any, wo: Any, count: int, wi: Any, out: Any) -> None:
    """The kernels of the module; see `studio_core.contract.Brdf`. shape: r, A, A r / (π (_FALL − _MEAN)).

    1 − E = A r (_FALL − G/π): written so, nothing cancels where r is small.
    """
    s = carray(shape, 3)
    o = carray(wo, 3)
    r, a, share = s[0], s[1], s[2]
    ox, oy, oz = o[0], o[1], o[2]
    directions = carray(wi, 3 * count)
    x, y, z = directions[:count], directions[count : 2 * count], directions[2 * count :]
    terms = carray(out, 2 * count)
    b0, b1 = terms[:count], terms[count:]
    up = min(max(oz, ZERO), ONE)
    lost = max(_GRAZING - _bulge(up), ZERO) * share
    for k in range(count):
        lit = ONE if (oz > ZERO and z[k] > ZERO) else ZERO
        down = min(max(z[k], ZERO), ONE)
        along = x[k] * ox + y[k] * oy
        lifted = along / max(max(down, up), _LEAST) if along > ZERO else max(along, -ONE)
        b0[k] = lit * a * INV_PI * (ONE + r * lifted)
        b1[k] = lit * lost * max(_GRAZING - _bulge(down), ZERO)


@kernel
def _even_share(r: np.float32, up: np.float32) -> np.float32:
    """Of the draws of b0, which is bright at grazing angles: b0 cosθ_i ≤ A (1 + r) / π, not less there."""
    share = HALF * r * max(ONE - up, ZERO)
    return share if share > _LEAST_SHARE else ZERO


@batch_function(SAMPLE_SIGNATURE)
def sample(shape: Any, wo: Any, term: int, count: int, u: Any, wi: Any) -> None:
    """By the cosine, b0 in part evenly; see `studio_core.contract.SampledBrdf`."""
    oz = carray(wo, 3)[2]
    numbers = carray(u, 2 * count)
    u0, u1 = numbers[:count], numbers[count:]
    directions = carray(wi, 3 * count)
    x, y, z = directions[:count], directions[count : 2 * count], directions[2 * count :]
    even = _even_share(carray(shape, 3)[0], oz) if term == 0 else ZERO
    for k in range(count):
        if u0[k] < even:
            a, b, c = even_direction(u0[k] / even, u1[k])
        else:
            a, b, c = cosine_direction((u0[k] - even) / (ONE - even), u1[k])
        x[k], y[k], z[k] = a, b, (c if oz > ZERO else -ONE)


@batch_function(DENSITY_SIGNATURE)
def density(shape: Any, wo: Any, count: int, wi: Any, out: Any) -> None:
    """cos θ / π, for b0 mixed with 1 / 2π; see `studio_core.contract.SampledBrdf`."""
    oz = carray(wo, 3)[2]
    z = carray(wi, 3 * count)[2 * count :]
    terms = carray(out, 2 * count)
    d0, d1 = terms[:count], terms[count:]
    even = _even_share(carray(shape, 3)[0], oz)
    for k in range(count):
        lit = ONE if (oz > ZERO and z[k] > ZERO) else ZERO
        d1[k] = lit * cosine_density(z[k])
        d0[k] = (ONE - even) * d1[k] + even * lit * HALF * INV_PI


class OrenNayar(Functions):
    """See the module; satisfies `studio_core.contract.Brdf`."""

    id = "oren-nayar"
    label = "Matte, rough (Oren–Nayar)"
    Params = Params
    functions = evaluate, sample, density
    terms = 2
    textures: tuple[str, ...] = ("base_color",)
    roles: Mapping[str, str] = frozen_map({"diffuse": "base_color"})

    def shape(self, values: Mapping[str, Value]) -> npt.NDArray[np.float32]:
        """(3,): r, A and the factor of b1."""
        r = float(np.clip(values["roughness"], 0.0, 1.0))
        a = 1 / (1 + _FALL * r)
        return np.array([r, a, a * r / (np.pi * (_FALL - _MEAN))], np.float32)

    def coefficients(self, values: Mapping[str, npt.NDArray[np.floating[Any]]]) -> npt.NDArray[np.float32]:
        """(..., 2, 3): ρ, and ρ² Ē / (1 − ρ (1 − Ē))."""
        base = np.clip(np.asarray(values["base_color"], np.float32), 0, 1)
        r = np.clip(np.asarray(values["roughness"], np.float32), 0, 1)[..., None]
        mean = (1 + np.float32(_MEAN) * r) / (1 + np.float32(_FALL) * r)
        bounced = base * base * mean / (1 - base * (1 - mean))
        return np.stack(np.broadcast_arrays(base, bounced), axis=-2)


MODEL = OrenNayar()
