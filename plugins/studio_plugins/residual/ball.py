"""Where a sphere is in its photographs, to a fraction of a pixel.

All pictures together (their brightest) show its outline wherever any light reaches it. Along rays from a
first guess the place is sought where light falls to half of what it would have at the edge; a circle goes
through them, robustly. Where the outline is dim under all lights (above and below a row of lamps) it
counts little.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from studio_core.colour import LUMINANCE
from studio_core.errors import InputError
from studio_plugins.residual.samples import F32, F64, Ball, Flags

_RAYS = 720
_STEP = 0.25  # pixels
_NOT_DARK = 0.03  # of the brightest
_LUMINANCE = np.array(LUMINANCE, np.float32)


@dataclass(frozen=True)
class Found:
    """A ball, the share of directions in which its edge was used, and how far these are off it (median,
    pixels).
    """

    ball: Ball
    seen: float
    spread: float


def find_ball(pictures: F32, distance: float = float("inf"), mask: Flags | None = None) -> Found:
    """The sphere in pictures (n, H, W, 3) of one camera; `distance` as in `Ball`. InputError where none
    is seen.

    Before a background that is not dark, it is what changes from lamp to lamp that is looked at. A mask
    (H, W) of the ball is believed.
    """
    if mask is not None:
        return _found(mask.astype(np.float32), distance)
    ways = [_brightest, _changing] if len(pictures) > 1 else [_brightest]
    if _behind(_brightest(pictures)) > _NOT_DARK:
        ways = ways[::-1]
    for way in ways[:-1]:
        try:
            return _found(way(pictures), distance)
        except InputError:
            continue
    return _found(ways[-1](pictures), distance)


def _found(light: F32, distance: float) -> Found:
    x, y, radius = _guess(light)
    seen, spread = 0.0, np.inf
    for window in (0.12, 0.06, 0.03, 0.03):
        reach = max(window * radius, 6.0)
        angle, edge, weight = _edges(light, x, y, radius, reach)
        if len(angle) < 0.15 * _RAYS:
            continue  # the picture's border may leave room for a narrower window
        change, off = _circle(angle, edge, weight)
        x, y, radius = x + change[0], y + change[1], radius + change[2]
        near = off < max(1.0, 0.01 * radius)
        seen, spread = (
            float(near.mean() * len(angle) / _RAYS),
            float(np.median(off[near])) if near.any() else np.inf,
        )
    if spread > max(1.0, 0.02 * radius) or seen < 0.15:
        raise InputError("no ball was found in the pictures: what is bright has no round outline")
    return Found(Ball(float(x), float(y), float(radius), distance), seen, spread)


def _brightest(pictures: F32) -> F32:
    light = np.einsum("nhwc,c->nhw", pictures, _LUMINANCE)
    scale = np.percentile(light.reshape(len(light), -1), 98, axis=1)
    made = np.max(light / np.maximum(scale, 1e-9)[:, None, None].astype(np.float32), axis=0)
    return np.asarray(np.minimum(made, np.float32(2)), np.float32)


def _changing(pictures: F32) -> F32:
    """What the lamps add to the darkest that each pixel is seen, by their own brightness."""
    light = np.einsum("nhwc,c->nhw", pictures, _LUMINANCE)
    light -= light.min(axis=0)
    scale = np.percentile(light.reshape(len(light), -1), 98, axis=1)
    made = np.max(light / np.maximum(scale, 1e-9)[:, None, None].astype(np.float32), axis=0)
    return np.asarray(np.minimum(made, np.float32(2)), np.float32)


def _behind(light: F32) -> float:
    """How bright the picture's border is."""
    return float(np.median(np.concatenate([light[0], light[-1], light[:, 0], light[:, -1]])))


