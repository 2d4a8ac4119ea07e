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

from studio_core.capturing.artifacts import F32, F64
from studio_plugins.capture.overlap import Stand, Strip, flattened, ways

_CALM = 5.0  # degrees over which tones are levelled before features are looked for
_RATIO = 0.85
_TWIST = 25.0  # degrees by which a feature of both strips may be turned
_REACH = 14.0  # degrees by which it may lie off in t
_CLOSE = math.radians(1.0)
_MOST = 1200
_SAMPLES = 400
_SECTORS = 24
_ENOUGH = 8


@dataclass(frozen=True, eq=False)
class Guess:
    """A stand and how many matches, at most a few in each sector of azimuth, agree on it."""

    stand: Stand
    score: float


def _features(strip: Strip) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float32], F64]:
    """Places (N, 2), descriptors (N, 128) and orientation in degrees of a strip's features."""
    import cv2

    flat = flattened(strip, _CALM)
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
    return best if best is not None and best.score >= _ENOUGH / 2 else None


def _frames(two: F64) -> F64:
    """(S, 3, 3) orthonormal frames of pairs of directions (S, 2, 3)."""
    middle, normal = two.sum(axis=1), np.cross(two[:, 0], two[:, 1])
    middle /= np.maximum(np.linalg.norm(middle, axis=1, keepdims=True), 1e-12)
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-12)
    return np.stack([middle, normal, np.cross(middle, normal)], axis=-1)


def by_rolling(front: Strip, back: Strip, fov: float, count: int = 3) -> tuple[Stand, ...]:
    """Stands at the rolls where both strips, blurred, agree best within a few degrees of t."""
    one, other = (_coarse(strip) for strip in (front, back))
    low, high = max(one[1], other[1]), min(one[1] + one[0].shape[0], other[1] + other[0].shape[0])
    columns = one[0].shape[1]
    score = np.full(columns, -1.0)
    for lift in range(-4, 5):  # degrees
        first, last = max(low, low + lift), min(high, high + lift)
        if last - first < 2:
            continue
        a, b = (
            one[0][first - one[1] : last - one[1]],
            other[0][first - lift - other[1] : last - lift - other[1]],
        )
        norm = float(np.sqrt((a * a).sum() * (b * b).sum()))
        if norm <= 0:
            continue
        spectrum = (np.fft.rfft(a, axis=1) * np.conj(np.fft.rfft(b, axis=1))).sum(axis=0)
        score = np.maximum(score, np.fft.irfft(spectrum, columns) / norm)
    made = []
    for _ in range(count):
        at = int(score.argmax())
        if score[at] <= 0.2:
            break
        roll = 2 * math.pi * at / columns
        c, s = math.cos(roll), math.sin(roll)
        made.append(Stand(np.array([[c, -s, 0], [s, c, 0], [0, 0, 1.0]]), fov))
        score[np.mod(np.arange(at - 8, at + 9), columns)] = -1
    return tuple(made)


def _coarse(strip: Strip) -> tuple[F32, int]:
    """A strip with a pixel a degree, levelled, and the whole degree its first row begins at."""
    import cv2

    flat = flattened(strip, 12.0)
    sigma = math.radians(0.7) / strip.step
    flat = np.asarray(cv2.GaussianBlur(flat, (0, 0), sigma, borderType=cv2.BORDER_REPLICATE), np.float32)
    start = math.ceil(math.degrees(strip.first))
    end = int(math.degrees(strip.first + strip.shape[0] * strip.step))
    rows = (np.radians(np.arange(start, end) + 0.5) - strip.first) / strip.step - 0.5
    columns = np.radians(np.arange(360) + 0.5) / strip.step - 0.5
    x, y = np.meshgrid(columns.astype(np.float32), rows.astype(np.float32))
    return np.asarray(cv2.remap(flat, x, y, cv2.INTER_LINEAR), np.float32), start
