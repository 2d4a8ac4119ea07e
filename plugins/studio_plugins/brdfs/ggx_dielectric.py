"""A clear glossy skin of known index of refraction (GGX), without anything below it: lacquer on black, glass,
wet stone, piano finish. What isn't reflected is gone.

f_r = tint · (D(h) G(ω_i, ω_o) F(ω_o·h) / (4 (n·ω_i)(n·ω_o)) + F_ms f_ms) with D and G of GGX (Walter et al.
2007, eqs. 33, 34; separable), F the exact Fresnel term of unpolarised light (there, eq. 22), α = roughness²
and the light that bounces between facets, f_ms and F_ms, by Kulla & Conty (2017; see `facets`).
One term: b0 is all of it, c0 = tint.

=============  ========  =====  ============================================================
parameter      range     unit   meaning
=============  ========  =====  ============================================================
tint           0…1       –      colour of the reflection; real ones are white
ior            1.01…3    –      index of refraction: water 1.33, glass 1.5, diamond 2.4
roughness      0…1       –      0 mirror, 1 matte; α = roughness², not below 1e-4
=============  ========  =====  ============================================================
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
    dielectric_fresnel,
    ggx_distribution,
    smith_factor,
)
from studio_core.kernels.lobes import draw_skin, weigh_skin
from studio_core.params import Colour, Value, param
from studio_plugins.brdfs.curves import taken
from studio_plugins.brdfs.facets import alpha_of, lost, mean_fresnel, missing, surviving
from studio_plugins.brdfs.functions import Functions
from studio_plugins.brdfs.roles import Rough


def ior(default: float = 1.5) -> Any:
    """The field of the index of refraction."""
    doc = "Water 1.33, glass and lacquer 1.5, diamond 2.4; higher reflects more"
    return param(default, "Index of refraction", doc, low=1.01, high=3.0)


def roughness(default: float) -> Any:
    """The field of the roughness."""
    return param(default, "Roughness", "0 mirror, 1 matte", low=0.0, high=1.0)


@dataclass(frozen=True)
class Params:
    """Parameters of `GgxDielectric`."""

    tint: Colour = param((1.0, 1.0, 1.0), "Tint", "Of the reflection; white is real", low=0.0, high=1.0)
    ior: float = ior()
    roughness: float = roughness(0.2)


@batch_function(SIGNATURE)
def evaluate(shape: Any, wo: Any, count: int, wi: Any, out: Any) -> None:
    """b0 of the module; see `studio_core.contract.Brdf`. shape: α, index², F_ms / (π (1 − Ē)), 1 − E."""
    s = carray(shape, 19)
    o = carray(wo, 3)
    alpha, index2, share = s[0], s[1], s[2]
    missed = taken(s, 3)
    ox, oy, oz = o[0], o[1], o[2]
    directions = carray(wi, 3 * count)
    x, y, z = directions[:count], directions[count : 2 * count], directions[2 * count :]
    b0 = carray(out, count)
    up = max(oz, ZERO)
    smith = smith_factor(up, alpha)
    back = share * lost(up, missed)
    for k in range(count):
        lit = ONE if (oz > ZERO and z[k] > ZERO) else ZERO
        down = max(z[k], ZERO)
        hx, hy, hz = x[k] + ox, y[k] + oy, max(down + up, LEAST_HEIGHT)
        fresnel = dielectric_fresnel(HALF * np.sqrt(hx * hx + hy * hy + hz * hz), index2)
        lobe = ggx_distribution(hx, hy, hz, alpha) * smith * smith_factor(down, alpha)
        b0[k] = lit * (lobe * fresnel + back * lost(down, missed))


def skin(values: Mapping[str, Value]) -> tuple[float, float, npt.NDArray[np.float32]]:
    """α, the index, and what describes a dielectric skin to kernels: α, index², F_ms / (π (1 − Ē)), 1 − E."""
    alpha, index = alpha_of(values["roughness"]), float(np.clip(values["ior"], 1.01, 3.0))
    gap = missing(alpha)
    share = surviving(float(mean_fresnel(index)), 1 - gap.average) * gap.share
    return alpha, index, np.array([alpha, index * index, share, *gap.curve], np.float32)


@batch_function(SAMPLE_SIGNATURE)
def sample(shape: Any, wo: Any, term: int, count: int, u: Any, wi: Any) -> None:
    """By visible normals, in part as what bounced; see `studio_core.contract.SampledBrdf`."""
    o, numbers, directions = carray(wo, 3), carray(u, 2 * count), carray(wi, 3 * count)
    draw_skin(o, carray(shape, 1)[0], numbers, directions)


@batch_function(DENSITY_SIGNATURE)
def density(shape: Any, wo: Any, count: int, wi: Any, out: Any) -> None:
    """That of `draw_skin`; see `studio_core.contract.SampledBrdf`."""
    o, directions, terms = carray(wo, 3), carray(wi, 3 * count), carray(out, 1 * count)
    weigh_skin(o, carray(shape, 1)[0], directions, terms)


class GgxDielectric(Rough, Functions):
    """See the module; satisfies `studio_core.contract.Brdf`."""

    id = "ggx-dielectric"
    label = "Clear gloss (GGX)"
    Params = Params
    functions = evaluate, sample, density
    terms = 1
    textures: tuple[str, ...] = ("tint",)
    shape_textures: tuple[str, ...] = ("roughness",)
    roles: Mapping[str, str] = frozen_map({"specular": "tint", "gloss": "roughness"})

    def shape(self, values: Mapping[str, Value]) -> npt.NDArray[np.float32]:
        """(19,): see `skin`."""
        return skin(values)[2]

    def coefficients(self, values: Mapping[str, npt.NDArray[np.floating[Any]]]) -> npt.NDArray[np.float32]:
        """(..., 1, 3): the tint."""
        tint: npt.NDArray[np.float32] = np.clip(np.asarray(values["tint"], np.float32), 0, 1)
        return tint[..., None, :]


MODEL = GgxDielectric()