def _guess(light: F32) -> tuple[float, float, float]:
    """Centre and radius of the largest bright region."""
    from scipy import ndimage

    back, top = _behind(light), float(np.percentile(light, 95))
    if top < back + 1e-4:
        raise InputError(
            "no ball was found in the pictures: they show nothing that is brighter than their border"
        )
    labels, count = ndimage.label(light > back + 0.18 * (top - back))
    if not count:
        raise InputError("no ball was found in the pictures")
    sizes = np.bincount(labels.ravel())
    sizes[0] = 0
    filled = ndimage.binary_fill_holes(labels == int(np.argmax(sizes)))
    rows, columns = np.flatnonzero(filled.any(axis=1)), np.flatnonzero(filled.any(axis=0))
    width, height = columns[-1] + 1 - columns[0], rows[-1] + 1 - rows[0]
    radius = max(width, height) / 2
    if radius < 8:
        raise InputError("no ball was found in the pictures: what is bright is only a few pixels wide")
    return (columns[0] + columns[-1] + 1) / 2, (rows[0] + rows[-1] + 1) / 2, float(radius)


def _edges(light: F32, x: float, y: float, radius: float, reach: float) -> tuple[F64, F64, F64]:
    """Directions (k,), how far outside the circle light ends there (pixels), and how much that counts."""
    from scipy import ndimage

    angle = 2 * np.pi * np.arange(_RAYS) / _RAYS
    out = np.arange(-reach - 6, reach + 6 + _STEP, _STEP)
    distance = radius + out
    at_x = x + np.cos(angle)[:, None] * distance - 0.5
    at_y = y + np.sin(angle)[:, None] * distance - 0.5
    profile = ndimage.map_coordinates(light, [at_y, at_x], order=1, mode="nearest")
    height, width = light.shape
    whole = ((at_x > -0.5) & (at_x < width - 0.5) & (at_y > -0.5) & (at_y < height - 0.5)).all(axis=1)
    slope = np.gradient(ndimage.gaussian_filter1d(profile, 2.0, axis=1), axis=1)
    inner = np.abs(out) <= reach
    peak = np.argmin(np.where(inner, slope, np.inf), axis=1)  # where it falls most
    rows = np.arange(_RAYS)
    # what light would be at the edge, from a line through what is 1.5 … 5 pixels further in
    far, near, beyond = int(5 / _STEP), int(1.5 / _STEP), int(2 / _STEP)
    a = profile[rows, np.maximum(peak - far, 0)]
    b = profile[rows, np.maximum(peak - near, 0)]
    edge_light = np.clip(b + (b - a) * (near / (far - near)), 0.5 * b, b)
    back = profile[rows, np.minimum(peak + beyond, len(out) - 1)]
    level = (edge_light + back) / 2
    place = np.full(_RAYS, np.nan)
    for k in range(-beyond, beyond):
        i = np.clip(peak + k, 0, len(out) - 2)
        p, q = profile[rows, i], profile[rows, i + 1]
        crossed = (p >= level) & (q < level) & np.isnan(place)
        place[crossed] = (out[i] + _STEP * (p - level) / np.maximum(p - q, 1e-9))[crossed]
    inside = profile[:, : int(4 / _STEP)].max(axis=1)
    contrast = np.clip((edge_light - back) / np.maximum(inside, 1e-6), 0, 1)
    good = whole & np.isfinite(place) & (contrast > 0.1)
    return angle[good], place[good], contrast[good] ** 2


def _circle(angle: F64, edge: F64, weight: F64) -> tuple[F64, F64]:
    """(x, y, radius) to add, and how far each edge then is off, in pixels."""
    lines = np.stack([np.cos(angle), np.sin(angle), np.ones_like(angle)], axis=1)
    change = np.array([0.0, 0.0, float(np.median(edge))])
    for scale in (4.0, 2.0, 1.0, 0.5, 0.3, 0.3):
        off = edge - lines @ change
        root = np.sqrt(weight / (1 + (off / scale) ** 2) ** 2)
        change = change + np.linalg.lstsq(lines * root[:, None], off * root, rcond=1e-6)[0]
    return change, np.abs(edge - lines @ change)
