"""Joining two lenses along the ring that both see: where the seam runs, and how it is made invisible.

All of it happens on a strip, azimuth about the front lens' axis × angle θ from it, which has no poles and
meets its own beginning. The seam is the closed path along which both lenses agree best, so it goes round
near things, which each lens sees elsewhere, and round reflections that were left. At it the joined light is

    (w · front + (1 − w) · back) · exp(Q − w · G)

with w the front lens' share, a step a pixel or so wide, G the logarithm of front / back without the finest
detail, and Q what becomes of w · G when its jump is taken away: its bands, each blended over its own size
(Burt and Adelson 1983, "A multiresolution spline"), or the solution of ΔQ = div(w ∇G) (gradient domain,
Pérez et al. 2003). Only differences of exposure are spread so, in logarithms: where the lenses see different
things (nearby ones) G does not follow, or a lamp's light would spread around it.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from studio_core.capturing.artifacts import F32, F64, Mask
from studio_core.capturing.settings import FEATHER, GRADIENT

Look = Callable[[F64], tuple[F32, Mask]]
"""What a lens shows in directions (h, w, 3) of the front lens' frame, and where it sees."""

_PATH_ROWS, _PATH_COLUMNS = 64, 720
_BLIND = 50.0  # cost of a place that the lens chosen for it does not see
_DIFFERENT = 0.5  # logarithm of a ratio from which on both see different things


@dataclass(frozen=True, eq=False)
class Strip:
    """A ring around the front lens' axis, θ from `low` to `high` (radians) in `rows` × `columns`."""

    low: float
    high: float
    rows: int
    columns: int

    def directions(self) -> F64:
        """(rows, columns, 3) in the front lens' frame: azimuth 0 is +x, 90° is +y."""
        theta = self.low + (np.arange(self.rows) + 0.5) * ((self.high - self.low) / self.rows)
        azimuth = (np.arange(self.columns) + 0.5) * (2 * np.pi / self.columns)
        made = np.empty((self.rows, self.columns, 3))
        ring = np.sin(theta)[:, None]
        made[..., 0], made[..., 1] = ring * np.cos(azimuth), ring * np.sin(azimuth)
        made[..., 2] = -np.cos(theta)[:, None]
        return made


@dataclass(frozen=True, eq=False)
class Joint:
    """How two lenses are joined: `path` (columns,) θ of the seam over azimuth, radians.

    `q`, `g` (rows + 2, columns + 2, 3): the fields of this module's formula with a border; None: both 0.
    `width`: over how many radians the front lens' share goes from 1 to 0. `cost`: mean disagreement along
    the seam, log2; `overlap`: degrees that both see, in the median over azimuth.
    """

    strip: Strip
    path: F64
    width: float
    q: F32 | None
    g: F32 | None
    cost: float
    overlap: float

    def share(self, azimuth: F64, theta: F64) -> F32:
        """The front lens' share in directions, before what is seen counts."""
        n = len(self.path)
        at = azimuth * (n / (2 * np.pi)) - 0.5
        low = np.floor(at).astype(np.intp)
        part = at - low
        border = self.path[low % n] * (1 - part) + self.path[(low + 1) % n] * part
        x = np.clip((border - theta) / self.width + 0.5, 0, 1)
        return np.asarray(x * x * (3 - 2 * x), np.float32)

    def evened(self, azimuth: F64, theta: F64, share: F32) -> F32 | None:
        """(h, w, 3) factor exp(Q − w · G), 1 outside the strip; None when it is 1 everywhere."""
        if self.q is None or self.g is None:
            return None
        import cv2

        strip = self.strip
        x = np.asarray(np.mod(azimuth, 2 * np.pi) * (strip.columns / (2 * np.pi)) + 0.5, np.float32)
        y = np.asarray((theta - strip.low) * (strip.rows / (strip.high - strip.low)) + 0.5, np.float32)
        q, g = (
            np.asarray(cv2.remap(f, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE))
            for f in (self.q, self.g)
        )
        inside = (y > 0) & (y < strip.rows + 1)
        made: F32 = np.where(inside[..., None], np.exp(q - share[..., None] * g), np.float32(1))
        return made


