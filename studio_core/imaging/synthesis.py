"""A large picture that tiles from a small sample: patches of it, joined along seams that do not show.

Patches are only shifted, never turned or scaled: what lives in the frame of the picture (bumps, grains)
stays right. Any number of maps is grown at once, since all that is found is which texel of the sample each
texel shows (`Grown.source`).

- On a torus, row by row, each patch overlaps what is there already. Where it is taken from is searched over
  the whole sample by the squared difference in the overlap (FFT), at random among what is nearly best; what
  was used often costs more, and going on with a neighbour's patch is no better than the best of the others.
- Which texels of the overlap become the patch's is a minimum cut (`imaging.seams`; Kwatra et al. 2003).
- Then the worst seams are covered by further patches as long as that makes them cheaper.
- Within a texel or two of a seam the patches that meet there are mixed.
- A sample that repeats itself (a weave, bricks) says so by its autocorrelation; the size is then rounded to
  whole periods (`fitting_size`), so that it closes on itself.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from studio_core.errors import InputError
from studio_core.imaging.seams import Cutter
from studio_core.shading.job import Job

F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]
I64 = npt.NDArray[np.int64]
I32 = npt.NDArray[np.int32]
Bools = npt.NDArray[np.bool_]

FEATHER = 2
"""Texels around a seam in which patches are mixed; the sample's own rim that is not used."""
NEARLY = 0.1  # above the best: patches that are chosen among
USED = 0.25  # what a patch costs more for each time that its place was used more than on average
LEVEL = (
    0.1  # what a patch costs more that takes the mean of all further from the sample's, and less otherwise
)
PERIODIC, PROMINENT = 0.3, 0.2  # correlation with itself that a period has, and has more than shorter shifts
CHANNELS = 6  # principal components that are searched and cut by
SMALLEST = 24
LARGEST = 8192
_ROUND = 24  # patches over bad seams between two looks at all seams


@dataclass(frozen=True)
class Grown:
    """source (H, W, 2) int32: row and column of the sample that each texel shows; both directions repeat."""

    source: I32

    def seam_ratio(self, picture: npt.NDArray[np.generic], feather: int = FEATHER) -> float:
        """Steps across seams over the sample's own steps at the texels on both sides; 0: there is no seam."""
        made, values = self.of(picture, feather).astype(np.float64), picture.astype(np.float64)
        limit = np.array(picture.shape[:2]) - 1
        across, usual = 0.0, 0.0
        for at, axis, step in zip(self.seams(), (1, 0), ((0, 1), (1, 0)), strict=True):
            across += float(np.linalg.norm(np.roll(made, -1, axis) - made, axis=2)[at].sum())
            for source, sign in ((self.source[at], 1), (np.roll(self.source, -1, axis)[at], -1)):
                there = np.clip(source + np.multiply(sign, step), 0, limit)
                apart = values[there[:, 0], there[:, 1]] - values[source[:, 0], source[:, 1]]
                usual += float(np.linalg.norm(apart, axis=1).sum()) / 2
        return across / usual if usual > 0 else 0.0

    def seams(self) -> tuple[Bools, Bools]:
        """(H, W) each: whether something else begins to the right of a texel, and below it."""
        beside = np.roll(self.source, -1, axis=1) - self.source
        below = np.roll(self.source, -1, axis=0) - self.source
        return (beside != (0, 1)).any(axis=2), (below != (1, 0)).any(axis=2)

    def of(self, picture: npt.NDArray[np.generic], feather: int = FEATHER) -> npt.NDArray[np.generic]:
        """(H, W, C) a map (h, w, C) of the sample grown; near seams mixed from the patches that meet."""
        rows, columns = self.source[..., 0], self.source[..., 1]
        made = np.ascontiguousarray(picture[rows, columns])
        if feather < 1:
            return made
        near = _near(np.logical_or(*self.seams()), feather)
        at, across = np.nonzero(near)
        total = np.zeros((len(at), picture.shape[2]), np.float64)
        whole = 0.0
        height, width = near.shape
        for y in range(-feather, feather + 1):
            for x in range(-feather, feather + 1):
                weight = (feather + 1 - abs(y)) * (feather + 1 - abs(x))
                there = self.source[(at + y) % height, (across + x) % width] - (y, x)
                row = np.clip(there[:, 0], 0, picture.shape[0] - 1)
                column = np.clip(there[:, 1], 0, picture.shape[1] - 1)
                total += weight * picture[row, column].astype(np.float64)
                whole += weight
        mixed = total / whole
        made[at, across] = np.rint(mixed) if np.issubdtype(picture.dtype, np.integer) else mixed
        return made


