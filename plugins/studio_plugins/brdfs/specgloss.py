"""Colour and shine: GGX by the colours of its matte part and of its reflection, from matte paint to metal.

The facets are those of `ggx`, with their bounces. Instead of a metalness there is the colour F0 that is
reflected head-on, so a wall can become glossy in one spot, or a metal matte, without a jump. What grazes is
reflected by F90 = min(50 · F0, 1), F0 in its brightest channel: what reflects less than 2 % head-on is no
smooth surface but one in whose pores the shine is lost (Lagarde & de Rousiers, "Moving Frostbite to
Physically Based Rendering", 2014, section 3.1.3), and nothing at all is reflected where F0 is black.

f_r = D G F / (4 (n·ω_i)(n·ω_o)) + F_ms f_ms + matte with F = F0 + (F90 − F0)(1 − ω_o·h)^5,
matte = diffuse (1 − F0) ((1 − F90) / π + F90 (1 − Y(θ_i))(1 − Y(θ_o)) / (π (1 − Ȳ)) ) and Y of `ggx`, and of
the bounces F_ms = B F0 + (1 − B) ((1 − diffuse) g(F0) + diffuse F0).

So it is `ggx` where that has no metalness (F0 = 0.08 · its reflectance, from 2 % on) or is all metal
(diffuse black, F0 its colour), and `lambert` where F0 is black. White returns 1 − F0 (1 − F90) Y of the
light: all of it but where F0 is below 2 %, and there at least 0.995.

Terms: b0 … b3 of `ggx`, b4 = 1; c0 = diffuse (1 − F0) F90 / π, c1 = F0, c2 = F90,
c3 = (1 − diffuse) g(F0) + diffuse F0, c4 = diffuse (1 − F0) (1 − F90) / π.

=============  ========  =====  ============================================================
parameter      range     unit   meaning
=============  ========  =====  ============================================================
diffuse        0…1       –      colour of the matte part, linear Rec.709
specular       0…1       –      F0: 0.04 is plastic, wood, glass; a metal's is its colour
roughness      0…1       –      0 mirror, 1 matte; α = roughness², not below 1e-4
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
from studio_core.jit import batch_function
from studio_core.kernels.brdf import DENSITY_SIGNATURE, ONE, SAMPLE_SIGNATURE, SIGNATURE, ZERO, carray
from studio_core.kernels.lobes import draw_cosine, weigh_cosine
from studio_core.params import Colour, Value, param
from studio_plugins.brdfs import ggx
from studio_plugins.brdfs.functions import Functions
from studio_plugins.brdfs.ggx_dielectric import roughness
from studio_plugins.brdfs.roles import Rough

GRAZING = np.float32(50)
"""F90 over F0, until it is 1."""


@dataclass(frozen=True)
class Params:
    """Parameters of `SpecularGloss`."""

    diffuse: Colour = param((0.8, 0.8, 0.8), "Colour", "Of the matte part", low=0.0, high=1.0)
    specular: Colour = param(
        (0.04, 0.04, 0.04), "Shine", "Reflected head-on: plastic 4 %, a metal its colour", low=0.0, high=1.0
    )
    roughness: float = roughness(0.5)
    keep_energy: bool = ggx.keep_energy()


@batch_function(SIGNATURE)
def evaluate(shape: Any, wo: Any, count: int, wi: Any, out: Any) -> None:
    """Those of `ggx`, and 1; see `studio_core.contract.Brdf`."""
    o, directions, terms = carray(wo, 3), carray(wi, 3 * count), carray(out, 5 * count)
    ggx.four_terms(carray(shape, 36), o, directions, terms[: 4 * count])
    z, b4 = directions[2 * count :], terms[4 * count :]
    seen = ONE if o[2] > ZERO else ZERO
    for k in range(count):
        b4[k] = seen if z[k] > ZERO else ZERO


@batch_function(SAMPLE_SIGNATURE)
def sample(shape: Any, wo: Any, term: int, count: int, u: Any, wi: Any) -> None:
    """As `ggx`, and by the cosine; see `studio_core.contract.SampledBrdf`."""
    o, numbers, directions = carray(wo, 3), carray(u, 2 * count), carray(wi, 3 * count)
    if term == 4:
        draw_cosine(o, numbers, directions)
    else:
        ggx.draw(term, o, carray(shape, 1)[0], numbers, directions)


@batch_function(DENSITY_SIGNATURE)
def density(shape: Any, wo: Any, count: int, wi: Any, out: Any) -> None:
    """Those of `ggx`, and cos θ / π; see `studio_core.contract.SampledBrdf`."""
    o, directions, terms = carray(wo, 3), carray(wi, 3 * count), carray(out, 5 * count)
    ggx.weigh(o, carray(shape, 1)[0], directions, terms[: 4 * count])
    weigh_cosine(o, directions, terms[4 * count :])


class SpecularGloss(Rough, Functions):
    """See the module; satisfies `studio_core.contract.PaintableBrdf`."""

    id = "specgloss"
    label = "Colour and shine"
    Params = Params
    functions = evaluate, sample, density
    terms = 5
    textures: tuple[str, ...] = ("diffuse", "specular")
    shape_textures: tuple[str, ...] = ("roughness",)
    straightened: tuple[int, ...] = (3,)
    roles: Mapping[str, str] = frozen_map(
        {"diffuse": "diffuse", "specular": "specular", "gloss": "roughness"}
    )

    def shape(self, values: Mapping[str, Value]) -> npt.NDArray[np.float32]:
        """(36,) of `ggx`."""
        return ggx.MODEL.shape(values)

    def coefficients(self, values: Mapping[str, npt.NDArray[np.floating[Any]]]) -> npt.NDArray[np.float32]:
        """(..., 5, 3): what is matte under the shine, F0, F90, what bounces, and what is matte without it."""
        diffuse = np.clip(np.asarray(values["diffuse"], np.float32), 0, 1)
        f0 = np.clip(np.asarray(values["specular"], np.float32), 0, 1)
        f90 = grazing(f0)
        matte = diffuse / np.float32(np.pi) * (1 - f0)
        bounced = (1 - diffuse) * ggx.bounced_share(f0) + diffuse * f0
        parts = (matte * f90, f0, f90, bounced, matte * (1 - f90))
        return np.stack(np.broadcast_arrays(*parts), axis=-2)


def grazing(f0: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
    """(..., 1) F90 of F0 (..., 3)."""
    made: npt.NDArray[np.float32] = np.minimum(GRAZING * f0.max(axis=-1, keepdims=True), np.float32(1))
    return made


MODEL = SpecularGloss()
