"""Light lost towards a lens' edge, and how much brighter one lens' picture is, from what both lenses see.

A direction that lies at s = θ / θ_max in one lens lies at about 2 · 90° / θ_max − s in the other: the ratio
of both tells how steeply light falls near the edge, and hardly more. How it falls further inside is assumed
to lie between the square (cos⁴-like) and the sixth power of s, the loss being (1 − u − v) s² + u s⁴ + v s⁶
of its whole with u near 0.32 and v near 0.1; the overlap decides where it says more than that. A frame that
cuts light off only near the edge shows as a step there (a logistic curve), which no such power explains.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from studio_core.capturing.artifacts import F64, light_at
from studio_plugins.capture.overlap import EDGE, Stand, Strip, across, padded, ways

_BINS, _SECTORS = 24, 12
_SHAPE = (0.32, 0.1)
_SHAPE_SPREAD = (0.2, 0.1)
_ROUGH = 0.006  # what a bin's median may be wrong by beyond its noise, in ln
_LOSS_SPREAD = 0.35
_MOST = 0.85
_FEW = 20
_ROUNDS = 4
NO_RIM = (0.0, 1.0, 0.02)
_STEEPER, _GAIN = 0.6, 30.0  # how much better a steep rim must explain what is seen
_SHAPE_DOUBT = 0.15  # of what is lost, for what the overlap does not tell


@dataclass(frozen=True, eq=False)
class Balance:
    """`gain` (3,): front = gain · back. `falloff` and `rim`: as in `Registration`. `doubt`: standard
    deviation of the light lost at the edge. `off`: what ratios still differ by, median, log2."""

    gain: F64
    falloff: tuple[float, float, float]
    doubt: float
    off: float
    rim: tuple[float, float, float] = NO_RIM

    @property
    def loss(self) -> float:
        """Share of the light that is lost at the edge."""
        return 1 - float(light_at(self.falloff, self.rim, 1.0))


def from_loss(loss: float) -> tuple[float, float, float]:
    """The falloff whose light is less by `loss` (0 … 1) at the edge, of the usual shape."""
    u, v = _SHAPE
    return -loss * (1 - u - v), -loss * u, -loss * v


def balanced(front: Strip, back: Strip, stand: Stand, loss: float | None = None) -> Balance | None:
    """What makes both lenses' light the same where both see it; None where too little is seen by both.

    `loss`: of light at the edge where it is known; then only the gain is sought.
    """
    from scipy.optimize import least_squares

    ratio, here, there, noise = _ratios(front, back, stand)
    if len(ratio) < _FEW:
        return None
    first = np.median(ratio, axis=0)

    def light(x: F64, s: F64) -> F64:
        return light_at(from_loss(loss) if loss is not None else _falloff(x), _rim(x), s)

    def left(x: F64) -> F64:
        fall = np.log(light(x, here)) - np.log(light(x, there))
        return np.asarray((ratio - fall[:, None] - x[:3]) / noise, np.float64)

    def with_priors(x: F64, some: F64) -> F64:
        if loss is not None:
            return some
        return np.concatenate([some, [x[3] / _LOSS_SPREAD, *((x[4:6] - _SHAPE) / _SHAPE_SPREAD)]])

    def terms(x: F64) -> F64:
        """Pseudo-Huber."""
        some = left(x).ravel()
        soft = np.sign(some) * np.sqrt(2 * (np.sqrt(1 + (some / 1.5) ** 2) - 1)) * 1.5
        return with_priors(x, np.asarray(soft, np.float64))

    def settled(x: F64, **bounded: Any) -> Any:
        """From there, pieces that do not fit (reflections of the frame, near things) count less and less."""
        for _ in range(_ROUNDS):
            off = np.abs(left(x))
            scale = max(1.0, 1.48 * float(np.median(off)))
            weight = 1 / (1 + (off / (2.5 * scale)) ** 2)  # its square: Geman and McClure
            made = least_squares(lambda x: with_priors(x, (weight * left(x)).ravel()), x, **bounded)  # noqa: B023
            x = made.x
        return made

    if loss is not None:
        found = settled(least_squares(terms, first).x)
        return Balance(np.exp(found.x), from_loss(loss), 0.0, _off(left(found.x), noise))
    start = np.array([*first, 0.1, *_SHAPE, 0.1, 0.93, 0.02])
    low = np.array([*(first - 3), 0.0, -0.25, 0.0, 0.0, 0.85, 0.008])
    high = np.array([*(first + 3), _MOST, 0.8, 0.6, 0.9, 1.0, 0.06])
    smooth = least_squares(terms, start[:6], bounds=(low[:6], high[:6]), x_scale=0.1)
    steep = least_squares(terms, start, bounds=(low, high), x_scale=[0.1] * 6 + [0.1, 0.03, 0.02])
    if steep.cost < _STEEPER * smooth.cost and smooth.cost - steep.cost > _GAIN:
        found = settled(steep.x, bounds=(low, high), x_scale=[0.1] * 6 + [0.1, 0.03, 0.02])
    else:
        found = settled(smooth.x, bounds=(low[:6], high[:6]), x_scale=0.1)
    spread = np.linalg.pinv(found.jac.T @ found.jac)
    falloff, rim = _falloff(found.x), _rim(found.x)
    lost = 1 - float(light_at(falloff, rim, 1.0))
    doubt = math.hypot(math.sqrt(max(float(spread[3, 3]), 0.0)), _SHAPE_DOUBT * lost)
    return Balance(np.exp(found.x[:3]), falloff, doubt, _off(left(found.x), noise), rim)


def ring_gain(front: Strip, back: Strip) -> F64 | None:
    """(3,) front = gain · back from all that both lenses see, wherever it lies: geometric means of the ring.

    However the phone was rolled, both show about the same ring; so this needs no rotation. None where
    neither shows enough of it.
    """
    means = []
    for strip in (front, back):
        theta = strip.grid()[..., 1]
        ring = strip.resolved & (np.abs(theta - math.pi / 2) < EDGE * strip.lens.half - math.pi / 2)
        if ring.sum() < 100:
            return None
        means.append(strip.light[ring].mean(axis=0, dtype=np.float64))
    return np.asarray(2.0 ** (means[0] - means[1]), np.float64)


def _falloff(x: F64) -> tuple[float, float, float]:
    whole, u, v = (float(p) for p in x[3:6])
    return -whole * (1 - u - v), -whole * u, -whole * v


def _rim(x: F64) -> tuple[float, float, float]:
    return NO_RIM if len(x) < 9 else (float(x[6]), float(x[7]), float(x[8]))


def _off(left: F64, noise: F64) -> float:
    return float(np.median(np.abs(left * noise))) / math.log(2)


def _ratios(front: Strip, back: Strip, stand: Stand) -> tuple[F64, F64, F64, F64]:
    """Medians over pieces of the overlap: ln front / back (N, 3), s in both lenses (N,), noise (N, 1)."""
    import cv2

    at = front.grid()
    there = across(front, back, at, stand)
    x, y = back.pixels(there)
    usable = cv2.remap(
        padded(back.resolved.astype(np.float32)), x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT
    )
    other = np.asarray(cv2.remap(padded(back.light), x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE))
    half = math.radians(stand.fov) / 2
    s_front = np.arccos(np.clip(-ways(front, at, stand)[..., 2], -1, 1)) / half
    turned = ways(back, there, stand)
    s_back = np.arccos(np.clip(turned[..., 2], -1, 1)) / half
    both = front.resolved & (np.asarray(usable) > 0.99) & (s_front < EDGE) & (s_back < EDGE)
    empty = np.zeros((0, 3)), np.zeros(0), np.zeros(0), np.zeros((0, 1))
    if both.sum() < 100:
        return empty
    ratio = (front.light - other)[both] * math.log(2)
    a, s_front, s_back = at[..., 0][both], s_front[both], s_back[both]
    apart = s_front - s_back
    low, high = apart.min(), apart.max()
    bins = np.minimum(((apart - low) / max(high - low, 1e-9) * _BINS).astype(np.intp), _BINS - 1)
    sector = np.minimum((a / (2 * math.pi) * _SECTORS).astype(np.intp), _SECTORS - 1)
    group = bins * _SECTORS + sector
    order = np.argsort(group, kind="stable")
    cuts = np.flatnonzero(np.diff(group[order])) + 1
    made = []
    for part in np.split(order, cuts):
        if len(part) < 12:
            continue
        middle = np.median(ratio[part], axis=0)
        scatter = 1.48 * np.median(np.abs(ratio[part] - middle))
        made.append((*middle, s_front[part].mean(), s_back[part].mean(), scatter, len(part)))
    if not made:
        return empty
    table = np.array(made)
    noise = np.hypot(_ROUGH, 1.25 * table[:, 5] / np.sqrt(table[:, 6] / 9))  # neighbours are alike
    return table[:, :3], table[:, 3], table[:, 4], noise[:, None]
