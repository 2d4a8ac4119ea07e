"""Samples of a stroke on a made-up surface: lobes of a ladder of exponents under a few lights."""

from __future__ import annotations

import numpy as np

from studio_plugins.slf.samples import Reflectance, Samples

LEVELS = 20


def lights(rng, count=40, views=60):
    """Columns (views, 3) and (LEVELS, views, 3) of a few bright lights and a sky over one normal."""
    lamps = rng.normal(size=(count, 3))
    lamps[:, 2] = np.abs(lamps[:, 2]) + 0.1
    lamps /= np.linalg.norm(lamps, axis=1, keepdims=True)
    power = rng.lognormal(0, 1.5, (count, 1)) * rng.uniform(0.7, 1.0, (count, 3)) / count
    eyes = np.array([0.4, 0.3, 0.85]) + rng.normal(0, 0.25, (views, 3))
    eyes[:, 2] = np.abs(eyes[:, 2])
    eyes /= np.linalg.norm(eyes, axis=1, keepdims=True)
    diffuse = np.broadcast_to((power * lamps[:, 2:]).sum(axis=0) / np.pi, (views, 3))
    mirrored = lamps * [-1, -1, 1]
    alike = np.clip(eyes @ mirrored.T, 0, 1)
    specular = []
    for exponent in np.geomspace(2, 800, LEVELS):
        lobe = (exponent + 2) / (2 * np.pi) * alike**exponent * lamps[:, 2]
        specular.append(lobe @ power)
    return diffuse.copy(), np.stack(specular)


class TwoColumns:
    """c = (d, s), d + s ≤ 1: equation 3."""

    def coefficients(self, diffuse, specular):
        return np.stack(np.broadcast_arrays(diffuse, specular), axis=-2)

    def room(self, specular):
        return np.clip(1 - specular, 0, 1)


MODEL = TwoColumns()


def painted(rng, now, then, noise=0.0, **given):
    """Samples that want `then` where `now` is, seen with noise of that relative size."""
    diffuse, specular = lights(rng, **given)
    terms = np.stack([np.broadcast_to(diffuse, specular.shape), specular], axis=2)
    nothing = np.zeros_like(diffuse)
    plain = Samples(nothing, nothing, terms, terms[round(now.level)], np.ones(len(diffuse)))
    wanted = plain.made(MODEL, then) * (1 + noise * rng.normal(size=diffuse.shape))
    return Samples(wanted, plain.made(MODEL, now), terms, plain.own, np.ones(len(diffuse)))


def reflectance(diffuse, specular, level):
    return Reflectance(np.asarray(diffuse, float), np.asarray(specular, float), float(level))
