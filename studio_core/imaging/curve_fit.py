"""Response curve and true exposures in one robust least-squares solve (Debevec and Malik 1997, equation 3).

What differs from the paper: exposures are unknown too, with the listed steps as a prior; the curve is a
rising cubic spline; places whose exposures disagree (something moved) lose weight; the light of each place
is eliminated; everything is solved by QR. An exponent can be moved between curve and exposures without any
trace in the pictures (Grossberg and Nayar 2003): only the listed steps decide about it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from studio_core.imaging.curve_spline import KNOTS, basis, knot_logs, ordinary_shapes, usual_scale
from studio_core.imaging.exposure_check import shared_scale

F64 = npt.NDArray[np.float64]
STEP_SPREAD = 0.3
"""EV, of listed steps around the true ones."""
TINT_SPREAD = 0.05
"""EV, of red and blue against green from one exposure to the next."""
FEWEST = 8
"""Places that at least have to be seen in two exposures."""
_FLOOR = 0.01  # log2, what no noise explains
_BEND = 0.08  # spread of what ordinary shapes leave of the change in contrast from knot to knot
_SHAPES = 5.0  # spread of how much of each
_LEAST = 0.15  # contrast
_ROUNDS = 12
_SETTLED = 1e-3  # log2
_DARK = 0.3  # numbers under which what compression adds shows


@dataclass(frozen=True, eq=False)
class Sample:
    """What one bracket shows of T places in F exposures.

    number (F, T, 3): 0 … 1 between black and white; spread (F, T, 3): its standard deviation; fair
    (F, T, 3); listed (F,) EV, dark to bright; certain (F,).
    """

    number: F64
    spread: F64
    fair: npt.NDArray[np.bool_]
    listed: F64
    certain: npt.NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Fit:
    """curve (3, KNOTS) spline coefficients or None; evs and tints (F,), (F, 3) by bracket; rms log2.

    extra (3,): standard deviation of numbers between exposures beyond that inside a tile.
    """

    curve: F64 | None
    evs: tuple[F64, ...]
    tints: tuple[F64, ...]
    rms: float
    extra: F64


def fit(
    samples: Sequence[Sample], known_curve: npt.NDArray[np.float64] | None = None, exposures: bool = True
) -> Fit:
    """Solve for the curve (unless it is known: (3, N) log2 exposures at numbers 0 … 1) and for exposures.

    Without `exposures` those listed are taken as they are. Scale and origin of the curve are as the listed
    exposures have them; brackets without a common place keep their listed level in the median.
    """
    system = _System(samples, known_curve, exposures)
    x = system.solve(np.full(len(system.offset), 1 / 0.05**2), np.ones(len(system.prior)))
    for _ in range(_ROUNDS):
        system.rescale(x)
        spread = system.spread(x)
        rest = system.rest(x, spread)
        system.learn_noise(rest)
        spread = system.spread(x)
        scale = max(1.4826 * float(np.median(np.abs(rest / spread))) if len(rest) else 1.0, 0.3)
        weight = 5 / (4 + (rest / (spread * scale)) ** 2) / spread**2
        off = system.prior_rest(x)
        before, x = x, system.solve(weight, 2 / (1 + off**2))
        if np.abs(x - before)[: system.first_shape].max() < _SETTLED:
            break
    spread = system.spread(x)
    rest = system.rest(x, spread)
    usual = np.abs(rest) < 4 * spread + 0.1
    rms = float(np.sqrt(np.mean(rest[usual] ** 2))) if usual.any() else 0.0
    return system.result(x, rms)


def linked(s: Sample) -> npt.NDArray[np.bool_]:
    """(F − 1,) whether enough places are seen in an exposure and in the next to tell them apart."""
    both = s.fair[1:] & s.fair[:-1]
    return np.asarray(both.sum(axis=(1, 2)) >= 3 * FEWEST, np.bool_)


def _rough_step(s: Sample, k: int) -> float:
    """EV between exposures k and k + 1 as an ordinary curve would have it."""
    both = s.fair[k] & s.fair[k + 1]
    return 2.2 * float(np.median(np.log2(s.number[k + 1][both] / s.number[k][both])))


class _System:
    """Rows of the least-squares problem; columns: the curves' first value and rises, EVs, tints, shapes."""

    def __init__(self, samples: Sequence[Sample], known_curve: F64 | None, exposures: bool) -> None:
        self.samples, self.known = samples, known_curve
        self.curves = 0 if known_curve is not None else 3 * KNOTS
        counts = [len(s.listed) for s in samples]
        self.first_ev = self.curves + np.concatenate([[0], np.cumsum(counts)]).astype(np.int64)
        self.first_tint = int(self.first_ev[-1])
        self.first_shape = self.first_tint + 2 * sum(counts)
        self.shapes = ordinary_shapes() if self.curves else np.zeros((0, KNOTS))
        self.columns = self.first_shape + 3 * len(self.shapes)
        self.fixed: dict[int, float] = {}
        if not exposures:
            listed = np.concatenate([s.listed for s in samples])
            self.fixed = {self.curves + i: float(ev) for i, ev in enumerate(listed)}
        self._rows()
        self._penalties()
        self._priors()
        self.extra = np.zeros(3)
        self.pins: list[tuple[F64, float]] = []
        if known_curve is None and exposures:
            self._pin()

    def _pin(self) -> None:
        """Smaller steps always fit better: how far exposures are apart in all is held, not fitted.

        The sum along · unknowns, along a first guess, so that no listed step alone decides. The same sum of
        the tints is 0: another exponent in red is red's curve, not its white balance.
        """
        guess = np.zeros(self.first_tint - self.curves)
        value = 0.0
        for first, s in zip(self.first_ev[:-1] - self.curves, self.samples, strict=True):
            seen = (s.fair[1:] & s.fair[:-1]).sum(axis=(1, 2))
            for k in np.flatnonzero(linked(s)):
                step = _rough_step(s, int(k))
                # by how much is seen of it: else a dark exposure runs away, and the others come together
                weight = float(seen[k] / seen.max())
                guess[first + k] -= weight * step
                guess[first + k + 1] += weight * step
                value += weight * step**2
        if not value > 0:
            return
        columns = [slice(self.curves, self.first_tint)]
        columns += [slice(self.first_tint + k, self.first_shape, 2) for k in (0, 1)]
        for place, held in zip(columns, (value, 0.0, 0.0), strict=True):
            along = np.zeros(self.columns)
            along[place] = guess
            self.pins.append((along, held))

    def rescale(self, x: F64) -> None:
        """Hold exposures as far apart as these unknowns and the listed steps together say."""
        if self.pins:
            evs = [x[a:b] for a, b in zip(self.first_ev[:-1], self.first_ev[1:], strict=True)]
            scale = shared_scale(
                evs,
                [s.listed for s in self.samples],
                [s.certain for s in self.samples],
                [linked(s) for s in self.samples],
                usual_scale(np.cumsum(x[: self.curves].reshape(3, KNOTS), axis=1)),
            )
            self.pins[0] = (self.pins[0][0], self.pins[0][1] * (scale or 1.0))

    def _rows(self) -> None:
        """log2 exposure − EV − tint = log2 light of the place, one unknown light a group."""
        parts: list[tuple[npt.NDArray[np.int64], ...]] = []
        numbers, spreads = [], []
        groups = 0
        frames = 0
        for bracket, s in enumerate(self.samples):
            frame, where, channel = np.nonzero(s.fair)
            group = groups + where * 3 + channel
            groups += s.number.shape[1] * 3
            parts.append((np.full(len(frame), bracket), frame + frames, channel, group))
            numbers.append(s.number[frame, where, channel])
            spreads.append(s.spread[frame, where, channel])
            frames += len(s.listed)
        _, frame, channel, group = (np.concatenate(p) for p in zip(*parts, strict=True))
        number, spread = np.concatenate(numbers), np.concatenate(spreads)
        shared = np.bincount(group, minlength=groups)[group] > 1
        frame, channel, number, self.noise = frame[shared], channel[shared], number[shared], spread[shared]
        _, self.group = np.unique(group[shared], return_inverse=True)
        self.number, self.channel = number, channel
        rows = np.zeros((len(number), self.columns))
        self.offset = np.zeros(len(number))
        index = np.arange(len(number))
        if self.known is None:
            rises = np.cumsum(basis(number)[:, ::-1], axis=1)[:, ::-1]  # coefficients are sums of rises
            for c in range(3):
                here = channel == c
                rows[here, c * KNOTS : (c + 1) * KNOTS] = rises[here]
        else:
            at = np.linspace(0, 1, self.known.shape[1])
            for c in range(3):
                here = channel == c
                self.offset[here] = -np.interp(number[here], at, self.known[c])
        rows[index, self.curves + frame] = -1.0
        tinted = channel != 1
        rows[index[tinted], self.first_tint + 2 * frame[tinted] + channel[tinted] // 2] = -1.0
        self.rows = rows

    def _penalties(self) -> None:
        """Always the same rows: little bends, channels alike, free sums set to 0."""
        rows: list[npt.NDArray[np.float64]] = []
        if self.known is None:
            rise = np.diff(knot_logs())
            self.least = _LEAST * rise
            bend = np.zeros((KNOTS - 2, KNOTS))
            for k in range(KNOTS - 2):
                bend[k, k + 1], bend[k, k + 2] = -1 / rise[k], 1 / rise[k + 1]
            unusual = bend @ np.diff(self.shapes, axis=1, prepend=0.0).T
            for c in range(3):
                bends = np.zeros((KNOTS - 2, self.columns))
                bends[:, c * KNOTS : (c + 1) * KNOTS] = bend
                first = self.first_shape + c * len(self.shapes)
                bends[:, first : first + len(self.shapes)] = -unusual
                rows.extend(bends / _BEND)
                row: F64 = np.zeros(self.columns)
                row[c * KNOTS : (c + 1) * KNOTS] = np.cumsum(basis(0.5)[::-1])[::-1]
                rows.append(row)
                if c != 1:
                    for k in range(1, KNOTS):
                        row = np.zeros(self.columns)
                        row[c * KNOTS + k], row[KNOTS + k] = 1 / rise[k - 1], -1 / rise[k - 1]
                        rows.append(row)  # spread 1 between the contrasts of channels
        for first, last in zip(self.first_ev[:-1], self.first_ev[1:], strict=True):
            row = np.zeros(self.columns)
            row[first:last] = 1.0
            rows.append(row)
        tints = np.eye(self.columns)[self.first_tint : self.first_shape] / TINT_SPREAD
        some = np.eye(self.columns)[self.first_shape :] / _SHAPES  # so that all is determined
        self.always = np.concatenate([np.stack(rows), tints, some])

    def _priors(self) -> None:
        rows, wanted = [np.zeros((0, self.columns))], []
        for first, s in zip(self.first_ev[:-1], self.samples, strict=True):
            for k in range(len(s.listed) - 1):
                row = np.zeros((1, self.columns))
                sure = s.certain[k] and s.certain[k + 1]
                row[0, first + k], row[0, first + k + 1] = -1.0, 1.0
                rows.append(row / (STEP_SPREAD if sure else 4 * STEP_SPREAD))
                wanted.append((s.listed[k + 1] - s.listed[k]) / (STEP_SPREAD if sure else 4 * STEP_SPREAD))
        self.prior, self.wanted = np.concatenate(rows), np.array(wanted)

    def solve(self, weight: F64, prior_weight: F64) -> F64:
        """Unknowns for these weights of the observations and of the listed steps."""
        lean, target = self._without_light(weight)
        root = np.sqrt(prior_weight)
        matrix = np.concatenate([lean, self.always, root[:, None] * self.prior])
        right = np.concatenate([target, np.zeros(len(self.always)), root * self.wanted])
        x = np.zeros(self.columns)
        fixed = dict(self.fixed)
        whole = np.concatenate([matrix, right[:, None]], axis=1)
        triangle = np.asarray(np.linalg.qr(whole, mode="r"), np.float64)
        for along, value in self.pins:  # the pivot is what the others leave of the held sum
            pivot = int(np.argmax(np.abs(along)))
            column = triangle[:, pivot].copy()
            triangle[:, -1] -= column * (value / along[pivot])
            triangle[:, :-1] -= column[:, None] * (along / along[pivot])
            fixed[pivot] = 0.0
        for _ in range(8):
            free = np.setdiff1d(np.arange(self.columns), list(fixed))
            for at, value in fixed.items():
                x[at] = value
            left = triangle[:, -1] - triangle[:, list(fixed)] @ np.array(list(fixed.values()))
            x[free] = np.linalg.lstsq(triangle[:, free], left, rcond=None)[0]
            if self.known is not None:
                break
            fell = False
            for c in range(3):
                rises = x[c * KNOTS + 1 : (c + 1) * KNOTS]
                for k in np.flatnonzero(rises < self.least - 1e-12):
                    fixed[c * KNOTS + 1 + int(k)] = float(self.least[k])
                    fell = True
            if not fell:
                break
        for along, value in self.pins:
            pivot = int(np.argmax(np.abs(along)))
            x[pivot] = (value - along @ x) / along[pivot]
        if self.known is None:
            for c in range(3):
                part = slice(c * KNOTS + 1, (c + 1) * KNOTS)
                x[part] = np.maximum(x[part], self.least)
        return x

    def _without_light(self, weight: F64) -> tuple[F64, F64]:
        """Rows and right-hand side after each place's own light has been eliminated."""
        groups = int(self.group.max(initial=-1)) + 1
        total = np.bincount(self.group, weight, groups)
        order = np.argsort(self.group, kind="stable")
        starts = np.searchsorted(self.group[order], np.arange(groups))
        both = np.concatenate([self.rows, self.offset[:, None]], axis=1)
        if groups:
            sums = np.add.reduceat((weight[:, None] * both)[order], starts, axis=0)
            both = both - (sums / total[:, None])[self.group]
        both *= np.sqrt(weight)[:, None]
        return both[:, :-1], both[:, -1]

    def spread(self, x: F64) -> F64:
        """Standard deviation of each observation, log2 exposure."""
        at, step = self.number, 2e-3
        low, high = np.maximum(at - step, 0), np.minimum(at + step, 1)
        slope = np.empty(len(at))
        for c in range(3):
            here = self.channel == c
            rise = self.smooth(x, c, high[here]) - self.smooth(x, c, low[here])
            slope[here] = rise / (high[here] - low[here])
        self.slope = slope
        square = slope**2 * (self.noise**2 + self.extra[self.channel] ** 2)
        return np.asarray(np.sqrt(square + _FLOOR**2), np.float64)

    def learn_noise(self, rest: F64) -> None:
        """What compression adds does not show inside a tile, but between exposures, in the dark."""
        for c in range(3):
            dark = (self.channel == c) & (self.number < _DARK)
            if np.count_nonzero(dark) < 30:
                continue
            off = 1.4826 * np.abs(rest[dark]) / self.slope[dark]
            # a place's light is fitted to its own exposures, which takes some of the difference away
            self.extra[c] = math.sqrt(max(float(np.median(off**2 * 1.5 - self.noise[dark] ** 2)), 0.0))

    def smooth(self, x: F64, channel: int, number: F64) -> F64:
        """The curve without its finer bends: weights that follow every bend make it bend more."""
        if self.known is not None:
            return self.curve(x, channel, number)
        at = np.linspace(0.01, 1, 100)
        shapes = basis(at) @ self.shapes.T
        part = np.linalg.lstsq(shapes, self.curve(x, channel, at), rcond=None)[0]
        return np.asarray(basis(number) @ (part @ self.shapes), np.float64)

    def curve(self, x: F64, channel: int, number: F64) -> F64:
        """log2 exposure of numbers of a channel."""
        if self.known is not None:
            at = np.linspace(0, 1, self.known.shape[1])
            return np.asarray(np.interp(number, at, self.known[channel]), np.float64)
        rises = x[channel * KNOTS : (channel + 1) * KNOTS]
        return np.asarray(basis(number) @ np.cumsum(rises), np.float64)

    def rest(self, x: F64, spread: F64) -> F64:
        """What each observation is off its place's light, log2."""
        value = self.rows @ x - self.offset
        groups = int(self.group.max(initial=-1)) + 1
        weight = 1 / spread**2
        light = np.bincount(self.group, weight * value, groups) / np.bincount(self.group, weight, groups)
        return np.asarray(value - light[self.group], np.float64)

    def prior_rest(self, x: F64) -> F64:
        """How far solved steps are from those listed, in spreads."""
        return np.asarray(self.prior @ x - self.wanted, np.float64)

    def result(self, x: F64, rms: float) -> Fit:
        """Unknowns by name."""
        evs = tuple(x[a:b].copy() for a, b in zip(self.first_ev[:-1], self.first_ev[1:], strict=True))
        tint = np.zeros((self.first_tint - self.curves, 3))
        tint[:, [0, 2]] = x[self.first_tint : self.first_shape].reshape(-1, 2)
        cuts = (self.first_ev - self.curves)[1:-1]
        curve = None if self.known is not None else np.cumsum(x[: self.curves].reshape(3, KNOTS), axis=1)
        return Fit(curve, evs, tuple(np.split(tint, cuts)), rms, self.extra)
