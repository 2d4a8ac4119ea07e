"""First guesses of how two lenses stand to each other, from what their unrolled rims show.

Features (SIFT: Lowe 2004) of both strips are matched over all azimuths, so that the phone may have been
rolled by any angle for the second photograph; a rotation and a field of view that many matches from all
around agree on are found by random sampling (Fischler and Bolles 1981). Where there are too few features,
the strips are laid over each other at every roll.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from studio_core.capturing.artifacts import F32, F64, Mask
from studio_plugins.capture.overlap import (
    NOTHING,
    Patches,
    Stand,
    Strip,
    across,
    flattened,
    padded,
    spread,
    ways,
)
from studio_plugins.capture.solve import solved

_CALM = 5.0  # degrees over which tones are levelled before features are looked for
_RATIO = 0.85
_TWIST = 25.0  # degrees by which a feature of both strips may be turned
_REACH = 14.0  # degrees by which it may lie off in t
_CLOSE = math.radians(1.0)
_MOST = 1200
_SAMPLES = 400
_SECTORS = 24
_ENOUGH = 8
_PIECE = 24  # degrees


@dataclass(frozen=True, eq=False)
class Guess:
    """A stand and how many matches, at most a few in each sector of azimuth, agree on it."""

    stand: Stand
    score: float


def _features(strip: Strip) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float32], F64]:
    """Places (N, 2), descriptors (N, 128) and orientation in degrees of a strip's features."""
    import cv2

    flat = flattened(strip.tone, strip.usable, math.radians(_CALM) / strip.step)
    spread = 1.48 * float(np.median(np.abs(flat[strip.usable]))) if strip.usable.any() else 0.0
    if spread < 1e-3:
        return np.zeros((0, 2)), np.zeros((0, 128), np.float32), np.zeros(0)
    picture = np.clip(128 + 40 * flat / max(spread, 0.03), 0, 255).astype(np.uint8)
    wide = 64
    columns = strip.shape[1]
    around = np.concatenate([picture[:, -wide:], picture, picture[:, :wide]], axis=1)
    usable = np.concatenate([strip.usable[:, -wide:], strip.usable, strip.usable[:, :wide]], axis=1)
    mask = cv2.erode(usable.astype(np.uint8), np.ones((5, 5), np.uint8), borderValue=0)
    mask[:, : wide // 2] = 0
    mask[:, -wide // 2 :] = 0
    found, words = cv2.SIFT.create(nfeatures=4000, contrastThreshold=0.02).detectAndCompute(around, mask)
    if words is None or not found:
        return np.zeros((0, 2)), np.zeros((0, 128), np.float32), np.zeros(0)
    x = np.array([p.pt for p in found]) + 0.5
    at = np.stack([np.mod(x[:, 0] - wide, columns) * strip.step, strip.first + x[:, 1] * strip.step], axis=-1)
    return at, np.asarray(words, np.float32), np.array([p.angle for p in found])


def matches(front: Strip, back: Strip) -> tuple[F64, F64]:
    """Places (N, 2) in the front and back strips that may show the same, at any roll."""
    here, words, angle = _features(front)
    there, others, other_angle = _features(back)
    if len(here) < 2 or len(there) < 2:
        return np.zeros((0, 2)), np.zeros((0, 2))
    words, others = np.sqrt(_unit(words)), np.sqrt(_unit(others))  # Arandjelovic and Zisserman 2012
    near = words @ others.T
    off = np.abs(here[:, None, 1] - there[None, :, 1]) > math.radians(_REACH)
    near[off] = -1
    best = np.argpartition(-near, 1, axis=1)[:, :2]
    value = np.take_along_axis(near, best, axis=1)
    order = np.argsort(-value, axis=1)
    best, value = np.take_along_axis(best, order, axis=1), np.take_along_axis(value, order, axis=1)
    first, second = np.sqrt(np.maximum(2 - 2 * value, 0)).T
    twist = np.abs((angle - other_angle[best[:, 0]] + 180) % 360 - 180)
    mutual = near.argmax(axis=0)[best[:, 0]] == np.arange(len(here))
    good = (first < _RATIO * second) & (twist < _TWIST) & mutual & (value[:, 0] > 0)
    keep = np.flatnonzero(good)
    keep = keep[np.argsort(first[keep] / np.maximum(second[keep], 1e-9))[:_MOST]]
    return here[keep], there[best[keep, 0]]


def _unit(words: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
    made: npt.NDArray[np.float32] = words / np.maximum(words.sum(axis=1, keepdims=True), 1e-9)
    return made


def by_features(front: Strip, back: Strip, fovs: F64, seed: int = 5) -> Guess | None:
    """The stand that most matches agree on, for the best of the fields of view; None without agreement."""
    here, there = matches(front, back)
    if len(here) < _ENOUGH:
        return None
    rng = np.random.default_rng(seed)
    pairs = rng.integers(0, len(here), (_SAMPLES, 2))
    pairs = pairs[pairs[:, 0] != pairs[:, 1]]
    sector = np.minimum((here[:, 0] / (2 * math.pi) * _SECTORS).astype(np.intp), _SECTORS - 1)
    member = np.zeros((len(here), _SECTORS), np.float32)
    member[np.arange(len(here)), sector] = 1
    best: Guess | None = None
    for fov in fovs:
        stand = Stand(np.eye(3), float(fov))
        a, b = ways(front, here, stand), ways(back, there, stand)
        turns = _frames(a[pairs]) @ _frames(b[pairs]).transpose(0, 2, 1)
        apart = np.linalg.norm(turns @ b.T - a.T, axis=1)  # (samples, N)
        close = np.maximum(1 - (apart / _CLOSE) ** 2, 0).astype(np.float32)
        score = np.minimum(close @ member, 4).sum(axis=1)
        at = int(score.argmax())
        if best is None or score[at] > best.score:
            best = Guess(Stand(np.asarray(turns[at], np.float64), float(fov)), float(score[at]))
    if best is None or best.score < _ENOUGH / 2:
        return None
    stand = best.stand
    for _ in range(2):
        a, b = ways(front, here, stand), ways(back, there, stand) @ stand.turn.T
        agree = np.linalg.norm(a - b, axis=1) < 1.5 * _CLOSE
        if agree.sum() < _ENOUGH:
            break
        stand = solved(front, back, _as_patches(here[agree], there[agree]), stand, len(fovs) > 1).stand
    return Guess(stand, best.score)


def _as_patches(here: F64, there: F64) -> Patches:
    """Matches of features, each sure to a quarter of a degree."""
    count = len(here)
    surety = np.repeat((np.eye(2) / math.radians(0.25) ** 2)[None], count, axis=0)
    return Patches(here, there, surety, np.ones(count), np.ones(count), float(count))


def _frames(two: F64) -> F64:
    """(S, 3, 3) orthonormal frames of pairs of directions (S, 2, 3)."""
    middle, normal = two.sum(axis=1), np.cross(two[:, 0], two[:, 1])
    middle /= np.maximum(np.linalg.norm(middle, axis=1, keepdims=True), 1e-12)
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-12)
    return np.stack([middle, normal, np.cross(middle, normal)], axis=-1)


def by_sliding(front: Strip, back: Strip, stand: Stand, reach: int = 7) -> Patches:
    """What a stand may be off by up to `reach` degrees: by how much pieces of the back strip must slide.

    Every piece, 24° wide and as high as the overlap, is tried at all shifts of whole degrees.
    """
    here, mask, at = _coarse(front, front, None)
    there, other_mask, _ = _coarse(front, back, stand)
    best = np.full(360, -1.0)
    shift = np.zeros((360, 2), np.intp)
    for down in range(-reach, reach + 1):
        rows = slice(max(0, -down), min(len(here), len(here) - down))
        moved = slice(rows.start + down, rows.stop + down)
        a, m = here[rows], mask[rows]
        for along in range(-reach, reach + 1):
            b, n = np.roll(there[moved], -along, axis=1), np.roll(other_mask[moved], -along, axis=1)
            both = m & n
            x, y = a * both, b * both
            sums = np.stack([part.sum(axis=0) for part in (both, x, y, x * x, y * y, x * y)]).astype(
                np.float64
            )
            sums = np.cumsum(
                np.concatenate([sums[:, -_PIECE // 2 :], sums, sums[:, : _PIECE // 2]], 1), axis=1
            )
            count, x1, y1, xx, yy, xy = (sums[:, _PIECE:] - sums[:, :-_PIECE])[:, :360]
            few = count < 1.5 * _PIECE
            count = np.maximum(count, 1)
            va, vb = xx / count - (x1 / count) ** 2, yy / count - (y1 / count) ** 2
            like = (xy / count - x1 * y1 / count**2) / np.sqrt(np.maximum(va * vb, 1e-8))
            like[few | (va < 1e-4) | (vb < 1e-4)] = -1
            better = like > best
            best[better] = like[better]
            shift[better] = along, down
    column = np.arange(6, 360, _PIECE // 2)
    column = column[best[column] > 0.5]
    if not len(column):
        return NOTHING
    row = int(np.argmin(np.abs(at[:, 0, 1] - math.pi / 2)))
    places = at[row, column]
    seen = across(front, back, places + np.radians(shift[column].astype(np.float64)), stand)
    surety = np.repeat((np.eye(2) / math.radians(0.5) ** 2)[None], len(column), axis=0)
    return Patches(places, seen, surety, best[column], best[column], float(best[column].sum()))


def by_rolling(front: Strip, back: Strip, fov: float, count: int = 3) -> tuple[Stand, ...]:
    """Stands at the rolls where both strips, blurred, agree best within a few degrees of t."""
    one, mask, _ = _coarse(front, front, None)
    other, other_mask, _ = _coarse(front, back, Stand(np.eye(3), fov))
    one, other = one * mask, other * other_mask
    rows, other_rows = (np.asarray(m.any(axis=1))[:, None] for m in (mask, other_mask))
    score = np.full(360, -1.0)
    for lift in range(-4, 5):  # degrees
        first, last = max(0, lift), min(len(one), len(one) + lift)
        a, b = one[first:last], other[first - lift : last - lift]
        a, b = (
            a * other_rows[first - lift : last - lift],
            b * rows[first:last],
        )
        norm = float(np.sqrt((a * a).sum() * (b * b).sum()))
        if norm <= 0:
            continue
        spectrum = (np.fft.rfft(a, axis=1) * np.conj(np.fft.rfft(b, axis=1))).sum(axis=0)
        score = np.maximum(score, np.fft.irfft(spectrum, 360) / norm)
    made = []
    for _ in range(count):
        at = int(score.argmax())
        if score[at] <= 0.2:
            break
        c, s = math.cos(math.radians(at)), math.sin(math.radians(at))
        made.append(Stand(np.array([[c, -s, 0], [s, c, 0], [0, 0, 1.0]]), fov))
        score[np.mod(np.arange(at - 8, at + 9), 360)] = -1
    return tuple(made)


def _coarse(front: Strip, strip: Strip, stand: Stand | None) -> tuple[F32, Mask, F64]:
    """A strip with a pixel a degree from 60° to 120°, levelled: tones, what is known, and the places.

    With a stand it is the back lens' strip as the front's would be.
    """
    import cv2

    a, t = np.meshgrid(np.radians(np.arange(360) + 0.5), np.radians(np.arange(60, 120) + 0.5))
    at = np.stack([a, t], axis=-1)
    sigma = 0.6 * math.radians(1) / strip.step
    weight = strip.usable.astype(np.float32)
    flat = flattened(strip.tone, strip.usable, math.radians(14) / strip.step)
    calm = spread(np.dstack([flat, weight]), sigma)
    tone = padded(np.where(strip.usable, calm[..., 0] / np.maximum(calm[..., 1], 1e-3), 0).astype(np.float32))
    x, y = strip.pixels(at if stand is None else across(front, strip, at, stand))
    known = cv2.remap(padded(weight), x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT)
    made = cv2.remap(tone, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT)
    return np.asarray(made, np.float32), np.greater(known, 0.9).astype(np.bool_), at
