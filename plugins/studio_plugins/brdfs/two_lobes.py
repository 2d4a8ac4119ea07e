"""What Phong's and Blinn's models share: a matte part and one highlight, and who gets which light.

Terms: b0 = 1, b1 = the model's own lobe; c0 = diffuse / π, c1 = specular. Where diffuse + specular exceeds 1
in a channel, both are divided by their sum there: no more light comes back than arrives, and the ratio of
matte to shine is kept.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from studio_core.params import Colour, Value, param


@dataclass(frozen=True)
class TwoLobeParams:
    """Parameters but for the exponent, whose default is each model's own."""

    diffuse: Colour = param((0.6, 0.6, 0.6), "Matte colour", "Albedo of the matte part", low=0.0, high=1.0)
    specular: Colour = param(
        (0.1, 0.1, 0.1), "Highlight colour", "Albedo of the highlight seen head-on", low=0.0, high=1.0
    )


def sharpness(default: float) -> Any:
    """The field of the exponent."""
    doc = "Exponent of the highlight; higher is smaller and brighter"
    return param(default, "Sharpness", doc, low=1.0, high=1e5, scale="log")


def exponent(values: Mapping[str, Value]) -> float:
    """The exponent n, in its range."""
    return float(np.clip(values["exponent"], 1.0, 1e5))


class TwoLobes:
    """All of a `studio_core.contract.Brdf` but its kernel and the kernel's shape."""

    terms = 2
    textures: tuple[str, ...] = ("diffuse", "specular")

    def coefficients(self, values: Mapping[str, npt.NDArray[np.floating[Any]]]) -> npt.NDArray[np.float32]:
        """(..., 2, 3): diffuse / π and specular after the energy rule of the module."""
        diffuse = np.clip(np.asarray(values["diffuse"], np.float32), 0, 1)
        specular = np.clip(np.asarray(values["specular"], np.float32), 0, 1)
        excess = np.maximum(diffuse + specular, np.float32(1))
        return np.stack(np.broadcast_arrays(diffuse / excess / np.float32(np.pi), specular / excess), axis=-2)
