"""Lambert: the ideal matte surface.

f_r = base_color / π (Lambert 1760). One term: b = 1, c = base_color / π.

=============  ======  =====  =============================================================
parameter      range   unit   meaning
=============  ======  =====  =============================================================
base_color     0…1     –      diffuse albedo, linear Rec.709; white returns all light
=============  ======  =====  =============================================================
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
from studio_plugins.brdfs.functions import Functions


@dataclass(frozen=True)
class Params:
    """Parameters of `Lambert`."""

    base_color: Colour = param(
        (0.8, 0.8, 0.8), "Colour", "Share of the light that comes back", low=0.0, high=1.0
    )


@batch_function(SIGNATURE)
def evaluate(shape: Any, wo: Any, count: int, wi: Any, out: Any) -> None:
    """b = 1 above the surface; see `studio_core.contract.Brdf`."""
    up = carray(wo, 3)[2] > ZERO
    z = carray(wi, 3 * count)[2 * count :]
    b = carray(out, count)
    for k in range(count):
        b[k] = ONE if (up and z[k] > ZERO) else ZERO


@batch_function(SAMPLE_SIGNATURE)
def sample(shape: Any, wo: Any, term: int, count: int, u: Any, wi: Any) -> None:
    """By the cosine; see `studio_core.contract.SampledBrdf`."""
    o, numbers, directions = carray(wo, 3), carray(u, 2 * count), carray(wi, 3 * count)
    draw_cosine(o, numbers, directions)


@batch_function(DENSITY_SIGNATURE)
def density(shape: Any, wo: Any, count: int, wi: Any, out: Any) -> None:
    """cos θ / π; see `studio_core.contract.SampledBrdf`."""
    o, directions, terms = carray(wo, 3), carray(wi, 3 * count), carray(out, 1 * count)
    weigh_cosine(o, directions, terms)


class Lambert(Functions):
    """See the module; satisfies `studio_core.contract.Brdf`."""

    id = "lambert"
    label = "Matte"
    Params = Params
    functions = evaluate, sample, density
    terms = 1
    textures: tuple[str, ...] = ("base_color",)
    roles: Mapping[str, str] = frozen_map({"diffuse": "base_color"})

    def shape(self, values: Mapping[str, Value]) -> npt.NDArray[np.float32]:
        """Matte surfaces have no shape: (0,)."""
        return np.zeros(0, np.float32)

    def coefficients(self, values: Mapping[str, npt.NDArray[np.floating[Any]]]) -> npt.NDArray[np.float32]:
        """(..., 1, 3): base_color / π, taken as 0…1."""
        base: npt.NDArray[np.float32] = np.clip(np.asarray(values["base_color"], np.float32), 0, 1)
        return base[..., None, :] / np.float32(np.pi)


MODEL = Lambert()
