"""Aligning hand-held exposures: how each frame of a bracket is moved against the reference.

Consecutive exposures are compared as local contrast of their logarithms (`local_contrast`), from small to
large sizes, by descent to the motion that makes them alike (`frame_matching`): what enhanced correlation
(Evangelidis and Psarakis 2008) does, for turns of a lens in space too, and robust. Every frame is compared
with its neighbour as the reference would show it. Where the correlation is not surely above 0.6, where the
motion is too large for a hand, or where the content leaves a direction open, the frame counts as not moved
and not trusted: a featureless wall says nothing about motion.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from studio_core.capturing.artifacts import Motion
from studio_core.imaging.frame_matching import Fit, Found, Seen, sampled
from studio_core.imaging.hand_motion import Place, scaled
from studio_core.imaging.local_contrast import Level, sizes_of
from studio_core.imaging.projection import Circle, Lens
from studio_core.imaging.warping import source_points, warp

__all__ = ["align_frames", "warp"]

F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]

LEAST_CORRELATION = 0.6
MOST_DEGREES = 9.0
MOST_SHIFT = 0.1  # of the longer side
MOST_DOUBT = 2e-3  # of the longer side: standard deviation of the worst direction's shift
_FINEST = 1000  # pixels across the finest size that is compared
_WANDERED = 1.5  # pixels of the size that is believed, to where the finest ends
_LOOKED_AROUND = 150  # pixels across the largest size at which other starts are tried
_SEARCHED = 260  # pixels across the largest size that is seen with its clipped parts


class Checkpoints(Protocol):
    """What aligning needs of a job."""

    def checkpoint(self, done: int = 0, total: int = 0, /) -> None:
        """Reports progress; raises `Cancelled` when the job was cancelled."""


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
        self.place = Place(size, within, lens)
        self.fits: list[Fit] = []
        for index, level in enumerate(first.levels):
            place = self.place.smaller(first.factor * 2**index)
            assert place.size == level.size
            self.fits.append(Fit(place, place.columns()))

    def compare(self, index: int, other: int, motion: Motion) -> Found:
        """How frame `index` is moved, from frame `other`, which is moved by `motion`.

        Small sizes see what is clipped as flat, which keeps the outlines of windows; large ones leave it
        out, which is exact, unless too little else is there.
        """
        last = len(self.fits) - 1
        small = [at for at, fit in enumerate(self.fits) if max(fit.place.size) <= _SEARCHED or at == last]
        begun = Found(motion)
        for at in reversed(range(len(self.fits))):
            if at in small:
                begun = self._at(index, other, at, motion, begun, cut=True)
        exact = self._finer(index, other, min(small), motion, begun, cut=False)
        if exact.sure >= LEAST_CORRELATION or begun.sure < LEAST_CORRELATION:
            return exact
        return self._finer(index, other, min(small), motion, begun, cut=True)

    def _finer(self, index: int, other: int, start: int, motion: Motion, begun: Found, cut: bool) -> Found:
        """From size `start` to the finest. The finest may be noisier than the one before, which is believed
        then, but not when the finest led away from it."""
        factor = self.frames[0].factor
        best, most, pixel = begun, Found(motion), factor
        for at in reversed(range(start + 1)):
            best = self._at(index, other, at, motion, best, cut)
            if math.isinf(best.doubt):
                return best
            if best.sure > most.sure:
                most, pixel = best, factor * 2**at
        if self.fits[0].apart(most.motion, best.motion, factor) > _WANDERED * pixel:
            return replace(best, sure=min(best.sure, most.sure))
        return replace(best, correlation=most.correlation, sure=most.sure)

    def _at(self, index: int, other: int, at: int, motion: Motion, best: Found, cut: bool) -> Found:
        """One size: descends from the best so far, or looks around where there is none."""
        fit, by = self.fits[at], self.frames[0].factor * 2**at
        place, rest = fit.place, scaled(motion, 1 / by)
        seen = sampled(
            self.frames[other].levels[at], source_points(rest, place.size, place.circle, place.lens)
        )
        level = self.frames[index].levels[at]
        if math.isinf(best.doubt):
            found = self._begun(fit, seen, level, rest, cut)
        else:
            found = fit.improved(seen, level, scaled(best.motion, 1 / by), 6 if at > 1 else 4, cut)
        return replace(found, motion=scaled(found.motion, by), doubt=found.doubt * by)

    def _begun(self, fit: Fit, seen: Seen, level: Level, motion: Motion, cut: bool) -> Found:
        """The best start at the smallest size: at rest against the other frame, or all around."""
        best = fit.improved(seen, level, motion, 8, cut)
        if best.correlation > 0.85 or max(fit.place.size) > _LOOKED_AROUND:
            return best
        tried = [
            fit.improved(seen, level, fit.place.after(motion, fit.place.values(start)), 2, cut)
            for start in fit.place.starts
        ]
        for found in sorted(tried, key=lambda one: -one.sure)[:4]:
            best = max(best, fit.improved(seen, level, found.motion, 6, cut), key=lambda one: one.sure)
        return best

    def believed(self, found: Found) -> bool:
        """Whether it is a hand's motion that the content determines."""
        longest = max(self.place.size)
        motion = found.motion
        return (
            math.hypot(motion.dx, motion.dy) <= MOST_SHIFT * longest
            and math.hypot(*motion.rotation, motion.degrees) <= MOST_DEGREES
            and found.sure >= LEAST_CORRELATION
            and found.doubt <= MOST_DOUBT * longest
        )

    def in_whole(self, motion: Motion) -> Motion:
        """The motion about the picture's middle instead of the box's."""
        c, s = math.cos(math.radians(motion.degrees)), math.sin(math.radians(motion.degrees))
        x = self.box[0] + (self.place.size[0] - self.whole[0]) / 2
        y = self.box[1] + (self.place.size[1] - self.whole[1]) / 2
        return replace(motion, dx=motion.dx + x - c * x + s * y, dy=motion.dy + y - s * x - c * y)


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
    for other in known[:2]:
        found = bracket.compare(index, other, motions[other])
        if bracket.believed(found):
            return replace(found.motion, correlation=found.correlation)
        best = max(best, found.correlation)
    return Motion(correlation=best, trusted=False)
