"""How far a surface that other programs know is from the material of ours that it stands for."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from studio_core.brdfs.half_difference import from_angles
from studio_core.brdfs.samples import LOWEST, Difference, Samples, difference
from studio_core.exchange.reflectance import reflectance
from studio_core.exchange.surface import Surface
from studio_core.kernels.pairs import evaluate_pairs
from studio_core.scene.geometry import Texture
from studio_core.shading.materials import Resolved, coefficients, finite_shape

F64 = npt.NDArray[np.float64]
MOST_TEXELS = 1 << 18
_HALVES, _DIFFERENCES, _AZIMUTHS, _TURNS = 24, 8, 5, 4


@dataclass(frozen=True)
class Flat:
    """A material with its pictures averaged: the shape, and coefficients (T, 3)."""

    resolved: Resolved
    shape: npt.NDArray[np.float32]
    colours: F64

    @classmethod
    def of(cls, resolved: Resolved) -> Flat:
        """Coefficients are averaged, not the parameters that they are made of; over every n-th texel each way
        of pictures that have more than 2^18.
        """
        thin = {name: _thinned(texture) for name, texture in resolved.textures.items()}
        made = coefficients(replace(resolved, textures=thin)).astype(np.float64)
        shape = finite_shape(resolved.brdf, resolved.typical())
        return cls(resolved, shape, made.reshape(-1, *made.shape[-2:]).mean(axis=0))

    def samples(self) -> Samples:
        """What it reflects at pairs of directions, weighted as measurements are (`brdfs.samples.of_table`).

        24 half angles, closer together towards the highlight's middle, × 8 difference angles × 5 azimuths × 4
        turns about the normal.
        """
        shape = (_HALVES, _DIFFERENCES, _AZIMUTHS, _TURNS)
        h, d, p, turn = (axis + 0.5 for axis in np.indices(shape).reshape(4, -1).astype(np.float64))
        theta_d = np.pi / 2 * d / _DIFFERENCES
        wi, wo = from_angles(np.pi / 2 * (h / _HALVES) ** 2, theta_d, np.pi * p / _AZIMUTHS)
        angle = 2 * np.pi * (turn - 0.5) / _TURNS + 0.1
        wi, wo = (_turned(w, angle) for w in (wi, wo))
        above = (wi[:, 2] > LOWEST) & (wo[:, 2] > LOWEST)
        weight = np.sin(2 * theta_d)[above]
        light, view = wi[above].astype(np.float32), wo[above].astype(np.float32)
        return Samples(light, view, self.at(light, view), weight / weight.mean())

    def at(self, wi: npt.NDArray[np.float32], wo: npt.NDArray[np.float32]) -> F64:
        """(N, 3) f_r of unit directions (N, 3)."""
        terms = evaluate_pairs(self.resolved.brdf, self.shape, wo, wi)
        return np.asarray(terms.astype(np.float64) @ self.colours)


def between(made: Resolved, meant: Resolved) -> float:
    """The metric by which one material of ours is off another one."""
    samples = Flat.of(meant).samples()
    return difference(Flat.of(made).at(samples.wi, samples.wo), samples).metric


def distance(surface: Surface, samples: Samples) -> Difference:
    """How far the surface, by the letter of its formats, is from what was sampled."""
    return difference(reflectance(surface, samples.wi, samples.wo), samples)


def _thinned(texture: Texture) -> Texture:
    pixels = texture.image.pixels
    step = max(math.ceil(math.sqrt(pixels[..., 0].size / MOST_TEXELS)), 1)
    return (
        texture
        if step == 1
        else replace(texture, image=replace(texture.image, pixels=pixels[::step, ::step]))
    )


def _turned(v: F64, angle: F64) -> F64:
    c, s = np.cos(angle), np.sin(angle)
    return np.stack([c * v[:, 0] - s * v[:, 1], s * v[:, 0] + c * v[:, 1], v[:, 2]], axis=1)
