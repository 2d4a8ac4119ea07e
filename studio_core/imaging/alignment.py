"""Aligning hand-held exposures: how each frame of a bracket is moved against the reference.

Consecutive exposures are compared as local contrast of their logarithms (`local_contrast`), from small to
large sizes, by a robust second-order minimisation (Malis 2004) of the motion that makes them equal; the
maximum of their correlation is what enhanced correlation (Evangelidis and Psarakis 2008) looks for too.
Motions are chained to the reference. Where the correlation stays below 0.6, where the motion is too large
for a hand, or where a direction is not determined by the content, the frame counts as not moved and not
trusted: a featureless wall says nothing about motion.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from studio_core.capturing.artifacts import Motion
from studio_core.imaging.local_contrast import Level, normalised, sizes_of
from studio_core.imaging.projection import Circle, Lens
from studio_core.imaging.warping import degrees_of, source_points, turn, warp

__all__ = ["align_frames", "warp"]

F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]

LEAST_CORRELATION = 0.6
MOST_DEGREES = 9.0
MOST_SHIFT = 0.1  # of the longer side
MOST_DOUBT = 2e-3  # of the longer side: standard deviation of the worst direction's shift
_FINEST = 1000  # pixels across the finest size that is compared
_INSIDE = 0.95  # of the circle's radius: outside it the frame's reflections stay put
_ENOUGH = 200  # pixels that must have content in both
_ALIKE = 16.0  # neighbouring pixels that err alike


class Checkpoints(Protocol):
    """What aligning needs of a job."""

    def checkpoint(self, done: int = 0, total: int = 0, /) -> None:
        """Reports progress; raises `Cancelled` when the job was cancelled."""


@dataclass(frozen=True)
class _Place:
    """The part of the picture that is compared, in its own pixels, and what may move in it.

    Behind a fisheye: a turn in space about x, y and z (degrees), then a shift of the circle itself, as the
    stabiliser of a phone or a film scan makes it (pixels). Else: a shift and a turn about the middle.
    """

    size: tuple[int, int]
    circle: Circle | None
    lens: Lens | None

    @property
    def expected(self) -> F64:
        """Standard deviations of hands, before anything is seen."""
        if self.circle is None:
            far = 0.05 * max(self.size)
            return np.array([far, far, 2.0])
        loose = 0.004 * self.circle.radius
        return np.array([4.0, 4.0, 3.0, loose, loose])

    @property
    def starts(self) -> list[Motion]:
        """Where to look for a hand's motion that is too far for descending from rest."""
        if self.circle is not None:
            angles = (0.0, -6.0, -3.0, 3.0, 6.0)
            tried = [(x, y) for x in angles for y in angles]
            return [Motion(rotation=(x, y, 0.0)) for x, y in sorted(tried, key=lambda at: math.hypot(*at))]
        far = [0.03 * i * max(self.size) for i in range(-3, 4)]
        tried = [(x, y) for x in far for y in far]
        return [Motion(x, y) for x, y in sorted(tried, key=lambda at: math.hypot(*at))]

    def smaller(self, by: float) -> _Place:
        """The same, seen `by` times as small."""
        size = (round(self.size[0] / by), round(self.size[1] / by))
        return _Place(size, self.circle.scaled(1 / by) if self.circle else None, self.lens)

    def values(self, motion: Motion) -> F64:
        """What moves, as numbers."""
        if self.circle is None:
            return np.array([motion.dx, motion.dy, motion.degrees])
        return np.array([*motion.rotation, motion.dx, motion.dy])

    def after(self, motion: Motion, step: F64) -> Motion:
        """`motion` of what was moved by the small `step` before."""
        if self.circle is None:
            angle = math.radians(motion.degrees)
            c, s = math.cos(angle), math.sin(angle)
            dx, dy = motion.dx + c * step[0] - s * step[1], motion.dy + s * step[0] + c * step[1]
            return Motion(dx, dy, motion.degrees + step[2])
        turned = degrees_of(turn(motion.rotation) @ turn(step[:3]))
        return Motion(motion.dx + step[3], motion.dy + step[4], rotation=turned)

    def columns(self) -> F32:
        """(h, w, n, 2): how far a pixel moves for one unit of each number, about rest."""
        width, height = self.size
        flat = np.zeros((height, width, 2, 2), np.float32)
        flat[..., 0, 0] = flat[..., 1, 1] = 1
        x, y = np.meshgrid(
            np.arange(width, dtype=np.float32) + 0.5, np.arange(height, dtype=np.float32) + 0.5
        )
        if self.circle is None:
            about = np.stack([height / 2 - y, x - width / 2], axis=-1) * np.float32(math.pi / 180)
            return np.concatenate([flat, about[:, :, None]], axis=2, dtype=np.float32)
        here = np.stack([x, y], axis=-1)
        small = 0.01
        turns = [
            (source_points(Motion(rotation=axis), self.size, self.circle, self.lens) - here) / small
            for axis in ((small, 0.0, 0.0), (0.0, small, 0.0), (0.0, 0.0, small))
        ]
        return np.concatenate([np.stack(turns, axis=2), flat], axis=2).astype(np.float32)

    def inside(self) -> F32:
        """(h, w) 1 where pixels are compared."""
        width, height = self.size
        if self.circle is None:
            return np.ones((height, width), np.float32)
        x, y = np.arange(width) + 0.5 - self.circle.x, np.arange(height) + 0.5 - self.circle.y
        far = np.hypot(x[None, :], y[:, None])
        return (far < _INSIDE * self.circle.radius).astype(np.float32)


