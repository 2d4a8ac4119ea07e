"""Ashikhmin–Shirley: a matte part under a coat that shines more towards the edge, with a grain.

f_r = 28/(23π) · diffuse (1 − specular) · (1 − (1 − n·ω_i/2)^5)(1 − (1 − n·ω_o/2)^5)
+ √((n_u + 1)(n_v + 1)) / (8π) · (n·h)^(n_u cos²φ + n_v sin²φ) / ((ω_o·h) max(n·ω_i, n·ω_o)) · F(ω_o·h)
with F(u) = specular + (1 − specular)(1 − u)^5 and φ the azimuth of h from the grain (Ashikhmin & Shirley,
"An Anisotropic Phong BRDF Model", 2000, eqs. 3–5; Schlick 1994). With F = 1 the lobe returns
∫ p(ω_i) n·ω_i / max(n·ω_i, n·ω_o) dω_i ≤ 1 for the density p of its own draws; what the coat reflects is
missing in the matte part, so all of it together returns no more than arrives, from any side.
Terms: b0 the matte kernel, b1 = lobe (1 − (1 − u)^5), b2 = lobe (1 − u)^5;
c0 = the matte colour, c1 = specular (F0), c2 = 1 (F90).

================  ========  =====  ===========================================================
parameter         range     unit   meaning
================  ========  =====  ===========================================================
diffuse           0…1       –      albedo of the matte part below the coat, linear Rec.709
specular          0…1       –      reflection head-on, F0, linear Rec.709; at grazing angles all
sharpness_along   1…1e5     –      exponent n_u along the grain
sharpness_across  1…1e5     –      exponent n_v across it; lower stretches the highlight that way
direction         ±180      °      of the grain, from the frame's x axis (the texture's u)
================  ========  =====  ===========================================================
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
    LEAST_HEIGHT,
    ONE,
    SAMPLE_SIGNATURE,
    SIGNATURE,
    ZERO,
    carray,
    power_of_complement,
    schlick_weight,
)
from studio_core.kernels.lobes import draw_cosine, weigh_cosine
from studio_core.kernels.sampling import LEAST_LENGTH, TURN, power_height, reflected
from studio_core.params import Colour, Value, param
from studio_plugins.brdfs.functions import Functions
from studio_plugins.brdfs.grain import along, grain_direction

F = np.float32
_TWO = np.float32(2.0)
_LEAST = np.float32(1e-20)  # what is less would end among denormal numbers, which take long


def _sharpness(default: float, way: str) -> Any:
    doc = f"Of the highlight {way} the grain; higher is smaller and brighter"
    return param(default, f"Sharpness {way}", doc, low=1.0, high=1e5, scale="log")


@dataclass(frozen=True)
class Params:
    """Parameters of `AshikhminShirley`."""

    diffuse: Colour = param((0.4, 0.4, 0.4), "Matte colour", "Of the part below the coat", low=0.0, high=1.0)
    specular: Colour = param(
        (0.1, 0.1, 0.1), "Highlight colour", "What the coat reflects head-on", low=0.0, high=1.0
    )
    sharpness_along: float = _sharpness(1000.0, "along")
    sharpness_across: float = _sharpness(30.0, "across")
    direction: float = grain_direction()


@kernel
def _half_power(hx: F, hy: F, flat: F, c: F, d: F, n: F, m: F) -> F:
    """Half of n_u cos²φ + n_v sin²φ of a half vector whose level part has the square `flat`."""
    gx, gy = c * hx + d * hy, c * hy - d * hx
    made: F = HALF * (n * gx * gx + m * gy * gy) / max(flat, LEAST_LENGTH)
    return made


@batch_function(SIGNATURE)
def evaluate(shape: Any, wo: Any, count: int, wi: Any, out: Any) -> None:
    """The three kernels of the module; see `studio_core.contract.Brdf`.

    shape: the grain's cos and sin, n_u, n_v, √((n_u + 1)(n_v + 1)) / 2π.
    """
    s, o = carray(shape, 5), carray(wo, 3)
    c, d, n, m, peak = s[0], s[1], s[2], s[3], s[4]
    ox, oy, oz = o[0], o[1], o[2]
    directions = carray(wi, 3 * count)
    x, y, z = directions[:count], directions[count : 2 * count], directions[2 * count :]
    terms = carray(out, 3 * count)
    b0, b1, b2 = terms[:count], terms[count : 2 * count], terms[2 * count :]
    up = max(oz, ZERO)
    matte = ONE - schlick_weight(HALF * up)
    for k in range(count):
        lit = ONE if (oz > ZERO and z[k] > ZERO) else ZERO
        down = max(z[k], ZERO)
        hx, hy, hz = x[k] + ox, y[k] + oy, max(down + up, LEAST_HEIGHT)
        flat, height = hx * hx + hy * hy, hz * hz
        whole = flat + height
        facets = power_of_complement(flat / whole, height / whole, _half_power(hx, hy, flat, c, d, n, m))
        size = np.sqrt(whole)  # twice the cosine between h and either direction
        fresnel = schlick_weight(HALF * size)
        shown = lit if facets > _LEAST else ZERO
        lobe = shown * HALF * peak * facets / (size * max(max(down, up), LEAST_HEIGHT))
        b0[k] = lit * matte * (ONE - schlick_weight(HALF * down))
        b1[k] = lobe * (ONE - fresnel)
        b2[k] = lobe * fresnel


@batch_function(SAMPLE_SIGNATURE)
def sample(shape: Any, wo: Any, term: int, count: int, u: Any, wi: Any) -> None:
    """By the cosine, and reflected at facets drawn by p(h) (eqs. 9 and 10): no weight exceeds 1."""
    s, o, numbers, w = carray(shape, 5), carray(wo, 3), carray(u, 2 * count), carray(wi, 3 * count)
    if term == 0:
        draw_cosine(o, numbers, w)
        return
    c, d, n, m = s[0], s[1], s[2], s[3]
    ox, oy, oz = o[0], o[1], o[2]
    for k in range(count):
        turn = TURN * numbers[count + k]
        gx, gy = np.cos(turn) / np.sqrt(n + ONE), np.sin(turn) / np.sqrt(m + ONE)
        size = np.sqrt(gx * gx + gy * gy)
        gx, gy = gx / size, gy / size
        t = power_height(numbers[k], n * gx * gx + m * gy * gy)
        sine, hz = np.sqrt(max(t * (_TWO - t), ZERO)), ONE - t
        hx, hy = sine * (c * gx - d * gy), sine * (d * gx + c * gy)
        facing = ox * hx + oy * hy + oz * hz > ZERO
        x, y, z = reflected(ox, oy, oz, hx, hy, hz)
        w[k], w[count + k] = x, y
        w[2 * count + k] = z if (facing and oz > ZERO) else -ONE


@batch_function(DENSITY_SIGNATURE)
def density(shape: Any, wo: Any, count: int, wi: Any, out: Any) -> None:
    """cos θ / π, and p(h) / (4 ω_o·h) twice; see `studio_core.contract.SampledBrdf`."""
    s, o, w, terms = carray(shape, 5), carray(wo, 3), carray(wi, 3 * count), carray(out, 3 * count)
    c, d, n, m, peak = s[0], s[1], s[2], s[3], s[4]
    weigh_cosine(o, w, terms[:count])
    ox, oy, oz = o[0], o[1], o[2]
    x, y, z = w[:count], w[count : 2 * count], w[2 * count :]
    one, other = terms[count : 2 * count], terms[2 * count :]
    for k in range(count):
        lit = ONE if (oz > ZERO and z[k] > ZERO) else ZERO
        hx, hy, hz = x[k] + ox, y[k] + oy, max(z[k] + oz, LEAST_HEIGHT)
        flat, height = hx * hx + hy * hy, hz * hz
        whole = flat + height
        facets = power_of_complement(flat / whole, height / whole, _half_power(hx, hy, flat, c, d, n, m))
        shown = lit if facets > _LEAST else ZERO
        drawn = shown * HALF * peak * facets / np.sqrt(whole)
        one[k] = drawn
        other[k] = drawn


class AshikhminShirley(Functions):
    """See the module; satisfies `studio_core.contract.Brdf`."""

    id = "ashikhmin-shirley"
    label = "Coated, with a grain (Ashikhmin–Shirley)"
    Params = Params
    functions = evaluate, sample, density
    terms = 3
    textures: tuple[str, ...] = ("diffuse", "specular")
    roles: Mapping[str, str] = frozen_map({"diffuse": "diffuse", "specular": "specular"})

    def shape(self, values: Mapping[str, Value]) -> npt.NDArray[np.float32]:
        """(5,): the grain's direction, both exponents and the peak of p(h)."""
        n = float(np.clip(values["sharpness_along"], 1.0, 1e5))
        m = float(np.clip(values["sharpness_across"], 1.0, 1e5))
        return np.array([*along(values), n, m, np.sqrt((n + 1) * (m + 1)) / (2 * np.pi)], np.float32)

    def coefficients(self, values: Mapping[str, npt.NDArray[np.floating[Any]]]) -> npt.NDArray[np.float32]:
        """(..., 3, 3): the matte colour, F0 and F90."""
        diffuse = np.clip(np.asarray(values["diffuse"], np.float32), 0, 1)
        f0 = np.clip(np.asarray(values["specular"], np.float32), 0, 1)
        matte = np.float32(28 / (23 * np.pi)) * diffuse * (1 - f0)
        return np.stack(np.broadcast_arrays(matte, f0, np.ones_like(f0)), axis=-2)


MODEL = AshikhminShirley()
