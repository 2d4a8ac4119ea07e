"""Minnaert's model of dark, velvet-like surfaces.

f_r = base_color · (k + 1) / 2π · (cos θ_i cos θ_o)^(k-1) (Minnaert 1941); k = 1 is Lambert's. Here k ≥ 1,
so that it stays bounded; at normal incidence all of `base_color` comes back.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from studio_core.jit import batch_function
from studio_core.kernels.brdf import SIGNATURE, ZERO, carray
from studio_core.params import Colour, Value, param


@dataclass(frozen=True)
class Params:
    """Parameters of `Minnaert`."""

    base_color: Colour = param((0.5, 0.1, 0.15), "Colour", low=0.0, high=1.0)
    darkening: float = param(1.5, "Darkening", "1 is matte; more darkens the rim", low=1.0, high=4.0)


@batch_function(SIGNATURE)
def evaluate(shape: Any, wo: Any, count: int, wi: Any, out: Any) -> None:
    """b = (z_i z_o)^(k-1); see `studio_core.contract.Brdf`."""
    k = carray(shape, 1)[0]
    up = carray(wo, 3)[2]
    z = carray(wi, 3 * count)[2 * count :]
    b = carray(out, count)
    for i in range(count):
        b[i] = (up * z[i]) ** (k - np.float32(1)) if (up > ZERO and z[i] > ZERO) else ZERO


class Minnaert:
    """See the module; satisfies `studio_core.contract.Brdf`."""

    id = "minnaert"
    label = "Velvet (Minnaert)"
    Params = Params
    terms = 1
    textures: tuple[str, ...] = ("base_color",)

    @property
    def address(self) -> int:
        """Address of `evaluate`."""
        return evaluate.address

    def shape(self, values: Mapping[str, Value]) -> npt.NDArray[np.float32]:
        """(1,): the exponent."""
        return np.array([values["darkening"]], np.float32)

    def coefficients(self, values: Mapping[str, npt.NDArray[np.floating[Any]]]) -> npt.NDArray[np.float32]:
        """(..., 1, 3): base_color · (k + 1) / 2π."""
        base = np.asarray(values["base_color"], np.float32)
        k = np.asarray(values["darkening"], np.float32)[..., None]
        made: npt.NDArray[np.float32] = (base * (k + 1) / np.float32(2 * np.pi))[..., None, :]
        return made


MODEL = Minnaert()
