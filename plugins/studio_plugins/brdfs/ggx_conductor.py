"""Metal: GGX facets with a colour head-on and another at the edge, nothing lost between facets.

f_r = D(h) G(ω_i, ω_o) F(ω_o·h) / (4 (n·ω_i)(n·ω_o)) + F_ms f_ms with D and G of GGX (Walter et al. 2007,
eqs. 33, 34; separable), α = roughness², and f_ms and F_ms by Kulla & Conty (2017; see `facets`).
F(u) = F0 + (1 − F0)(1 − u)^5 − a u (1 − u)^6: Schlick's curve with the dip that real metals have before
grazing (Lazányi & Szirmay-Kalos 2005), set by the colour at 82° as a share of Schlick's (Kutz, Hašan &
Edmondson, "Novel aspects of the Adobe Standard Material", 2021):
a = (F0 + (1 − F0)(6/7)^5) (1 − edge) · 7 (7/6)^6, but never so large that F would fall
below a tenth of Schlick's.

Terms: b0 = DG/(4…)(1 − (1 − u)^5), b1 = DG/(4…)(1 − u)^5, b2 = DG/(4…) u (1 − u)^6, b3 = f_ms;
c0 = F0, c1 = 1, c2 = −a, c3 = F_ms with F̄ = F0 + (1 − F0)/21 − a/126.

=============  ========  =====  ============================================================
parameter      range     unit   meaning
=============  ========  =====  ============================================================
base_color     0…1       –      reflection head-on, F0, linear Rec.709: gold (1, 0.78, 0.34)
edge_tint      0…1       –      at 82°, as a share of what Schlick's curve has there; white: none
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
    ggx_distribution,
    schlick_weight,
    smith_factor,
)
from studio_core.kernels.lobes import draw_bounced, draw_visible, weigh_bounced, weigh_visible
from studio_core.params import Colour, Value, param
from studio_plugins.brdfs.curves import taken
from studio_plugins.brdfs.facets import alpha_of, average_bounce, lost, missing, surviving
from studio_plugins.brdfs.functions import Functions
from studio_plugins.brdfs.ggx_dielectric import roughness
from studio_plugins.brdfs.roles import Rough

_EDGE = 7 * (7 / 6) ** 6  # 1 / (u (1 − u)^6) at u = 1/7, where that is largest
_U = (np.arange(2000) + 0.5) / 2000
_F0 = np.linspace(0.0, 1.0, 257) ** 3  # dense where the deepest dip bends
_LOWEST = (1 - _U) ** 5, _U * (1 - _U) ** 6
_DEEPEST = 0.9 * np.array([((f + (1 - f) * _LOWEST[0]) / _LOWEST[1]).min() for f in _F0])


@dataclass(frozen=True)
class Params:
    """Parameters of `GgxConductor`."""

    base_color: Colour = param((0.9, 0.9, 0.9), "Colour", "What it reflects head-on", low=0.0, high=1.0)
    edge_tint: Colour = param(
        (1.0, 1.0, 1.0), "Edge tint", "Of the rim; white for the plain rise to white", low=0.0, high=1.0
    )
    roughness: float = roughness(0.3)


@batch_function(SIGNATURE)
def evaluate(shape: Any, wo: Any, count: int, wi: Any, out: Any) -> None:
    """The four kernels of the module; see `studio_core.contract.Brdf`. shape: α, 1 / (π (1 − Ē)), 1 − E."""
    s = carray(shape, 18)
    o = carray(wo, 3)
    alpha, share = s[0], s[1]
    missed = taken(s, 2)
    ox, oy, oz = o[0], o[1], o[2]
    directions = carray(wi, 3 * count)
    x, y, z = directions[:count], directions[count : 2 * count], directions[2 * count :]
    terms = carray(out, 4 * count)
    b0, b1 = terms[:count], terms[count : 2 * count]
    b2, b3 = terms[2 * count : 3 * count], terms[3 * count :]
    up = max(oz, ZERO)
    smith = smith_factor(up, alpha)
    back = share * lost(up, missed)
    for k in range(count):
        lit = ONE if (oz > ZERO and z[k] > ZERO) else ZERO
        down = max(z[k], ZERO)
        hx, hy, hz = x[k] + ox, y[k] + oy, max(down + up, LEAST_HEIGHT)
        u = min(HALF * np.sqrt(hx * hx + hy * hy + hz * hz), ONE)
        fresnel = schlick_weight(u)
        lobe = lit * ggx_distribution(hx, hy, hz, alpha) * smith * smith_factor(down, alpha)
        b0[k] = lobe * (ONE - fresnel)
        b1[k] = lobe * fresnel
        b2[k] = lobe * fresnel * u * (ONE - u)
        b3[k] = lit * back * lost(down, missed)


@batch_function(SAMPLE_SIGNATURE)
def sample(shape: Any, wo: Any, term: int, count: int, u: Any, wi: Any) -> None:
    """By visible normals, and what bounced by itself; see `studio_core.contract.SampledBrdf`."""
    o, numbers, directions = carray(wo, 3), carray(u, 2 * count), carray(wi, 3 * count)
    alpha = carray(shape, 1)[0]
    if term == 3:
        draw_bounced(o, alpha, numbers, directions)
    else:
        draw_visible(o, alpha, alpha, numbers, directions)


@batch_function(DENSITY_SIGNATURE)
def density(shape: Any, wo: Any, count: int, wi: Any, out: Any) -> None:
    """G1 D / (4 n·ω_o) three times, and that of `draw_bounced`; see `studio_core.contract.SampledBrdf`."""
    o, directions, terms = carray(wo, 3), carray(wi, 3 * count), carray(out, 4 * count)
    alpha = carray(shape, 1)[0]
    for term in range(3):
        weigh_visible(o, alpha, directions, terms[term * count : (term + 1) * count])
    weigh_bounced(o, alpha, directions, terms[3 * count :])


class GgxConductor(Rough, Functions):
    """See the module; satisfies `studio_core.contract.Brdf`."""

    id = "ggx-conductor"
    label = "Metal (GGX)"
    Params = Params
    functions = evaluate, sample, density
    terms = 4
    textures: tuple[str, ...] = ("base_color", "edge_tint")
    roles: Mapping[str, str] = frozen_map({"specular": "base_color", "gloss": "roughness"})

    def shape(self, values: Mapping[str, Value]) -> npt.NDArray[np.float32]:
        """(18,): α, 1 / (π (1 − Ē)), and the curve of 1 − E."""
        alpha = alpha_of(values["roughness"])
        gap = missing(alpha)
        return np.array([alpha, gap.share, *gap.curve], np.float32)

    def coefficients(self, values: Mapping[str, npt.NDArray[np.floating[Any]]]) -> npt.NDArray[np.float32]:
        """(..., 4, 3): F0, 1, −a and F_ms."""
        f0 = np.clip(np.asarray(values["base_color"], np.float32), 0, 1)
        edge = np.clip(np.asarray(values["edge_tint"], np.float32), 0, 1)
        dip = (f0 + (1 - f0) * np.float32((6 / 7) ** 5)) * (1 - edge) * np.float32(_EDGE)
        dip = np.minimum(dip, np.interp(f0, _F0, _DEEPEST).astype(np.float32))
        mean = f0 + (1 - f0) / 21 - dip / 126
        kept = surviving(mean, average_bounce(values["roughness"])[..., None])
        return np.stack(np.broadcast_arrays(f0, np.ones_like(f0), -dip, kept), axis=-2).astype(np.float32)


MODEL = GgxConductor()
