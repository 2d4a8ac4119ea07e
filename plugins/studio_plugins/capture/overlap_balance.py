"""How one lens' light follows from the other's where both look, but for what a frame throws back.

own ≈ gain · other + veil. What is left of gain after registration is nearly 1 and changes little around the
ring; the veil is what the lenses' glass spreads over all of a picture: a small share of the widely blurred
picture, each lens' of its own. It is nothing in bright places and much in dark ones, so a comparison of
logarithms alone would take it for reflections.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from studio_core.capturing.artifacts import F32, F64, Mask, View
from studio_core.capturing.looking import look
from studio_core.colour import LUMINANCE
from studio_plugins.capture.ring import coarser

_WIDE = 0.25  # of the circle's radius: how far glare reaches
_COARSE = 32.0
_SPREADS = np.array([0.1, 0.04, 0.04, 0.04, 0.006, 0.006])  # prior: gain, tilt, cos, sin, veil of own, other
_PATCHES = 150  # independent places of the overlap
_OFF = 0.12  # stops: what parallax leaves between two calm pictures
_MIDDLE = 5.0  # degrees from either frame: from here on, places count fully
_NEAR = 9.0  # degrees from a frame: its reflections reach so far
_SUSPECT = 1.5
_ROUNDS = 20


@dataclass(frozen=True, eq=False)
class Overlap:
    """Calm light of both lenses on a ring (R, C), linear, and where both are known.

    `from_own`, `from_other` (R, C): degrees to each lens' frame; `tilt` (R, C): the difference of both
    angles from the axis, radians; `azimuth` (C,). `veils` (2, R, C): widely blurred light, own and other's.
    """

    own: F32
    other: F32
    known: Mask
    from_own: F64
    from_other: F64
    tilt: F64
    azimuth: F64
    veils: F64


@dataclass(frozen=True, eq=False)
class Balance:
    """own ≈ `gain` (R, C) · other + `veil` (R, C); `doubt` (R, C): light that the veil may be wrong by."""

    gain: F64
    veil: F64
    doubt: F64


def veil_of(view: View, directions: F64) -> F64:
    """(R, C) luminance that the view would have if its glass spread all of its light."""
    import cv2

    small = coarser(view, _COARSE)
    luminance = (small.light @ np.array(LUMINANCE, np.float32)) * small.usable
    wide = cv2.GaussianBlur(luminance, (0, 0), small.circle.radius * _WIDE)
    spread = np.repeat(np.asarray(wide, np.float32)[:, :, None], 3, axis=2)
    seen, _ = look(replace(small, light=spread, usable=np.ones_like(small.usable)), directions)
    return seen[..., 0].astype(np.float64)


def balance(overlap: Overlap) -> Balance:
    """Least squares of relative differences, outliers falling away, with priors of what is plausible.

    What is brighter near its own frame, or darker near the other's, counts less: it may be a reflection.
    """
    own, other = overlap.own.astype(np.float64), overlap.other.astype(np.float64)
    columns = np.broadcast_to(overlap.azimuth, own.shape)
    shapes = np.stack([np.ones_like(own), 4 * overlap.tilt, np.cos(columns), np.sin(columns)], axis=-1)
    terms = np.concatenate([shapes * other[..., None], np.moveaxis(overlap.veils, 0, -1)], axis=-1)
    trust = np.clip(np.minimum(overlap.from_own, overlap.from_other) / _MIDDLE, 0.15, 1)
    places = np.flatnonzero(overlap.known & (own > 0) & (other > 0))[::5]
    expected = np.array([1.0, 0, 0, 0, 0, 0])
    found = expected
    if len(places):
        x, y = terms.reshape(-1, 6)[places], own.ravel()[places]
        near = overlap.from_own.ravel()[places] < _NEAR, overlap.from_other.ravel()[places] < _NEAR
        found = _fitted(x, y, trust.ravel()[places], near, expected)
    gain = np.maximum(shapes @ found[:4], 0.2)
    parts = overlap.veils * found[4:, None, None]
    return Balance(gain, parts.sum(axis=0), np.abs(parts).sum(axis=0))


def _fitted(x: F64, y: F64, trust: F64, near: tuple[Mask, Mask], expected: F64) -> F64:
    found, scale = expected, 0.6
    stiffness = np.diag(1 / _SPREADS**2)
    for _ in range(_ROUNDS):
        plain = np.maximum(x[:, :4] @ found[:4], 0.2 * x[:, 0])
        made = np.maximum(x @ found, 0.25 * plain)
        off = np.log2(y / made)
        scale = max(_OFF, 0.8 * scale)
        suspect = ((off > 0) & near[0]) | ((off < 0) & near[1])
        size = (np.where(suspect, _SUSPECT, 1.0) * off / scale) ** 2
        sure = 1 / (1 + size) ** 2
        weight = trust * sure * _PATCHES / (trust.sum() * _OFF**2 * np.log(2) ** 2 * made * y)
        normal = (x * weight[:, None]).T @ x + stiffness
        found = np.linalg.solve(normal, (x * weight[:, None]).T @ y + stiffness @ expected)
        found[4], found[5] = max(found[4], 0.0), min(found[5], 0.0)
    return np.asarray(found, np.float64)
