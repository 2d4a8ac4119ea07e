"""Cloth: a matte ground under a sheen of standing fibres, for velvet, felt, wool, linen and peach skin.

f_r = sheen · f_s + base_color · ((1 − sheen) / π + sheen · T(θ_i) T(θ_o) / (π T̄))

f_s are fibres by Estevez & Kulla (2017) behind one another by Smith (see `fibres`), E their albedo, T = 1 − E
what they let through and T̄ = 2 ∫ T μ dμ. The ground's albedo is base_color · (1 − sheen · E(θ_o)) exactly: it
is reciprocal, a white ground returns all light whatever the sheen, and colours stay in front of terms
that do not depend on them. (glTF's KHR_materials_sheen takes the sheen's largest channel from all three
channels of the ground; here each gives way for itself.)
Terms: b0 = 1, b1 = T T / T̄, b2 = f_s;
c0 = base_color (1 − sheen) / π, c1 = base_color · sheen / π, c2 = sheen.

=============  ========  =====  ============================================================
parameter      range     unit   meaning
=============  ========  =====  ============================================================
base_color     0…1       –      albedo of the ground, linear Rec.709
sheen          0…1       –      colour and strength of the fibres, linear Rec.709
roughness      0…1       –      of the fibres: 0.2 a thin bright rim, 1 a soft glow; taken as 0.07 at least
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
    INV_PI,
    LEAST_HEIGHT,
    ONE,
    SAMPLE_SIGNATURE,
    SIGNATURE,
    ZERO,
    carray,
    power_of_complement,
)
from studio_core.kernels.lobes import draw_cosine, weigh_cosine
from studio_core.kernels.sampling import even_direction
from studio_core.params import Colour, Value, param
from studio_plugins.brdfs.curves import curve, place, taken
from studio_plugins.brdfs.fibres import pile
from studio_plugins.brdfs.functions import Functions
from studio_plugins.brdfs.roles import Rough

_QUARTER = np.float32(0.25)


@dataclass(frozen=True)
class Params:
    """Parameters of `Cloth`."""

    base_color: Colour = param((0.35, 0.35, 0.35), "Colour", "Of the ground below", low=0.0, high=1.0)
    sheen: Colour = param(
        (0.4, 0.4, 0.4), "Sheen", "Colour and strength of the light that fibres catch", low=0.0, high=1.0
    )
    roughness: float = param(
        0.5, "Sheen width", "Low is a thin bright rim as on velvet, high a soft glow as on felt",
        low=0.0, high=1.0,
    )  # fmt: skip


@kernel
def _area(cosine: np.float32, c: Any) -> np.float32:
    """A of `fibres`."""
    made: np.float32 = curve(np.sqrt(place(max(ONE - cosine, ZERO), c)), c)
    return made


@kernel
def _passing(cosine: np.float32, c: Any) -> np.float32:
    """T of the module."""
    made: np.float32 = min(max(curve(place(cosine, c), c), ZERO), ONE)
    return made


@batch_function(SIGNATURE)
def evaluate(shape: Any, wo: Any, count: int, wi: Any, out: Any) -> None:
    """The three kernels of the module; see `studio_core.contract.Brdf`.

    shape: n / 2, (2 + n) / 2π, 1 / T̄, and the curves of A and of T.
    """
    s = carray(shape, 35)
    o = carray(wo, 3)
    half_n, peak, share = s[0], s[1], s[2]
    area, through = taken(s, 3), taken(s, 19)
    ox, oy, oz = o[0], o[1], o[2]
    directions = carray(wi, 3 * count)
    x, y, z = directions[:count], directions[count : 2 * count], directions[2 * count :]
    terms = carray(out, 3 * count)
    b0, b1, b2 = terms[:count], terms[count : 2 * count], terms[2 * count :]
    up = min(max(oz, ZERO), ONE)
    facing = _area(up, area)
    ground = share * _passing(up, through)
    for k in range(count):
        lit = ONE if (oz > ZERO and z[k] > ZERO) else ZERO
        down = min(max(z[k], ZERO), ONE)
        hx, hy, hz = x[k] + ox, y[k] + oy, max(down + up, LEAST_HEIGHT)
        flat, height = hx * hx + hy * hy, hz * hz
        whole = flat + height
        fibres = power_of_complement(height / whole, flat / whole, half_n)
        hidden = max(_area(down, area) * up + (facing - up) * down, LEAST_HEIGHT)
        b0[k] = lit
        b1[k] = lit * ground * _passing(down, through)
        b2[k] = lit * _QUARTER * peak * fibres / hidden


@batch_function(SAMPLE_SIGNATURE)
def sample(shape: Any, wo: Any, term: int, count: int, u: Any, wi: Any) -> None:
    """The ground by the cosine, the sheen evenly; see `studio_core.contract.SampledBrdf`."""
    o, numbers, w = carray(wo, 3), carray(u, 2 * count), carray(wi, 3 * count)
    if term < 2:
        draw_cosine(o, numbers, w)
        return
    for k in range(count):
        x, y, z = even_direction(numbers[k], numbers[count + k])
        w[k], w[count + k] = x, y
        w[2 * count + k] = z if o[2] > ZERO else -ONE


@batch_function(DENSITY_SIGNATURE)
def density(shape: Any, wo: Any, count: int, wi: Any, out: Any) -> None:
    """cos θ / π twice, and 1 / 2π; see `studio_core.contract.SampledBrdf`."""
    o, w, terms = carray(wo, 3), carray(wi, 3 * count), carray(out, 3 * count)
    weigh_cosine(o, w, terms[:count])
    weigh_cosine(o, w, terms[count : 2 * count])
    z, even = w[2 * count :], terms[2 * count :]
    for k in range(count):
        even[k] = HALF * INV_PI if (o[2] > ZERO and z[k] > ZERO) else ZERO


class Cloth(Rough, Functions):
    """See the module; satisfies `studio_core.contract.Brdf`."""

    id = "cloth"
    label = "Cloth with sheen"
    Params = Params
    functions = evaluate, sample, density
    terms = 3
    textures: tuple[str, ...] = ("base_color", "sheen")
    shape_textures: tuple[str, ...] = ("roughness",)
    roles: Mapping[str, str] = frozen_map(
        {"diffuse": "base_color", "specular": "sheen", "gloss": "roughness"}
    )

    def shape(self, values: Mapping[str, Value]) -> npt.NDArray[np.float32]:
        """(35,): n / 2, (2 + n) / 2π, 1 / T̄, and the curves of A and of T."""
        made = pile(float(np.clip(values["roughness"], 0.0, 1.0)))
        n = made.power
        return np.array(
            [n / 2, (2 + n) / (2 * np.pi), 1 / made.average, *made.area, *made.through], np.float32
        )

    def coefficients(self, values: Mapping[str, npt.NDArray[np.floating[Any]]]) -> npt.NDArray[np.float32]:
        """(..., 3, 3): the ground beside the fibres, the ground below them, and the fibres."""
        base = np.clip(np.asarray(values["base_color"], np.float32), 0, 1) / np.float32(np.pi)
        sheen = np.clip(np.asarray(values["sheen"], np.float32), 0, 1)
        return np.stack(np.broadcast_arrays(base * (1 - sheen), base * sheen, sheen), axis=-2)


MODEL = Cloth()
