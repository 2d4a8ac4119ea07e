"""The motion that makes one size of two frames alike: a robust second-order descent (Malis 2004)."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from studio_core.capturing.artifacts import Motion
from studio_core.imaging.hand_motion import Place, scaled
from studio_core.imaging.local_contrast import WINDOW, Level, normalised
from studio_core.imaging.warping import source_points

F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]
Mask = npt.NDArray[np.bool_]

_ENOUGH = 200  # pixels that must have content in both
_ALIKE = 16.0  # neighbouring pixels that err alike
_PATCH = 64.0  # pixels of content that say one thing
_BRIGHT = math.log(0.4)  # of the full number: what is lost above is clipped, below black
_MOVED = 0.2  # of the content, which may differ
_CONTENT = 0.05  # of local contrast squared, from where on a pixel says something


@dataclass(frozen=True)
class Found:
    """A motion, how well the two agree there, and how far its least certain direction may be off, pixels.

    `sure`: what the correlation is at least, for the content that it was seen on (Fisher's bound).
    """

    motion: Motion
    correlation: float = 0.0
    doubt: float = math.inf
    sure: float = 0.0


class Fit:
    """One size of the comparison: `columns` are the place's; `reach` (n, n) turns a step of its numbers into
    the mean square of how far pixels move."""

    def __init__(self, place: Place, columns: F32) -> None:
        self.place, self.columns = place, columns
        self.inside = place.inside()
        shift = columns[self.inside > 0]
        self.reach = np.einsum("nic,njc->ij", shift, shift, dtype=np.float64) / max(len(shift), 1)

    def improved(self, known: Seen, frame: Level, motion: Motion, steps: int, cut: bool = False) -> Found:
        """Descends from `motion`; the correlation is that of the last step's start.

        With `cut`, what is clipped counts as flat in both; else only what is clipped in neither is compared.
        """
        prior = 1 / self.place.expected**2
        found = Found(motion)
        for _ in range(steps):
            at = source_points(motion, self.place.size, self.place.circle, self.place.lens)
            first, second, both = self._compared(known, sampled(frame, at), cut)
            if np.count_nonzero(both) < _ENOUGH:
                return found
            correlation = _correlation(first, second, both)
            information, certain, pull = self._equations(first, second, both)
            wanted = information + np.diag(prior)
            step = np.asarray(np.linalg.solve(wanted, pull - prior * self.place.values(motion)), np.float64)
            spreads = np.linalg.eigvals(np.linalg.solve(certain + np.diag(prior), self.reach)).real
            if correlation < found.correlation - 0.05:
                break
            patches = max(np.count_nonzero(both) / _PATCH, 3.5)
            sure = math.tanh(math.atanh(min(correlation, 0.9999)) - 2 / math.sqrt(patches - 3))
            found = Found(motion, correlation, math.sqrt(max(float(spreads.max()), 0.0)), sure)
            moved = math.sqrt(step @ self.reach @ step)
            if moved > 0.1 * max(self.place.size):
                break
            motion = self.place.after(motion, step)
            if moved < 0.01:
                return replace(found, motion=motion)
        return found

    def apart(self, first: Motion, second: Motion, by: float) -> float:
        """How far two motions of the whole size are apart over the picture, root mean square, pixels."""
        step = self.place.values(scaled(first, 1 / by)) - self.place.values(scaled(second, 1 / by))
        return float(math.sqrt(step @ self.reach @ step)) * by

    def _compared(self, known: Seen, seen: Seen, cut: bool) -> tuple[F32, F32, Mask]:
        """Local contrast of both, and where they may be compared and say something."""
        import cv2

        if cut:
            valid = known.kept * seen.kept * self.inside
            logs = _cut_alike(known, seen, valid) if valid.any() else (known.log, seen.log)
        else:
            valid, logs = known.valid * seen.valid * self.inside, (known.log, seen.log)
        first, sure = normalised(logs[0], valid, known.noise)
        second, _ = normalised(logs[1], valid, seen.noise)
        both = cv2.erode(sure, np.ones((3, 3), np.uint8), borderValue=0) > 0
        return first, second, both & (first * first + second * second > _CONTENT)

    def _equations(self, first: F32, second: F32, both: Mask) -> tuple[F64, F64, F64]:
        """Information (n, n) of a step that makes `second` `first`, what of it is content, the right side.

        Noise has slopes too, but other ones in each picture: the slopes' products of both have none of it.
        """
        columns, difference = self.columns[both], (first - second)[both]
        spread = max(1.4826 * float(np.median(np.abs(difference))), 1e-3)
        weight = 1 / np.square(1 + np.square(difference / np.float32(2.5 * spread)))
        lines, unlike = (
            np.einsum("nic,nc->ni", columns, _slopes(both_ways * np.float32(0.5), both))
            for both_ways in (first + second, first - second)
        )
        scale = 1 / (_ALIKE * spread**2)
        weighted = lines * weight[:, None]
        information = (weighted.T @ lines).astype(np.float64) * scale
        of_noise = ((unlike * weight[:, None]).T @ unlike).astype(np.float64) * scale
        values, vectors = np.linalg.eigh(information - of_noise)
        content = (vectors * np.maximum(values, 0)) @ vectors.T
        return information, content, (weighted.T @ difference).astype(np.float64) * scale


def _slopes(picture: F32, where: Mask) -> F32:
    """(n, 2) to the right and down."""
    import cv2

    right, down = cv2.Scharr(picture, -1, 1, 0)[where], cv2.Scharr(picture, -1, 0, 1)[where]
    return np.stack([right, down], axis=-1, dtype=np.float32) * np.float32(1 / 32)


def _correlation(first: F32, second: F32, both: Mask) -> float:
    """Of all that has content but the fifth of it, in windows, that agrees least: where somebody moved.

    The weights of the descent would not do: they leave out whatever does not fit, at a wrong place too.
    """
    import cv2

    a, b = first * both, second * both
    size = (max(both.shape[1] // WINDOW, 1), max(both.shape[0] // WINDOW, 1))
    aa, bb, ab = (cv2.resize(m, size, interpolation=cv2.INTER_AREA).ravel() for m in (a * a, b * b, a * b))
    energy = aa + bb
    order = np.argsort(-(ab / np.maximum(energy, 1e-12)))
    kept = order[np.cumsum(energy[order]) <= (1 - _MOVED) * energy.sum()]
    if not kept.size:
        return 0.0
    return float(ab[kept].sum() / math.sqrt(max(float(aa[kept].sum() * bb[kept].sum()), 1e-30)))


@dataclass(frozen=True, eq=False)
class Seen:
    """A size of a frame as the reference would show it; see `Level`."""

    log: F32
    valid: F32
    kept: F32
    noise: float


def sampled(level: Level, at: F32) -> Seen:
    """A level at the points (h, w, 2) of its own pixels."""
    import cv2

    x, y = at[..., 0] - np.float32(0.5), at[..., 1] - np.float32(0.5)
    log = cv2.remap(level.log, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    valid, kept = (
        (cv2.remap(a, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT) > 0.999).astype(np.float32)
        for a in (level.valid, level.kept)
    )
    return Seen(np.asarray(log, np.float32), valid, kept, level.noise)


def _cut_alike(first: Seen, second: Seen, where: F32) -> tuple[F32, F32]:
    """Both logarithms, cut at their tops and bottoms so that the same share of pixels is cut in both.

    What the longer exposure clips is then as flat in the shorter one, and its outline an edge in both.
    """
    some = where > 0
    share = max(int(np.count_nonzero(some)), 1)
    top = bottom = 0.0
    for seen in (first, second):
        lost, bright = some & (seen.valid == 0), seen.log > _BRIGHT
        top = max(top, int(np.count_nonzero(lost & bright)) / share)
        bottom = max(bottom, int(np.count_nonzero(lost & ~bright)) / share)
    at = [min(bottom, 0.99), max(1 - top, 0.01)]
    made = []
    for log in (first.log, second.log):
        low, high = (float(edge) for edge in np.quantile(log[some], at))
        made.append(np.asarray(np.clip(log, low, max(high, low)), np.float32))
    return made[0], made[1]