def _near(marked: Bools, reach: int) -> Bools:
    made = marked.copy()
    for axis in (0, 1):
        once = made.copy()
        for step in range(-reach, reach + 1):
            made |= np.roll(once, step, axis=axis)
    return made


def principal(sample: F32) -> F32:
    """(h, w, K) at most CHANNELS channels that hold what differs in a sample (h, w, C), the mean at 0."""
    flat = sample.reshape(-1, sample.shape[2]).astype(np.float64)
    flat = flat - flat.mean(axis=0)
    if sample.shape[2] > 1:
        _, vectors = np.linalg.eigh(flat.T @ flat / len(flat))
        flat = flat @ vectors[:, ::-1][:, :CHANNELS]
    spread = float(np.sqrt((flat**2).sum(axis=1).mean()))
    return np.asarray((flat / max(spread, 1e-30)).reshape(*sample.shape[:2], -1), np.float32)


def periods(sample: F32) -> tuple[float, float]:
    """Texels (down, across) after which a sample (h, w, C) repeats itself along its sides; 0: it does not."""
    return _period(sample), _period(sample.transpose(1, 0, 2))


def _period(sample: F32) -> float:
    """Down the rows, by the correlation with itself: the first peak, then made finer by its multiples."""
    signal = principal(sample)
    height = len(signal)
    most = height * 2 // 3
    heard = np.ones(most + 1)
    for shift in range(1, most + 1):
        a, b = signal[shift:].astype(np.float64), signal[:-shift].astype(np.float64)
        heard[shift] = (a * b).sum() / max(np.sqrt((a * a).sum() * (b * b).sum()), 1e-30)
    inner = heard[1:-1]
    above = inner - np.minimum.accumulate(heard)[1:-1]
    alike = (inner > PERIODIC) & (above > PROMINENT)
    peaks = 1 + np.flatnonzero((inner >= heard[:-2]) & (inner >= heard[2:]) & alike)
    if not len(peaks):
        return 0.0
    best = float(heard[peaks].max())
    found = float(peaks[heard[peaks] > best - 0.1][0])
    multiple = 2
    while multiple * found < most:
        near = peaks[np.abs(peaks - multiple * found) <= max(0.06 * found, 1.5)]
        if not len(near):
            break
        found = float(near[np.argmax(heard[near])]) / multiple
        multiple += 1
    return found


def fitting_size(sample: F32, size: tuple[int, int]) -> tuple[int, int]:
    """(H, W) near `size` that a sample's own periods divide as well as whole texels can."""
    made = []
    for wanted, period, own in zip(size, periods(sample), sample.shape[:2], strict=True):
        if period <= 0 or wanted < 2 * period:
            made.append(wanted)
            continue
        around = max(round(wanted / period), 1)
        reach = max(round(own / period / 2), 1)
        counts = np.arange(max(around - reach, 1), around + reach + 1)
        off = np.abs(counts * period - np.rint(counts * period)) + 1e-3 * np.abs(counts - around)
        made.append(int(np.rint(counts[np.argmin(off)] * period)))
    return made[0], made[1]


