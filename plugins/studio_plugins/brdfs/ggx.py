"""GGX: metals and glossy dielectrics, the model of today's material libraries.

f_r = matte + D(h) G(ω_i, ω_o) F(ω_o·h) / (4 (n·ω_i)(n·ω_o)) with
D and G = G1·G1 of GGX (Walter et al. 2007, eqs. 33, 34; separable, as in Mitsuba's `roughconductor`),
α = roughness², F = F0 + (1 − F0)(1 − ω_o·h)^5 (Schlick 1994) and
matte = 28/(23π) · base_color (1 − metallic)(1 − F0d) · (1 − (1 − n·ω_i/2)^5)(1 − (1 − n·ω_o/2)^5)
(Ashikhmin & Shirley 2000, eq. 5: what the coat reflects is missing below it, and it is reciprocal).
F0d = 0.08 · specular is a dielectric's reflectance head-on, and F0 is
F0d (1 − metallic) + base_color · metallic.

Terms: b0 the matte kernel; b1 = DG/(4…)(1 − u⁵), b2 = DG/(4…) u⁵ with u = 1 − ω_o·h;
c0 = the matte colour, c1 = F0, c2 = 1 (F90).

=============  ========  =====  ============================================================
parameter      range     unit   meaning
=============  ========  =====  ============================================================
base_color     0…1       –      colour of the matte part, or of the metal; linear Rec.709
metallic       0…1       –      0 plastic, wood, paint …; 1 metal
roughness      0…1       –      0 mirror, 1 matte; α = roughness², not below 1e-4
specular       0…1       –      reflectance of a dielectric, 0.5 is 4 % (index 1.5); 1 is 8 %
=============  ========  =====  ============================================================

Light that bounces several times between facets is lost, as in the papers: a white metal of roughness 1
returns 31 % head-on and 60 % at grazing angles.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

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
    ggx_distribution,
    schlick_weight,
    smith_factor,
)
from studio_core.kernels.lobes import draw_cosine, draw_visible, weigh_cosine, weigh_visible
from studio_core.params import Colour, Value, param
from studio_plugins.brdfs.functions import Functions

LEAST_ALPHA = 1e-4


@dataclass(frozen=True)
class Params:
    """Parameters of `Ggx`."""

    base_color: Colour = param(
        (0.8, 0.8, 0.8), "Colour", "Of the matte part, or of the metal", low=0.0, high=1.0
    )
    metallic: float = param(0.0, "Metal", "0 plastic, wood or paint; 1 metal", low=0.0, high=1.0)
    roughness: float = param(0.5, "Roughness", "0 mirror, 1 matte", low=0.0, high=1.0)
    specular: float = param(
        0.5, "Reflectance", "Of what is not metal: 0.5 reflects 4 % head-on", low=0.0, high=1.0
    )


@batch_function(SIGNATURE)
def evaluate(shape: Any, wo: Any, count: int, wi: Any, out: Any) -> None:
    """The three kernels of the module; see `studio_core.contract.Brdf`. shape: α."""
    alpha = carray(shape, 1)[0]
    o = carray(wo, 3)
    ox, oy, oz = o[0], o[1], o[2]
    directions = carray(wi, 3 * count)
    x, y, z = directions[:count], directions[count : 2 * count], directions[2 * count :]
    terms = carray(out, 3 * count)
    b0, b1, b2 = terms[:count], terms[count : 2 * count], terms[2 * count :]
    seen = oz > ZERO
    up = max(oz, ZERO)
    smith = smith_factor(up, alpha)
    matte = ONE - schlick_weight(HALF * up)
    for k in range(count):
        lit = ONE if (seen and z[k] > ZERO) else ZERO
        down = max(z[k], ZERO)
        hx, hy, hz = x[k] + ox, y[k] + oy, max(down + up, LEAST_HEIGHT)
        # |ω_i + ω_o| / 2 is the cosine between either direction and the half vector.
        fresnel = schlick_weight(HALF * np.sqrt(hx * hx + hy * hy + hz * hz))
        lobe = lit * ggx_distribution(hx, hy, hz, alpha) * smith * smith_factor(down, alpha)
        b0[k] = lit * matte * (ONE - schlick_weight(HALF * down))
        b1[k] = lobe * (ONE - fresnel)
        b2[k] = lobe * fresnel


@batch_function(SAMPLE_SIGNATURE)
def sample(shape: Any, wo: Any, term: int, count: int, u: Any, wi: Any) -> None:
    """By the cosine, and by visible normals; see `studio_core.contract.SampledBrdf`."""
    o, numbers, directions = carray(wo, 3), carray(u, 2 * count), carray(wi, 3 * count)
    alpha = carray(shape, 1)[0]
    if term == 0:
        draw_cosine(o, numbers, directions)
    else:
        draw_visible(o, alpha, alpha, numbers, directions)


@batch_function(DENSITY_SIGNATURE)
def density(shape: Any, wo: Any, count: int, wi: Any, out: Any) -> None:
    """cos θ / π, and G1 D / (4 n·ω_o) twice; see `studio_core.contract.SampledBrdf`."""
    o, directions, terms = carray(wo, 3), carray(wi, 3 * count), carray(out, 3 * count)
    alpha = carray(shape, 1)[0]
    weigh_cosine(o, directions, terms[:count])
    weigh_visible(o, alpha, directions, terms[count : 2 * count])
    weigh_visible(o, alpha, directions, terms[2 * count :])


class Ggx(Functions):
    """See the module; satisfies `studio_core.contract.Brdf`."""

    id = "ggx"
    label = "Glossy or metal (GGX)"
    Params = Params
    functions = evaluate, sample, density
    terms = 3
    textures: tuple[str, ...] = ("base_color", "metallic", "specular")
    shape_textures: tuple[str, ...] = ("roughness",)

    def shape(self, values: Mapping[str, Value]) -> npt.NDArray[np.float32]:
        """(1,): α."""
        roughness = float(np.clip(values["roughness"], 0.0, 1.0))
        return np.array([max(roughness * roughness, LEAST_ALPHA)], np.float32)

    def coefficients(self, values: Mapping[str, npt.NDArray[np.floating[Any]]]) -> npt.NDArray[np.float32]:
        """(..., 3, 3): the matte colour, F0 and F90."""
        base = np.clip(np.asarray(values["base_color"], np.float32), 0, 1)
        metallic = np.clip(np.asarray(values["metallic"], np.float32), 0, 1)[..., None]
        dielectric = np.float32(0.08) * np.clip(np.asarray(values["specular"], np.float32), 0, 1)[..., None]
        matte = np.float32(28 / (23 * np.pi)) * base * (1 - metallic) * (1 - dielectric)
        f0 = dielectric * (1 - metallic) + base * metallic
        return np.stack(np.broadcast_arrays(matte, f0, np.ones_like(f0)), axis=-2)


MODEL = Ggx()
