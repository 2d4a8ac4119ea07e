"""Compact bright sources of an environment: taken out of the map and sampled for shadow rays.

A leaf of 2^15 directions is 1.2° wide, a sun 0.5°: one visibility ray a leaf is not enough where a leaf
holds much of the light. What shines so brightly that a leaf of it would hold over `SHARE` of all light
is connected to sources; those that are small are cut out of the map down to what surrounds them. Map and
sources add up to the original. A source's own light is as bilinear as the map's: every pixel a tent.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from studio_core.kernels.environment import row_weights

F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]
I64 = npt.NDArray[np.int64]

LEAF = 4 * math.pi / (1 << 15)
"""Solid angle of the leaves that are to hold little each."""
SHARE = 0.005
"""Of all light in a leaf as bright as a pixel, above which the pixel belongs to a source."""
LEAST = 0.001
"""Share of all light that a source has at least."""
ACROSS = math.radians(8.0)
"""Sources wider than this are windows. Lamps of 5.6° in leaves cost 0.65 % of irradiance, in samples 0.4."""
SAMPLES = 256
"""Most samples in all."""
PARTS = 16
"""Most sources; the weakest stay in the map."""
FEWEST = 16
"""Samples of a source at least."""
SAMPLE = 0.002
"""Share of all light in a sample, where there are enough: twice as many change irradiance by 0.03 %."""
_POINTS = 1 << 15  # of the grid over all tents, about


@dataclass(frozen=True, eq=False)
class Sun:
    """Directions that a map's compact sources shine from, in strata of about equal power.

    Samples are in the order of a tree of halves within each source, the strongest source first.
    """

    directions: F64
    """(Q, 3) unit, towards the light: the stratum's mean direction."""
    irradiance: F32
    """(Q, 3) what each gives to a surface that faces it, at unit gain."""
    parts: I64
    """(P + 1,) samples parts[i] … parts[i + 1] − 1 are those of source i."""

    def turned(self, rotation: npt.ArrayLike) -> Sun:
        """The same light in another frame: `rotation` (3, 3) is there from here."""
        return Sun(self.directions @ np.asarray(rotation, np.float64).T, self.irradiance, self.parts)

    def coarsened(self, samples: int) -> Sun:
        """About as few as `samples`, at least one a source: neighbours put together."""
        if samples >= len(self.directions):
            return self
        starts, parts = [], [0]
        for first, last in zip(self.parts[:-1], self.parts[1:], strict=True):
            count = max(1, round((last - first) * samples / len(self.directions)))
            starts.append(first + (last - first) * np.arange(count) // count)
            parts.append(parts[-1] + count)
        at = np.concatenate(starts)
        weight = self.irradiance.astype(np.float64).sum(axis=1, keepdims=True)
        middle = np.add.reduceat(self.directions * weight, at, axis=0)
        light = np.add.reduceat(self.irradiance.astype(np.float64), at, axis=0).astype(np.float32)
        return Sun(_unit(middle), light, np.array(parts, np.int64))


def split_suns(pixels: F32) -> tuple[F32, Sun | None]:
    """The map (H, W, 3) without its suns, and these in the map's own frame; the map itself where it has none.

    pixels: finite radiance ≥ 0, so are both results. Their light adds up to the map's.
    """
    height, width = pixels.shape[:2]
    weights = row_weights(height) * 2 * math.pi / width
    grey = pixels.mean(axis=2)
    total = float(grey.sum(axis=1, dtype=np.float64) @ weights)
    bright = np.flatnonzero(grey > SHARE * total / LEAF) if total > 0 else np.zeros(0, np.int64)
    if not len(bright):
        return pixels, None
    found = []
    label = _connected(bright, height, width)
    for source in np.unique(label):
        where = bright[label == source]
        if _across(where, grey, height, width) > ACROSS:
            continue
        around = _ring(where, height, width)
        flat = pixels.reshape(-1, 3)
        ground = flat[around].mean(axis=0) if len(around) else np.zeros(3, np.float32)
        excess = np.maximum(flat[where] - ground, 0)
        power = excess.astype(np.float64) * weights[where // width, None]
        if power.sum() / 3 > LEAST * total:
            found.append((float(power.sum()), where, excess, power))
    if not found:
        return pixels, None
    found = sorted(found, key=lambda one: -one[0])[:PARTS]
    rest = pixels.copy()
    for _, where, excess, _ in found:
        rest.reshape(-1, 3)[where] -= excess
    return rest, _sampled([(where, power) for _, where, _, power in found], total, height, width)


def _connected(bright: I64, height: int, width: int) -> I64:
    """A number for each of the sorted pixels, equal where they touch: around the seam and at poles too."""
    row, column = np.divmod(bright, width)
    links = []
    for down, right in ((0, 1), (1, -1), (1, 0), (1, 1)):
        near = np.minimum(row + down, height) * width + (column + right) % width
        at = np.minimum(np.searchsorted(bright, near), len(bright) - 1)
        hit = (bright[at] == near) & (row + down < height)
        links.append(np.stack([np.flatnonzero(hit), at[hit]]))
    for pole in (0, height - 1):
        there = np.flatnonzero(row == pole)
        links.append(np.stack([there[:-1], there[1:]]))
    a, b = np.concatenate(links, axis=1)
    label = np.arange(len(bright))
    while True:
        low = np.minimum(label[a], label[b])
        new = label.copy()
        np.minimum.at(new, a, low)
        np.minimum.at(new, b, low)
        new = new[new]
        if np.array_equal(new, label):
            return label
        label = new


def _ring(where: I64, height: int, width: int) -> I64:
    """The pixels that touch `where` and are not in it."""
    row, column = np.divmod(where, width)
    near = [
        np.clip(row + i, 0, height - 1) * width + (column + j) % width for i in (-1, 0, 1) for j in (-1, 0, 1)
    ]
    return np.setdiff1d(np.concatenate(near), where)


def _directions(row: F64, column: F64, height: int, width: int) -> F64:
    """Unit directions of places in the map, counted in pixels from its upper left corner."""
    v, u = np.pi * row / height, 2 * np.pi * (0.5 - column / width)
    return np.stack([np.sin(v) * np.sin(u), np.cos(v), np.sin(v) * np.cos(u)], axis=-1)


def _across(where: I64, grey: F32, height: int, width: int) -> float:
    """Twice the largest angle between the middle of pixels and any of them, and a pixel."""
    row, column = np.divmod(where, width)
    towards = _directions(row + 0.5, column + 0.5, height, width)
    light = grey.reshape(-1)[where].astype(np.float64) * np.sin(np.pi * (row + 0.5) / height)
    middle = _unit((towards * light[:, None]).sum(axis=0))
    return float(2 * np.arccos(np.clip((towards @ middle).min(), -1, 1))) + math.pi / height


def _sampled(sources: list[tuple[I64, F64]], total: float, height: int, width: int) -> Sun:
    """Strata of sources (pixels, power (N, 3) of each pixel's tent); `total` is all light of the map."""
    own = sum(float(power.sum()) for _, power in sources)
    spare = min(SAMPLES, math.ceil(own / 3 / total / SAMPLE)) - FEWEST * len(sources)
    towards, light, parts = [], [], [0]
    for where, power in sources:
        count = FEWEST + int(max(spare, 0) * power.sum() / own + 1e-6)
        places, shares = _tents(where, power, height, width)
        for stratum in _halved(places, shares.sum(axis=1), np.arange(len(places)), count):
            held = shares[stratum]
            towards.append((places[stratum] * held.sum(axis=1, keepdims=True)).sum(axis=0))
            light.append(held.sum(axis=0))
        parts.append(len(light))
    return Sun(_unit(np.array(towards)), np.array(light, np.float32), np.array(parts, np.int64))


def _tents(where: I64, power: F64, height: int, width: int) -> tuple[F64, F64]:
    """Directions (N, 3) on a grid over the pixels' tents and the power (N, 3) there; sums are kept."""
    n = 2 * int(np.clip(math.sqrt(_POINTS / len(where)) / 2, 1, 12))
    step = (np.arange(n) + 0.5) * 2 / n - 1
    row, column = np.divmod(where, width)
    rows = row[:, None] + 0.5 + step
    outside = (rows < 0) | (rows > height)
    tent = np.where((rows < 0.5) | (rows > height - 0.5), 1.0, 1 - np.abs(step))  # poles: clamped
    down = np.where(outside, 0.0, tent * np.sin(np.pi * np.clip(rows, 0, height) / height))
    share = down[:, :, None] * (1 - np.abs(step))
    share /= share.sum(axis=(1, 2), keepdims=True)
    columns = column[:, None, None] + 0.5 + step
    places = _directions(np.broadcast_to(rows[:, :, None], share.shape), columns, height, width)
    lit = (share[..., None] * power[:, None, None]).reshape(-1, 3)
    there = lit.any(axis=1)
    return places.reshape(-1, 3)[there], lit[there]


def _halved(places: F64, weight: F64, chosen: I64, count: int) -> list[I64]:
    """`chosen` in `count` sets of about equal weight, halved across where they reach furthest."""
    if count == 1 or len(chosen) <= 1:
        return [chosen]
    own = places[chosen]
    axis = np.argmax(own.max(axis=0) - own.min(axis=0))
    order = chosen[np.argsort(own[:, axis], kind="stable")]
    upto = np.cumsum(weight[order])
    half = count // 2
    cut = int(np.clip(np.searchsorted(upto, upto[-1] * half / count), 1, len(order) - 1))
    return [
        *_halved(places, weight, order[:cut], half),
        *_halved(places, weight, order[cut:], count - half),
    ]


def _unit(vectors: F64) -> F64:
    return np.asarray(vectors / np.linalg.norm(vectors, axis=-1, keepdims=True), np.float64)
