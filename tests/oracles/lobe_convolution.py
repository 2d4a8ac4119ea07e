"""Light that a lobe sends, by summing over many directions of every cell: no series, no symmetry."""

from __future__ import annotations

import math

import numpy as np

from studio_core.transport.cells import PARTS, RINGS
from studio_plugins.slf.lobes import lobe

_RING, _PART = math.pi / 2 / RINGS, 2 * math.pi / PARTS


def directions(cells, fine):
    """(N, fine², 3) in cells (N,), and their share (N, fine²) of each cell, by solid angle times cosine."""
    at = (np.arange(fine) + 0.5) / fine
    theta = (cells[:, None, None] // PARTS + at[:, None]) * _RING
    phi = (cells[:, None, None] % PARTS + at) * _PART
    theta, phi = (one.reshape(len(cells), -1) for one in np.broadcast_arrays(theta, phi))
    share = np.sin(theta) * np.cos(theta)
    made = np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], axis=-1)
    return made, share / share.sum(axis=1, keepdims=True)


def convolved(exponent, light, cells, fine=12):
    """(N,) mean light towards cells (N,), of a lobe under light (RINGS, PARTS) that is even over each cell.

    From two finenesses, whose errors are as 4 to 1 (Richardson 1911).
    """
    coarse, finer = (summed(exponent, light, cells, count) for count in (fine // 2, fine))
    return (4 * finer - coarse) / 3


def summed(exponent, light, cells, fine):
    """The same from fine² directions of every cell."""
    wi, share = directions(np.arange(RINGS * PARTS), fine)
    theta = np.arange(RINGS + 1) * _RING
    measure = np.repeat((np.cos(theta[:-1]) ** 2 - np.cos(theta[1:]) ** 2) / 2 * _PART, PARTS)
    weights = (share * (measure * light.ravel())[:, None]).ravel()
    wo, looks = directions(cells, fine)
    made = np.zeros(len(cells))
    for cell in range(len(cells)):
        for direction, look in zip(wo[cell], looks[cell], strict=True):
            made[cell] += look * (lobe(exponent, wi.reshape(-1, 3), direction) @ weights)
    return made
