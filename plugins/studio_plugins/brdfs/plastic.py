"""A coloured ground under a clear glossy skin: plastic, lacquered wood, glazed tiles, gloss paint, leather.

The skin is `ggx-dielectric`. What it lets through, T(θ) = 1 − its albedo, meets a matte ground that sends
it back; part of that is thrown down again from inside, and each round takes the ground's colour once more:

f_r = gloss · f_skin + T(θ_i) T(θ_o) / (π T̄) · ρ (1 − F) / (1 − ρ F)

(Wolff 1994's inside reflections as a closed sum, with Kulla & Conty's (2017) reciprocal coupling through
albedos; T̄ = 2 ∫ T μ dμ). It is reciprocal and returns all light where the ground is white. F, what is thrown
down from inside, is `depth` · (1 − (1 − F̄) / index²), F̄ the mean reflection from outside:
0.60 for the index 1.5.
Terms: b0 = f_skin, b1 = T T / (π T̄); c0 = gloss, c1 = ρ (1 − F) / (1 − ρ F).

=============  ========  =====  ============================================================
parameter      range     unit   meaning
=============  ========  =====  ============================================================
base_color     0…1       –      albedo ρ of the ground, linear Rec.709
ior            1.01…3    –      index of refraction of the skin; 1.5 reflects 4 % head-on
roughness      0…1       –      0 mirror, 1 matte; α = roughness², not below 1e-4
gloss          0…1       –      strength of the skin's reflection; 1 is real
depth          0…1       –      1: deep, saturated colour as under real lacquer; 0: as picked
=============  ========  =====  ============================================================
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
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
    dielectric_fresnel,
    ggx_distribution,
    smith_factor,
)
from studio_core.kernels.lobes import draw_cosine, draw_skin, weigh_cosine, weigh_skin
from studio_core.params import Colour, Value, param
from studio_plugins.brdfs.curves import at, curve, place, taken
from studio_plugins.brdfs.facets import (
    hemispherical,
    left_out,
    lost,
    mean_fresnel,
    mean_passage,
    mean_passages,
)
from studio_plugins.brdfs.functions import Functions
from studio_plugins.brdfs.ggx_dielectric import ior, roughness, skin
from studio_plugins.brdfs.roles import Rough


@dataclass(frozen=True)
class Params:
    """Parameters of `Plastic`."""

    base_color: Colour = param((0.8, 0.8, 0.8), "Colour", "Of the ground below", low=0.0, high=1.0)
    roughness: float = roughness(0.3)
    ior: float = ior()
    gloss: float = param(1.0, "Gloss", "Strength of the reflection; 1 is real", low=0.0, high=1.0)
    depth: float = param(
        1.0, "Colour depth", "1 deep and saturated as under lacquer, 0 as picked", low=0.0, high=1.0
    )


@kernel
def _let_through(missed: np.float32, cosine: np.float32, survives: np.float32, mean: Any) -> np.float32:
    """T: what the facets of one bounce let through, and what several bounces do."""
    one = (ONE - missed) * max(curve(place(cosine, mean), mean), ZERO)
    made: np.float32 = one + (ONE - survives) * missed
    return made


@batch_function(SIGNATURE)
def evaluate(shape: Any, wo: Any, count: int, wi: Any, out: Any) -> None:
    """b0, b1 of the module; see `studio_core.contract.Brdf`.

    shape: as of `ggx-dielectric`, then F_ms, 1 / (π T̄), and the curve of what facets let through.
    """
    s = carray(shape, 37)
    o = carray(wo, 3)
    alpha, index2, share, survives, ground = s[0], s[1], s[2], s[19], s[20]
    missed, mean = taken(s, 3), taken(s, 21)
    ox, oy, oz = o[0], o[1], o[2]
    directions = carray(wi, 3 * count)
    x, y, z = directions[:count], directions[count : 2 * count], directions[2 * count :]
    terms = carray(out, 2 * count)
    b0, b1 = terms[:count], terms[count:]
    up = max(oz, ZERO)
    smith = smith_factor(up, alpha)
    gone = lost(up, missed)
    back = share * gone
    through = ground * _let_through(gone, up, survives, mean)
    for k in range(count):
        lit = ONE if (oz > ZERO and z[k] > ZERO) else ZERO
        down = max(z[k], ZERO)
        hx, hy, hz = x[k] + ox, y[k] + oy, max(down + up, LEAST_HEIGHT)
        fresnel = dielectric_fresnel(HALF * np.sqrt(hx * hx + hy * hy + hz * hz), index2)
        lobe = ggx_distribution(hx, hy, hz, alpha) * smith * smith_factor(down, alpha)
        missing = lost(down, missed)
        b0[k] = lit * (lobe * fresnel + back * missing)
        b1[k] = lit * through * _let_through(missing, down, survives, mean)


@batch_function(SAMPLE_SIGNATURE)
def sample(shape: Any, wo: Any, term: int, count: int, u: Any, wi: Any) -> None:
    """The skin as `ggx-dielectric`, the ground by the cosine; see `studio_core.contract.SampledBrdf`."""
    o, numbers, directions = carray(wo, 3), carray(u, 2 * count), carray(wi, 3 * count)
    if term == 0:
        draw_skin(o, carray(shape, 1)[0], numbers, directions)
    else:
        draw_cosine(o, numbers, directions)


@batch_function(DENSITY_SIGNATURE)
def density(shape: Any, wo: Any, count: int, wi: Any, out: Any) -> None:
    """That of `draw_skin`, and cos θ / π; see `studio_core.contract.SampledBrdf`."""
    o, directions, terms = carray(wo, 3), carray(wi, 3 * count), carray(out, 2 * count)
    weigh_skin(o, carray(shape, 1)[0], directions, terms[:count])
    weigh_cosine(o, directions, terms[count:])


class Plastic(Rough, Functions):
    """See the module; satisfies `studio_core.contract.Brdf`."""

    id = "plastic"
    label = "Plastic or lacquer"
    Params = Params
    functions = evaluate, sample, density
    terms = 2
    textures: tuple[str, ...] = ("base_color", "gloss")
    shape_textures: tuple[str, ...] = ("roughness",)
    roles: Mapping[str, str] = frozen_map(
        {"diffuse": "base_color", "specular": "gloss", "gloss": "roughness"}
    )

    def shape(self, values: Mapping[str, Value]) -> npt.NDArray[np.float32]:
        """(37,): what describes the skin, F_ms, 1 / (π T̄), and the curve of what facets let through."""
        alpha, index, _ = skin(values)
        return _shape(values, mean_passage(alpha, index))

    def shapes(self, rows: Sequence[Mapping[str, Value]]) -> npt.NDArray[np.float32]:
        """(K, 37) of many roughnesses, a hundredth of the time each: see `facets.mean_passages`."""
        made = []
        for values in rows:
            alpha, index, _ = skin(values)
            made.append(_shape(values, mean_passages(index).at(math.sqrt(alpha))))
        return np.array(made, np.float32)

    def coefficients(self, values: Mapping[str, npt.NDArray[np.floating[Any]]]) -> npt.NDArray[np.float32]:
        """(..., 2, 3): gloss, and ρ (1 − F) / (1 − ρ F)."""
        base = np.clip(np.asarray(values["base_color"], np.float32), 0, 1)
        gloss = np.clip(np.asarray(values["gloss"], np.float32), 0, 1)[..., None] * np.ones(3, np.float32)
        thrown = inside(values["ior"]) * np.clip(np.asarray(values["depth"], np.float32), 0, 1)
        f = np.asarray(thrown, np.float32)[..., None]
        ground = base * (1 - f) / (1 - base * f)
        return np.stack(np.broadcast_arrays(gloss, ground), axis=-2)


def _shape(values: Mapping[str, Value], mean: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
    """With the curve of what facets let through of one bounce."""
    alpha, _, found = skin(values)
    missed = found[3:]
    average = hemispherical(lambda mu: left_out(missed, mu), alpha)
    survives = float(found[2]) * np.pi * average

    def through(mu: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
        gone = left_out(missed, mu)
        return (1 - gone) * np.maximum(at(mean, mu), 0.0) + (1 - survives) * gone

    ground = 1 / (np.pi * hemispherical(through, alpha))
    return np.array([*found, survives, ground, *mean], np.float32)


def inside(index: npt.ArrayLike) -> npt.NDArray[np.float64]:
    """What a skin throws back of diffuse light from inside: 1 − (1 − F̄) / index²."""
    n = np.asarray(index, np.float64)
    distinct, where = np.unique(n, return_inverse=True)  # a texture's worth of one index is common
    found = 1 - (1 - mean_fresnel(distinct)) / np.maximum(distinct, 1.001) ** 2
    return np.asarray(found[where].reshape(n.shape))


MODEL = Plastic()