def grow(
    sample: F32,
    size: tuple[int, int],
    *,
    patch: int = 0,
    seed: int = 0,
    mending: float = 1.0,
    job: Job | None = None,
) -> Grown:
    """Grow a sample (h, w, C), its channels of comparable weight, to size (H, W); see the module.

    `patch` is the side of a patch in texels (0: a third of the sample, at least one and a half of its
    periods); `mending` how many patches are laid over bad seams, of those that were laid at first. Raises
    InputError where the sample is too small or the size too large, Cancelled where the job was.
    """
    if min(sample.shape[:2]) < SMALLEST + 2 * FEATHER:
        raise InputError(f"a sample of {sample.shape[1]} × {sample.shape[0]} texels is too small to grow")
    if max(size) > LARGEST or min(size) < SMALLEST:
        raise InputError(f"a picture cannot be grown to {size[1]} × {size[0]} texels")
    if not np.isfinite(sample).all():
        raise InputError("a sample to grow must be finite")
    return _Growing(sample, size, patch, seed).run(mending, job)


class _Growing:
    def __init__(self, sample: F32, size: tuple[int, int], patch: int, seed: int) -> None:
        self.signal = principal(sample)
        self.height, self.width = self.signal.shape[:2]
        self.size = size
        inner = min(self.height, self.width) - 2 * FEATHER
        side = patch or max(inner // 3, round(1.5 * max(periods(sample))))
        self.side = int(np.clip(side, 8, min(inner * 2 // 3, *size)))
        self.random = np.random.default_rng(seed)
        self.source = np.zeros((*size, 2), np.int32)
        self.filled = np.zeros(size, np.bool_)
        self.cutter = Cutter(self.side)
        channels = self.signal.transpose(2, 0, 1)
        self.spectra = np.fft.rfft2(channels).astype(np.complex64)
        self.squares = np.fft.rfft2((self.signal**2).sum(axis=2)).astype(np.complex64)
        self.used = np.zeros(self._places(), np.float32)
        self.laid = 0
        self.means = self._means()
        self.usual = float((self.means**2).sum(axis=2).mean())
        self.off = np.zeros(self.signal.shape[2])  # sum of all that is there; the sample's mean is 0

    def _places(self) -> tuple[int, int]:
        """How many places a patch may be taken from, down and across."""
        return self.height - self.side - 2 * FEATHER + 1, self.width - self.side - 2 * FEATHER + 1

    def _means(self) -> F64:
        """(…, K) the mean of a patch from each place."""
        upto = np.pad(self.signal.astype(np.float64).cumsum(axis=0).cumsum(axis=1), ((1, 0), (1, 0), (0, 0)))
        s, f = self.side, FEATHER
        whole = upto[s:, s:] - upto[s:, :-s] - upto[:-s, s:] + upto[:-s, :-s]
        rows, columns = self._places()
        return np.asarray(whole[f : f + rows, f : f + columns] / s**2)

    def run(self, mending: float, job: Job | None) -> Grown:
        """Lay all patches, then mend."""
        step = self.side - max(self.side // 3, 4)
        counts = [-(-length // step) for length in self.size]
        starts = [(np.arange(n) * length) // n for n, length in zip(counts, self.size, strict=True)]
        places = [(int(y), int(x)) for y in starts[0] for x in starts[1]]
        mends = round(mending * len(places))
        for number, corner in enumerate(places):
            if job is not None:
                job.checkpoint(number, len(places) + mends)
            self._lay(corner)
        for number in range(0, mends, _ROUND):
            for corner in self._worst(min(_ROUND, mends - number)):
                if job is not None:
                    job.checkpoint(len(places) + number, len(places) + mends)
                self._mend(corner)
        return Grown(self.source)

    def _window(self, corner: tuple[int, int]) -> tuple[I64, I64]:
        steps = np.arange(self.side)
        return (corner[0] + steps)[:, None] % self.size[0], (corner[1] + steps)[None] % self.size[1]

    def _lay(self, corner: tuple[int, int]) -> None:
        """A patch over a square, part of which is there already."""
        window = self._window(corner)
        there, old = self.filled[window], self.source[window]
        place = self._chosen(old, there.astype(np.float32))
        rim = np.ones_like(there)
        rim[1:-1, 1:-1] = False
        taken = self._cut(old, place, rim & there, ~there) if there.any() else ~there
        self._take(window, taken, place)

    def _mend(self, corner: tuple[int, int]) -> None:
        """A patch over a square whose middle has bad seams, if that makes them cheaper."""
        window = self._window(corner)
        old = self.source[window]
        rim, core = np.ones((2, self.side, self.side), np.bool_)
        rim[1:-1, 1:-1] = False
        third = self.side // 3
        core[:] = False
        core[third:-third, third:-third] = True
        ring = np.ones((self.side, self.side), np.float32)
        ring[third:-third, third:-third] = 0.1
        place = self._chosen(old, ring)
        taken = self._cut(old, place, rim, core)
        new = np.where(taken[..., None], self._patch(place), old)
        if self._cost(new) < self._cost(old):
            self._take(window, taken, place)

    def _patch(self, place: tuple[int, int]) -> I32:
        """(S, S, 2) source of a patch from a place."""
        steps = np.arange(self.side, dtype=np.int32)
        rows, columns = np.meshgrid(place[0] + steps, place[1] + steps, indexing="ij")
        return np.stack([rows, columns], axis=2)

    def _take(self, window: tuple[I64, I64], taken: Bools, place: tuple[int, int]) -> None:
        rows, columns = (np.broadcast_to(part, taken.shape)[taken] for part in window)
        old = self.source[rows, columns][self.filled[rows, columns]]
        self.off -= self.signal[old[:, 0], old[:, 1]].sum(axis=0, dtype=np.float64)
        self.source[rows, columns] = new = self._patch(place)[taken]
        self.off += self.signal[new[:, 0], new[:, 1]].sum(axis=0, dtype=np.float64)
        self.filled[rows, columns] = True
        y, x = place[0] - FEATHER, place[1] - FEATHER
        reach = self.side / 3
        near_y = np.exp(-0.5 * ((np.arange(self.used.shape[0]) - y) / reach) ** 2)
        near_x = np.exp(-0.5 * ((np.arange(self.used.shape[1]) - x) / reach) ** 2)
        self.used += (near_y[:, None] * near_x[None]).astype(np.float32)
        self.laid += 1

    def _cut(self, old: I32, place: tuple[int, int], kept: Bools, taken: Bools) -> Bools:
        new = self.signal[place[0] : place[0] + self.side, place[1] : place[1] + self.side]
        apart = self.signal[old[..., 0], old[..., 1]] - new
        difference = np.sqrt((apart**2).sum(axis=2))
        if kept.any() and taken.any():
            difference[taken] = np.maximum(difference[taken], float(difference[~taken].max(initial=0)))
        return self.cutter(difference, kept, taken)

    def _chosen(self, old: I32, weight: F32) -> tuple[int, int]:
        """Row and column of the sample where a patch comes from that fits what is there, weighted (S, S)."""
        rows, columns = self._places()
        if not weight.any():
            return (
                FEATHER + int(self.random.integers(rows)),
                FEATHER + int(self.random.integers(columns)),
            )
        target = self.signal[old[..., 0], old[..., 1]] * weight[..., None]
        shape = (self.height, self.width)
        crossed = (np.conj(np.fft.rfft2(target.transpose(2, 0, 1), shape)) * self.spectra).sum(axis=0)
        own = np.conj(np.fft.rfft2(weight, shape)) * self.squares
        whole = float((target * self.signal[old[..., 0], old[..., 1]]).sum())
        apart = np.fft.irfft2(own - 2 * crossed, shape)[FEATHER : FEATHER + rows, FEATHER : FEATHER + columns]
        cost = np.maximum(apart + whole, 0) / float(weight.sum())
        self._no_better(cost, old, weight)
        cost = cost + 1e-3
        often = self.used / max(float(self.used.mean()), 1e-30) if self.laid else self.used
        cost *= 1 + USED * np.minimum(often, 8.0)
        if self.usual > 1e-12:
            farther = (self.means * (2 * self.off / self.side**2 + self.means)).sum(axis=2) / self.usual
            cost *= np.exp(LEVEL * np.clip(farther, -10, 10))
        good = np.flatnonzero(cost <= (1 + NEARLY) * cost.min())
        y, x = divmod(int(self.random.choice(good)), columns)
        return FEATHER + y, FEATHER + x

    def _no_better(self, cost: F64, old: I32, weight: F32) -> None:
        """Going on with what lies there costs at least as much as the best other place."""
        there = weight > 0
        steps = np.arange(self.side, dtype=np.int32)
        corner = (old - np.stack(np.meshgrid(steps, steps, indexing="ij"), axis=2))[there] - FEATHER
        code = np.unique(corner[:, 0] * 65536 + corner[:, 1])
        found = np.stack([(code + 32768) // 65536, (code + 32768) % 65536 - 32768], axis=1)
        goes_on = np.zeros(cost.shape, np.bool_)
        for y, x in found:
            goes_on[max(y - 2, 0) : max(y + 3, 0), max(x - 2, 0) : max(x + 3, 0)] = True
        if goes_on.any() and not goes_on.all():
            cost[goes_on] = np.maximum(cost[goes_on], cost[~goes_on].min())

    def _costs(self, source: I32) -> tuple[F32, F32]:
        """What the seams right of and below each texel of a part cost: how far both sides' patches differ."""
        made = []
        for axis, step in ((1, (0, 1)), (0, (1, 0))):
            one, other = (source[:, :-1], source[:, 1:]) if axis == 1 else (source[:-1], source[1:])
            cost = np.zeros(one.shape[:2], np.float32)
            at = (other - one != step).any(axis=2)
            a, b = one[at], other[at]
            first = self._at(a) - self._at(b - step)
            second = self._at(a + step) - self._at(b)
            cost[at] = np.sqrt((first**2).sum(axis=1)) + np.sqrt((second**2).sum(axis=1))
            made.append(cost)
        return made[0], made[1]

    def _at(self, place: I32) -> F32:
        rows = np.clip(place[:, 0], 0, self.height - 1)
        return self.signal[rows, np.clip(place[:, 1], 0, self.width - 1)]

    def _cost(self, source: I32) -> float:
        return float(sum(cost.sum(dtype=np.float64) for cost in self._costs(source)))

    def _worst(self, count: int) -> list[tuple[int, int]]:
        """Corners of squares about the worst seams, apart from each other."""
        from scipy.ndimage import uniform_filter

        wrapped = np.concatenate([self.source, self.source[:1]], axis=0)
        wrapped = np.concatenate([wrapped, wrapped[:, :1]], axis=1)
        beside, below = self._costs(wrapped)
        cost = beside[:-1] + below[:, :-1]
        third = max(self.side // 3, 1)
        cost = uniform_filter(cost, third, mode="wrap")
        made = []
        for _ in range(count):
            y, x = divmod(int(np.argmax(cost)), cost.shape[1])
            if cost[y, x] <= 0:
                break
            made.append((y - self.side // 2, x - self.side // 2))
            rows = np.arange(y - self.side // 2, y + self.side // 2 + 1) % cost.shape[0]
            columns = np.arange(x - self.side // 2, x + self.side // 2 + 1) % cost.shape[1]
            cost[np.ix_(rows, columns)] = 0
        return made


__all__ = ["FEATHER", "Grown", "fitting_size", "grow", "periods", "principal"]
