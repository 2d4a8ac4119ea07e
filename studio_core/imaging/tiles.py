"""Small flat places of a scene, looked up in every exposure: what responses and noise are measured on.

A tile's mean has little noise and, where the scene is flat, does not care about a hand's motion. Tiles are
spread over brightness and over the picture; what is clipped, moved out of the frame or outside the lens'
circle does not count.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from studio_core.capturing.artifacts import Mask, Motion
from studio_core.imaging.levels import Levels
from studio_core.imaging.projection import Circle, Lens
from studio_core.imaging.warping import moved_points

F64 = npt.NDArray[np.float64]
_CANDIDATES = 9000
_STRATA = 20
_A_STRATUM = 4
_LARGEST = 28  # pixels a side
_ENOUGH = 1000  # places beside each other
_NOISY = 0.012  # of a tile's mean, relative: from here on noise would flatten the curve
_EXPOSURES = 6  # of more, fewer places each
_CELLS = 6  # a side


@dataclass(frozen=True, eq=False)
class Tiles:
    """T places in F exposures. Numbers are 0 … 1 of `top`.

    number (F, T, 3): mean; variance (F, T, 3): of a pixel, without the plane through the tile; slant
    (F, T, 3): how much that plane changes over a pixel; fair (F, T, 3): not clipped, not black, inside.
    `size`: pixels a side.
    """

    number: F64
    variance: F64
    slant: F64
    fair: Mask
    size: int

    def chosen(self, which: npt.NDArray[Any]) -> Tiles:
        """Some of the places."""
        return Tiles(
            self.number[:, which],
            self.variance[:, which],
            self.slant[:, which],
            self.fair[:, which],
            self.size,
        )


def tile_size(width: int, height: int) -> int:
    """Pixels a side, for a picture of this size."""
    return int(np.clip(round(min(width, height) / 150), 4, 14))


def look_up(
    frames: Sequence[npt.NDArray[Any]],
    motions: Sequence[Motion],
    levels: Levels,
    circle: Circle | None = None,
    lens: Lens | None = None,
) -> Tiles:
    """Candidates on a grid over frames (H, W, 3) of one size and type; larger ones where noise is."""
    height, width = frames[0].shape[:2]
    side = min(tile_size(width, height), height, width)
    while True:
        tiles = _of_size(frames, motions, levels, circle, lens, side)
        chosen = tiles.chosen(choose(tiles))
        noise = np.sqrt(chosen.variance) / (side * np.maximum(chosen.number, 1e-3))
        if 2 * side > _LARGEST or width * height < _ENOUGH * (2 * side) ** 2:
            return tiles
        if not chosen.fair.any() or np.median(noise[chosen.fair]) < _NOISY:
            return tiles
        side = 2 * side


def _of_size(
    frames: Sequence[npt.NDArray[Any]],
    motions: Sequence[Motion],
    levels: Levels,
    circle: Circle | None,
    lens: Lens | None,
    side: int,
) -> Tiles:
    height, width = frames[0].shape[:2]
    spacing = max(side, int(np.sqrt(width * height / _CANDIDATES)))
    x, y = np.meshgrid(
        np.arange(side / 2, width - side / 2 + 0.5, spacing),
        np.arange(side / 2, height - side / 2 + 0.5, spacing),
    )
    # rows and columns out of step with whatever repeats in the picture
    jitter = np.random.default_rng(7).uniform(-0.5, 0.5, (2, x.size)) * max(spacing - side, 0)
    points = np.stack([x.ravel() + jitter[0], y.ravel() + jitter[1]], axis=1)
    if circle is not None:
        points = points[_inside(points, circle, side)]
    looks = [
        _look(frame, moved_points(points, motion, (width, height), circle, lens), side, levels, circle)
        for frame, motion in zip(frames, motions, strict=True)
    ]
    number, variance, slant, fair = (np.stack(part) for part in zip(*looks, strict=True))
    return Tiles(number, variance, slant, fair, side)


def _inside(points: F64, circle: Circle, side: int) -> Mask:
    reach = np.hypot(points[:, 0] - circle.x, points[:, 1] - circle.y)
    return np.asarray(reach < 0.96 * circle.radius - side, np.bool_)


def _look(
    frame: npt.NDArray[Any], points: F64, side: int, levels: Levels, circle: Circle | None
) -> tuple[F64, F64, F64, Mask]:
    height, width = frame.shape[:2]
    corner = np.rint(points - side / 2).astype(np.int64)
    known = (corner >= 0).all(1) & (corner[:, 0] <= width - side) & (corner[:, 1] <= height - side)
    if circle is not None:
        known &= _inside(points, circle, side)
    corner = np.clip(corner, 0, [width - side, height - side])
    step = np.arange(side)
    taken = frame[corner[:, 1, None, None] + step[:, None], corner[:, 0, None, None] + step]
    pixels = taken.reshape(len(points), side * side, 3).astype(np.float32)
    if frame.dtype == np.float32:
        pixels = np.nan_to_num(pixels, posinf=levels.top)
    clipped = (pixels >= np.asarray(levels.white)).any(axis=(1, 2))
    black = (pixels <= np.asarray(levels.black)).mean(axis=1) > 0.02
    pixels *= np.float32(1 / levels.top)
    mean = pixels.mean(axis=1)
    pixels -= mean[:, None]
    ramp = np.arange(side) - (side - 1) / 2
    across = np.tile(ramp, side) / (side * (ramp**2).sum())
    down = np.repeat(ramp, side) / (side * (ramp**2).sum())
    right, below = (np.tensordot(pixels, ramps, axes=(1, 0)) for ramps in (across, down))
    plane = (right**2 + below**2) * side * (ramp**2).sum()
    rest = np.einsum("tpc,tpc->tc", pixels, pixels) - plane
    variance = np.maximum(rest, 0.0) / max(side * side - 3, 1)
    fair = known[:, None] & ~clipped[:, None] & ~black
    return mean.astype(np.float64), variance.astype(np.float64), np.hypot(right, below), fair


def choose(tiles: Tiles) -> npt.NDArray[np.int64]:
    """The flattest places of every brightness in every exposure, no more than a few from one corner.

    Places that fewer than two exposures show fairly are of no use. Their order is that of the picture.
    """
    useful = tiles.fair.any(axis=2).sum(axis=0) >= 2
    mean = tiles.number.mean(axis=2)
    # flat where it is exposed best; in the dark everything looks flat
    rough = np.sqrt(tiles.variance.sum(2) + (tiles.slant * tiles.size).sum(2) ** 2) / (mean + 0.02)
    best = np.argmax(np.where(tiles.fair.any(axis=2), mean, -1.0), axis=0)
    places = np.arange(mean.shape[1])
    roughness = np.where(useful, rough[best, places], np.inf)
    cell = _cells(len(places))
    taken = np.zeros(len(places), np.bool_)
    each = int(np.clip(round(_EXPOSURES * _A_STRATUM / len(mean)), 1, _A_STRATUM))
    crowd = np.zeros(cell.max(initial=0) + 1)
    for frame in range(len(mean)):
        stratum = np.minimum((np.sqrt(np.clip(mean[frame], 0, 1)) * _STRATA).astype(np.int64), _STRATA - 1)
        for level in range(_STRATA):
            here = np.flatnonzero(
                (stratum == level) & tiles.fair[frame].any(axis=1) & np.isfinite(roughness) & ~taken
            )
            for _ in range(min(each, len(here))):
                pick = here[np.argmin(roughness[here] * (1 + 0.15 * crowd[cell[here]]))]
                taken[pick] = True
                crowd[cell[pick]] += 1
                here = here[here != pick]
    return np.flatnonzero(taken)


def _cells(count: int) -> npt.NDArray[np.int64]:
    """Bands of the picture, by the order of the places (row after row)."""
    return np.arange(count) * _CELLS * _CELLS // max(count, 1)