@dataclass(frozen=True)
class _Found:
    """A motion, how well the two agree there, and how far its least certain direction may be off, pixels."""

    motion: Motion
    correlation: float
    doubt: float


class _Fit:
    """One size of the comparison of a frame with what is known of the reference."""

    def __init__(self, place: _Place, columns: F32) -> None:
        self.place, self.columns = place, columns
        self.inside = place.inside()
        shift = columns[self.inside > 0]
        self.reach = np.einsum("nic,njc->ij", shift, shift, dtype=np.float64) / max(len(shift), 1)

    def improved(self, known: _Seen, frame: Level, motion: Motion, steps: int) -> _Found:
        """Descends from `motion`; the correlation is that of the last step's start."""
        prior = 1 / self.place.expected**2
        found = _Found(motion, 0.0, math.inf)
        for _ in range(steps):
            at = source_points(motion, self.place.size, self.place.circle, self.place.lens)
            first, second, both = self._compared(known, _sampled(frame, at))
            if np.count_nonzero(both) < _ENOUGH:
                return found
            correlation, information, pull = self._equations(first, second, both)
            wanted = information + np.diag(prior)
            step: F64 = np.linalg.solve(wanted, pull - prior * self.place.values(motion))
            worst = np.linalg.eigvals(np.linalg.solve(wanted, self.reach)).real.max()
            if correlation < found.correlation - 0.02:
                break
            found = _Found(motion, correlation, math.sqrt(max(worst, 0.0)))
            moved = math.sqrt(step @ self.reach @ step)
            if moved > 0.1 * max(self.place.size):
                break
            motion = self.place.after(motion, step)
            if moved < 0.01:
                return _Found(motion, correlation, found.doubt)
        return found if steps > 1 else _Found(motion, found.correlation, found.doubt)

    def _compared(self, known: _Seen, seen: _Seen) -> tuple[F32, F32, npt.NDArray[np.bool_]]:
        """Local contrast of both where both are valid."""
        import cv2

        valid = known.valid * seen.valid * self.inside
        first, sure = normalised(known.log, valid, known.noise)
        second, _ = normalised(seen.log, valid, seen.noise)
        both = cv2.erode(sure, np.ones((3, 3), np.uint8), borderValue=0) > 0
        return first, second, both

    def _equations(self, first: F32, second: F32, both: npt.NDArray[np.bool_]) -> tuple[float, F64, F64]:
        """Correlation, information (n, n) and its right side (n,) of a step that makes `second` `first`."""
        import cv2

        mean = (first + second) * np.float32(1 / 64)
        slope = np.stack([cv2.Scharr(mean, -1, 1, 0)[both], cv2.Scharr(mean, -1, 0, 1)[both]], axis=-1)
        a, b = first[both], second[both]
        difference = a - b
        spread = max(1.4826 * float(np.median(np.abs(difference))), 1e-3)
        weight = 1 / np.square(1 + np.square(difference / np.float32(2.5 * spread)))
        correlation = float((weight * a) @ b) / math.sqrt(
            max(float((weight * a) @ a) * float((weight * b) @ b), 1e-30)
        )
        lines = np.einsum("nic,nc->ni", self.columns[both], slope)
        scale = 1 / (_ALIKE * spread**2)
        weighted = lines * weight[:, None]
        information = (weighted.T @ lines).astype(np.float64) * scale
        pull = (weighted.T @ difference).astype(np.float64) * scale
        return correlation, information, pull


@dataclass(frozen=True, eq=False)
class _Seen:
    """A size of a frame as the reference would show it."""

    log: F32
    valid: F32
    noise: float


