"""GGX: metals and glossy dielectrics, the model of today's material libraries.

f_r = matte + D(h) G(ω_i, ω_o) F(ω_o·h) / (4 (n·ω_i)(n·ω_o)) + F_ms f_ms with
D and G = G1·G1 of GGX (Walter et al. 2007, eqs. 33, 34; separable, as in Mitsuba's `roughconductor`),
α = roughness², F = F0 + (1 − F0)(1 − ω_o·h)^5 (Schlick 1994); F0d = 0.08 · specular is a dielectric's
reflectance head-on, and F0 is F0d (1 − metallic) + base_color · metallic.

F_ms f_ms is the light that bounces between facets (Kulla & Conty 2017; see `facets`). Their F_ms(F0, α) is
replaced by B F0 + (1 − B) g(F0) with B = 0.54 − 0.81 (1 − Ē(α)), g = 0.49 t² / (1 − 0.51 t) and
t = max(F0 − 0.08, 0) / 0.92, so that colours stay in front of terms of the roughness: white is exact, and all
other reflectances within 0.01 of the arriving light, from any angle at any roughness.

matte = base_color (1 − metallic) · ((1 − F0d) (1 − Y(θ_i))(1 − Y(θ_o)) / (π (1 − Ȳ)) + F0d (1 − B) f_ms),
where Y is the albedo of DG/(4…)(1 − ω_o·h)^5: what the coat reflects is missing below it, what its facets
lose goes below, it is reciprocal, and white returns all.

Terms: b0 the first matte kernel; b1 = DG/(4…)(1 − u⁵) + B f_ms, b2 = DG/(4…) u⁵ with u = 1 − ω_o·h,
b3 = (1 − B) f_ms; c0 = the matte colour, c1 = F0, c2 = 1 (F90), c3 = g(F0) + base_color (1 − metallic) F0d;
g is 0 for all dielectrics. Under a single picture c3 is the line nearest to it over the texels, so that a
metal's tint is as live as a wall's.

=============  ========  =====  ============================================================
parameter      range     unit   meaning
=============  ========  =====  ============================================================
base_color     0…1       –      colour of the matte part, or of the metal; linear Rec.709
metallic       0…1       –      0 plastic, wood, paint …; 1 metal
roughness      0…1       –      0 mirror, 1 matte; α = roughness², not below 1e-4
specular       0…1       –      reflectance of a dielectric, 0.5 is 4 % (index 1.5); 1 is 8 %
keep_energy    yes/no    –      no: without f_ms, as programs show it that follow one bounce
=============  ========  =====  ============================================================
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
    ggx_distribution,
    schlick_weight,
    smith_factor,
)
from studio_core.kernels.lobes import (
    draw_bounced,
    draw_cosine,
    draw_skin,
    draw_visible,
    weigh_bounced,
    weigh_cosine,
    weigh_skin,
    weigh_visible,
)
from studio_core.params import Colour, Value, param
from studio_plugins.brdfs.curves import taken
from studio_plugins.brdfs.facets import alpha_of, below_rim, lost, missing, rim
from studio_plugins.brdfs.functions import Functions
from studio_plugins.brdfs.roles import Rough

_PLAIN, _COLOURED = 0.54, 0.81  # B = 0.54 − 0.81 (1 − Ē)
_BEND = np.float32(0.51)
_MOST = np.float32(0.08)  # F0 of what is not metal


def keep_energy() -> Any:
    """The field of light between facets."""
    doc = "Light that bounces between facets; without it rough metals are darker"
    return param(True, "Keep energy", doc)


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
    keep_energy: bool = keep_energy()


@kernel
def four_terms(s: Any, o: Any, directions: Any, terms: Any) -> None:
    """The four kernels of the module, of directions (3 · count,), to terms (4 · count,).

    s: α, B / (π (1 − Ē)), (1 − B) / (π (1 − Ē)), 1 / (1 − Ȳ), and the curves of 1 − E and of the rim.
    """
    count = len(directions) // 3
    alpha, plain, coloured, ground = s[0], s[1], s[2], s[3]
    missed, edge = taken(s, 4), taken(s, 20)
    ox, oy, oz = o[0], o[1], o[2]
    x, y, z = directions[:count], directions[count : 2 * count], directions[2 * count :]
    b0, b1 = terms[:count], terms[count : 2 * count]
    b2, b3 = terms[2 * count : 3 * count], terms[3 * count :]
    seen = oz > ZERO
    up = max(oz, ZERO)
    smith = smith_factor(up, alpha)
    gone = lost(up, missed)
    matte = ground * below_rim(up, gone, edge)
    for k in range(count):
        lit = ONE if (seen and z[k] > ZERO) else ZERO
        down = max(z[k], ZERO)
        hx, hy, hz = x[k] + ox, y[k] + oy, max(down + up, LEAST_HEIGHT)
        # |ω_i + ω_o| / 2 is the cosine between either direction and the half vector.
        fresnel = schlick_weight(HALF * np.sqrt(hx * hx + hy * hy + hz * hz))
        lobe = lit * ggx_distribution(hx, hy, hz, alpha) * smith * smith_factor(down, alpha)
        missing_here = lost(down, missed)
        bounced = lit * gone * missing_here
        b0[k] = lit * matte * below_rim(down, missing_here, edge)
        b1[k] = lobe * (ONE - fresnel) + plain * bounced
        b2[k] = lobe * fresnel
        b3[k] = coloured * bounced


@kernel
def draw(term: int, o: Any, alpha: np.float32, numbers: Any, directions: Any) -> None:
    """For one of the four terms: by the cosine, by visible normals, or as what bounced."""
    if term == 0:
        draw_cosine(o, numbers, directions)
    elif term == 1:
        draw_skin(o, alpha, numbers, directions)
    elif term == 2:
        draw_visible(o, alpha, alpha, numbers, directions)
    else:
        draw_bounced(o, alpha, numbers, directions)


@kernel
def weigh(o: Any, alpha: np.float32, directions: Any, terms: Any) -> None:
    """Densities (4 · count,) of `draw`: cos θ / π, that of `draw_skin`, G1 D / (4 n·ω_o), what bounced."""
    count = len(directions) // 3
    weigh_cosine(o, directions, terms[:count])
    weigh_skin(o, alpha, directions, terms[count : 2 * count])
    weigh_visible(o, alpha, directions, terms[2 * count : 3 * count])
    weigh_bounced(o, alpha, directions, terms[3 * count :])


@batch_function(SIGNATURE)
def evaluate(shape: Any, wo: Any, count: int, wi: Any, out: Any) -> None:
    """`four_terms`; see `studio_core.contract.Brdf`."""
    four_terms(carray(shape, 36), carray(wo, 3), carray(wi, 3 * count), carray(out, 4 * count))


@batch_function(SAMPLE_SIGNATURE)
def sample(shape: Any, wo: Any, term: int, count: int, u: Any, wi: Any) -> None:
    """`draw`; see `studio_core.contract.SampledBrdf`."""
    draw(term, carray(wo, 3), carray(shape, 1)[0], carray(u, 2 * count), carray(wi, 3 * count))


@batch_function(DENSITY_SIGNATURE)
def density(shape: Any, wo: Any, count: int, wi: Any, out: Any) -> None:
    """`weigh`; see `studio_core.contract.SampledBrdf`."""
    weigh(carray(wo, 3), carray(shape, 1)[0], carray(wi, 3 * count), carray(out, 4 * count))


class Ggx(Rough, Functions):
    """See the module; satisfies `studio_core.contract.Brdf`."""

    id = "ggx"
    label = "Glossy or metal (GGX)"
    Params = Params
    functions = evaluate, sample, density
    terms = 4
    textures: tuple[str, ...] = ("base_color", "metallic", "specular")
    shape_textures: tuple[str, ...] = ("roughness",)
    straightened: tuple[int, ...] = (3,)
    roles: Mapping[str, str] = frozen_map(
        {"diffuse": "base_color", "specular": "specular", "gloss": "roughness"}
    )

    def shape(self, values: Mapping[str, Value]) -> npt.NDArray[np.float32]:
        """(36,): α, B and 1 − B over π (1 − Ē), 1 / (1 − Ȳ), and the curves of 1 − E and of the rim."""
        alpha = alpha_of(values["roughness"])
        gap, edge = missing(alpha), rim(alpha)
        plain = _PLAIN - _COLOURED * gap.average
        share = gap.share if values.get("keep_energy", True) else 0.0
        numbers = [alpha, plain * share, (1 - plain) * share, 1 / edge.below]
        return np.array([*numbers, *gap.curve, *edge.curve], np.float32)

    def coefficients(self, values: Mapping[str, npt.NDArray[np.floating[Any]]]) -> npt.NDArray[np.float32]:
        """(..., 4, 3): the matte colour, F0, F90 and what of F0 survives several bounces."""
        base = np.clip(np.asarray(values["base_color"], np.float32), 0, 1)
        metallic = np.clip(np.asarray(values["metallic"], np.float32), 0, 1)[..., None]
        dielectric = _MOST * np.clip(np.asarray(values["specular"], np.float32), 0, 1)[..., None]
        matte = np.float32(1 / np.pi) * base * (1 - metallic) * (1 - dielectric)
        f0 = dielectric * (1 - metallic) + base * metallic
        bounced = bounced_share(f0) + base * (1 - metallic) * dielectric
        return np.stack(np.broadcast_arrays(matte, f0, np.ones_like(f0), bounced), axis=-2)


def bounced_share(f0: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
    """g(F0) of the module."""
    t = np.maximum(f0 - _MOST, 0) / (1 - _MOST)
    made: npt.NDArray[np.float32] = (1 - _BEND) * t * t / (1 - _BEND * t)
    return made


MODEL = Ggx()