def join(front: Look, back: Look, width: int, blend: str, feather: float) -> Joint:
    """Where and how two lenses meet, for a finished picture of this width; `feather` in radians.

    Without an overlap the seam lies where the front lens ends and nothing is blended.
    """
    pixel = 2 * np.pi / width
    rough = Strip(0.0, np.pi, 180, 360)
    both = front(rough.directions())[1] & back(rough.directions())[1]
    rows = np.flatnonzero(both.mean(axis=1) > 0.02)
    if not len(rows):
        return _without_overlap(front, rough, pixel)
    step = np.pi / 180
    low, high = rows[0] * step, (rows[-1] + 1) * step
    strip = Strip(low, high, min(_PATH_ROWS, max(8, round((high - low) / step * 4))), _PATH_COLUMNS)
    path, cost, overlap = _path(front, back, strip)
    if blend == FEATHER:
        return Joint(strip, path, feather, None, None, cost, overlap)
    margin = min(max(feather, 0.05) * 2, low, np.pi - high)
    columns = int(np.clip(width // 2, 90, 2048))
    rows_wide = max(8, round((high - low + 2 * margin) * columns / (2 * np.pi)))
    strip = Strip(low - margin, high + margin, rows_wide, columns)
    ratio, weight = _difference(front, back, strip)
    if not weight.any():
        return Joint(strip, path, 2 * pixel, None, None, cost, overlap)
    joint = Joint(strip, path, 2 * pixel, None, None, cost, overlap)
    directions = strip.directions()
    azimuth = np.arctan2(directions[..., 1], directions[..., 0])
    theta = np.arccos(np.clip(-directions[..., 2], -1, 1))
    hard = joint.share(azimuth, theta)
    if blend == GRADIENT:
        q, g = _membrane(ratio, weight, hard)
    else:
        q, g = _bands(ratio, weight, hard, feather * columns / (2 * np.pi))
    return Joint(strip, path, 2 * pixel, _bordered(q), _bordered(g), cost, overlap)


def _without_overlap(front: Look, strip: Strip, pixel: float) -> Joint:
    seen = front(strip.directions())[1]
    ends = np.where(seen.any(axis=0), strip.rows - np.argmax(seen[::-1], axis=0), 0) * (np.pi / strip.rows)
    return Joint(strip, np.asarray(ends, np.float64), pixel, None, None, 0.0, 0.0)


def _path(front: Look, back: Look, strip: Strip) -> tuple[F64, float, float]:
    """θ of the best closed path at the columns, its mean cost in log2, and the overlap in degrees."""
    import cv2

    directions = strip.directions()
    (f, sees_front), (b, sees_back) = front(directions), back(directions)
    both = sees_front & sees_back
    if not both.any():
        return np.full(strip.columns, (strip.low + strip.high) / 2), 0.0, 0.0
    floor = 1e-3 * float(np.median(f[both].mean(axis=1))) + 1e-12
    ratio = np.log2((f + floor) / (b + floor))
    ratio -= np.median(ratio[both], axis=0)
    apart = np.where(both, np.minimum(np.abs(ratio).mean(axis=2), 3.0), 0.0).astype(np.float32)
    smooth = _blur(apart, 1.5) / np.maximum(_blur(both.astype(np.float32), 1.5), 1e-3)
    inside = [cv2.erode(m.astype(np.uint8), np.ones((5, 5), np.uint8)) > 0 for m in (sees_front, sees_back)]
    if (inside[0] & inside[1]).any():  # the outermost places only where there are no others
        sees_front, sees_back = inside
    blind_front = np.cumsum(~sees_front, axis=0)  # up to here the front lens would have to be seen
    blind_back = np.cumsum((~sees_back)[::-1], axis=0)[::-1]
    middle = np.abs(np.arange(strip.rows) - (strip.rows - 1) / 2)[:, None] / strip.rows
    cost = smooth + 0.05 * middle + _BLIND * (blind_front + blind_back)
    rows = closed_path(np.asarray(cost, np.float64))
    at = np.arange(strip.columns)
    step = (strip.high - strip.low) / strip.rows
    path = strip.low + (rows + 0.5) * step
    wide = np.concatenate([path[-8:], path, path[:8]]).reshape(1, -1)
    path = np.asarray(cv2.GaussianBlur(wide, (0, 0), 1.5)[0, 8:-8], np.float64)
    here = both[rows, at]
    disagreement = float(smooth[rows, at][here].mean()) if here.any() else 0.0
    across = float(np.median(both.sum(axis=0)))
    return np.asarray(path, np.float64), disagreement, across * math.degrees(step)


def closed_path(cost: F64) -> npt.NDArray[np.intp]:
    """(columns,) row of the cheapest path through `cost` (rows, columns), last and first column neighbours.

    From column to column it moves by at most one row; moving costs a little. Exact: the best path is found
    for every row of the beginning at once, and the cheapest of these closed ones taken.
    """
    rows, columns = cost.shape
    total = np.where(np.eye(rows, dtype=np.bool_), cost[:, 0], np.inf)  # (start, row)
    came = np.empty((columns, rows, rows), np.int8)
    aside = 0.02
    edge = np.full((rows, 1), np.inf)
    for column in range(1, columns):
        wide = np.concatenate([edge, total, edge], axis=1)
        three = np.stack([wide[:, :-2] + aside, wide[:, 1:-1], wide[:, 2:] + aside])
        best = three.argmin(axis=0)
        came[column] = best - 1
        total = np.take_along_axis(three, best[None], axis=0)[0] + cost[:, column]
    ends = np.full((rows, 3), np.inf)
    for k, shift in enumerate((-1, 0, 1)):
        inside = np.arange(max(0, -shift), min(rows, rows - shift))
        ends[inside, k] = total[inside, inside + shift] + aside * abs(shift)
    start, k = divmod(int(ends.argmin()), 3)
    row = start + k - 1
    path = np.empty(columns, np.intp)
    for column in range(columns - 1, 0, -1):
        path[column] = row
        row += int(came[column, start, row])
    path[0] = row
    return path


def _difference(front: Look, back: Look, strip: Strip) -> tuple[F32, F32]:
    """log(front / back) (rows, columns, 3), 0 where unknown, and how far it can be trusted, 0 … 1."""
    directions = strip.directions()
    (f, sees_front), (b, sees_back) = front(directions), back(directions)
    both = sees_front & sees_back
    if not both.any():
        return np.zeros_like(f), np.zeros(both.shape, np.float32)
    floor = 1e-3 * float(np.median(f[both].mean(axis=1))) + 1e-12
    ratio = np.where(both[..., None], np.log((f + floor) / (b + floor)), 0)
    usual = np.median(ratio[both], axis=0)
    away = np.abs(_blur(np.where(both[..., None], ratio - usual, 0).astype(np.float32), 1.0)).max(axis=2)
    weight = both * np.exp(-((away / _DIFFERENT) ** 2))
    return np.asarray(ratio, np.float32), np.asarray(weight, np.float32)


def _bands(ratio: F32, weight: F32, hard: F32, feather: float) -> tuple[F32, F32]:
    """Q and G of Burt and Adelson's blending: every octave of the difference over twice its own size."""
    levels = max(1, round(math.log2(max(feather / 2, 1.0))))
    smooth = [_spread(ratio, weight, 2.0**k) for k in range(levels + 1)]
    q = np.zeros_like(ratio)
    for k in range(levels):
        q += (smooth[k] - smooth[k + 1]) * _blur(hard, 2.0**k)[..., None]
    q += smooth[-1] * _blur(hard, 2.0**levels)[..., None]
    return q, smooth[0]


def _membrane(ratio: F32, weight: F32, hard: F32) -> tuple[F32, F32]:
    """Q and G of gradient-domain blending: ΔQ = div(w ∇G), Q = w · G on the strip's two borders.

    Exact by Fourier along the ring and a sine transform across it.
    """
    from scipy import fft

    g = _spread(ratio, weight, 2.0)
    rows, columns = hard.shape
    w = hard[..., None].astype(np.float64)
    down = (w[1:] + w[:-1]) / 2 * np.diff(g, axis=0)
    right = (w + np.roll(w, -1, axis=1)) / 2 * (np.roll(g, -1, axis=1) - g)
    source = np.zeros(g.shape)
    source[1:-1] = down[1:] - down[:-1]
    source += right - np.roll(right, 1, axis=1)
    q = w * g
    inner = source[1:-1].copy()
    inner[0] -= q[0]
    inner[-1] -= q[-1]
    n = rows - 2
    waves = fft.dst(np.fft.rfft(inner, axis=1), type=1, axis=0)
    down_value = 2 * np.cos(np.pi * np.arange(1, n + 1) / (n + 1)) - 2
    along_value = 2 * np.cos(2 * np.pi * np.arange(waves.shape[1]) / columns) - 2
    waves /= (down_value[:, None] + along_value[None, :])[..., None]
    q[1:-1] = np.fft.irfft(fft.idst(waves, type=1, axis=0), columns, axis=1)
    return np.asarray(q, np.float32), g


def _spread(ratio: F32, weight: F32, sigma: float) -> F32:
    """Weighted mean around each place; far from all that is trusted, the mean of all."""
    total = max(float(weight.sum()), 1e-9)
    usual = (ratio * weight[..., None]).sum(axis=(0, 1), dtype=np.float64) / total
    away = (ratio - usual.astype(np.float32)) * weight[..., None]
    made: F32 = _blur(away, sigma) / (_blur(weight, sigma) + np.float32(0.02))[..., None]
    return np.asarray(made + usual, np.float32)


def _blur(strip: F32, sigma: float) -> F32:
    """Gaussian on a strip that meets its own beginning."""
    import cv2

    reach = min(round(4 * sigma) + 1, strip.shape[1])
    wide = np.concatenate([strip[:, -reach:], strip, strip[:, :reach]], axis=1)
    made = cv2.GaussianBlur(wide, (0, 0), sigma, borderType=cv2.BORDER_REPLICATE)
    return np.ascontiguousarray(made[:, reach:-reach], np.float32)


def _bordered(field: F32) -> F32:
    tall = np.concatenate([field[:1], field, field[-1:]], axis=0)
    return np.ascontiguousarray(np.concatenate([tall[:, -1:], tall, tall[:, :1]], axis=1), np.float32)


__all__ = ["Joint", "Look", "Strip", "closed_path", "join"]