def _sampled(level: Level, at: F32) -> _Seen:
    import cv2

    x, y = at[..., 0] - np.float32(0.5), at[..., 1] - np.float32(0.5)
    log = cv2.remap(level.log, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    valid = cv2.remap(level.valid, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT)
    return _Seen(np.asarray(log, np.float32), (valid > 0.999).astype(np.float32), level.noise)


class _Bracket:
    """The frames of one bracket at all sizes, and the motions found so far."""

    def __init__(
        self, frames: Sequence[npt.NDArray[Any]], circle: Circle | None, lens: Lens | None, finest: int
    ) -> None:
        height, width = frames[0].shape[:2]
        box = (0, 0, width, height)
        if circle is not None:
            left, top = math.floor(circle.x - circle.radius), math.floor(circle.y - circle.radius)
            box = (left, top, math.ceil(circle.x + circle.radius), math.ceil(circle.y + circle.radius))
        self.whole, self.box = (width, height), box
        self.frames = [sizes_of(frame, box, finest) for frame in frames]
        first = self.frames[0]
        within = None if circle is None else Circle(circle.x - box[0], circle.y - box[1], circle.radius)
        size = (first.levels[0].size[0] * first.factor, first.levels[0].size[1] * first.factor)
        self.place = _Place(size, within, lens)
        self.fits: list[_Fit] = []
        for index, level in enumerate(first.levels):
            place = self.place.smaller(first.factor * 2**index)
            assert place.size == level.size
            self.fits.append(_Fit(place, place.columns()))

    def compare(self, index: int, other: int, motion: Motion) -> _Found:
        """How frame `index` is moved, from frame `other`, which is moved by `motion`."""
        frame, known = self.frames[index], self.frames[other]
        best = _Found(motion, 0.0, math.inf)
        trusted = 0.0
        for at in reversed(range(len(self.fits))):
            fit, by = self.fits[at], known.factor * 2**at
            points = source_points(_scaled(motion, 1 / by), fit.place.size, fit.place.circle, fit.place.lens)
            seen = _sampled(known.levels[at], points)
            level = frame.levels[at]
            if at == len(self.fits) - 1:
                best = self._begun(fit, seen, level, _scaled(motion, 1 / by))
            else:
                best = fit.improved(seen, level, _scaled(best.motion, 1 / by), 6 if at > 1 else 4)
            best = _Found(_scaled(best.motion, by), best.correlation, best.doubt * by)
            if min(fit.place.size) >= 150 or at == 0:
                trusted = max(trusted, best.correlation)
        return _Found(best.motion, trusted, best.doubt)

    def _begun(self, fit: _Fit, seen: _Seen, level: Level, motion: Motion) -> _Found:
        """The best start at the smallest size: at rest against the other frame, or all around."""
        best = fit.improved(seen, level, motion, 8)
        if best.correlation > 0.85:
            return best
        for start in fit.place.starts:
            tried = fit.improved(seen, level, fit.place.after(motion, fit.place.values(start)), 5)
            if tried.correlation > best.correlation + 0.01:
                best = tried
        return best

    def believed(self, found: _Found) -> bool:
        """Whether it is a hand's motion that the content determines."""
        longest = max(self.place.size)
        motion = found.motion
        return (
            math.hypot(motion.dx, motion.dy) <= MOST_SHIFT * longest
            and math.hypot(*motion.rotation, motion.degrees) <= MOST_DEGREES
            and found.correlation >= LEAST_CORRELATION
            and found.doubt <= MOST_DOUBT * longest
        )

    def in_whole(self, motion: Motion) -> Motion:
        """The motion about the picture's middle instead of the box's."""
        c, s = math.cos(math.radians(motion.degrees)), math.sin(math.radians(motion.degrees))
        x = self.box[0] + (self.place.size[0] - self.whole[0]) / 2
        y = self.box[1] + (self.place.size[1] - self.whole[1]) / 2
        return replace(motion, dx=motion.dx + x - c * x + s * y, dy=motion.dy + y - s * x - c * y)


def _scaled(motion: Motion, by: float) -> Motion:
    return Motion(motion.dx * by, motion.dy * by, motion.degrees, rotation=motion.rotation)


def align_frames(
    frames: Sequence[npt.NDArray[Any]],
    reference: int | None = None,
    circle: Circle | None = None,
    lens: Lens | None = None,
    job: Checkpoints | None = None,
    finest: int = _FINEST,
) -> tuple[Motion, ...]:
    """How every frame is moved against the reference (default: the middle one); that one's motion is 0.

    `frames`: (H, W, 3) bytes, 16 bit or float32 of one size, dark to bright. With a `circle` they are a
    fisheye's, and motions are turns in space through `lens` (default: an equidistant one of 190°) with a
    small shift of the circle; `warp` must then be given the same two. `finest`: pixels across the largest
    size that is compared. ValueError for frames of different sizes.
    """
    if not frames:
        return ()
    if any(frame.shape != frames[0].shape for frame in frames):
        raise ValueError("frames of one bracket have one size")
    middle = len(frames) // 2 if reference is None else reference
    if circle is not None and lens is None:
        lens = Lens()
    if len(frames) == 1:
        return (Motion(),)
    bracket = _Bracket(frames, circle, lens, finest)
    motions: dict[int, Motion] = {middle: Motion()}
    order = [*range(middle + 1, len(frames)), *range(middle - 1, -1, -1)]
    for done, index in enumerate(order):
        if job is not None:
            job.checkpoint(done, len(order))
        motions[index] = _against_trusted(bracket, index, motions)
    return tuple(bracket.in_whole(motions[index]) for index in range(len(frames)))


def _against_trusted(bracket: _Bracket, index: int, motions: dict[int, Motion]) -> Motion:
    """Compared with the nearest frames whose motion is known, until one of them answers."""
    known = sorted((i for i, m in motions.items() if m.trusted), key=lambda i: abs(i - index))
    best = 0.0
    for other in known[:3]:
        found = bracket.compare(index, other, motions[other])
        if bracket.believed(found):
            return replace(found.motion, correlation=found.correlation)
        best = max(best, found.correlation)
    return Motion(correlation=best, trusted=False)
