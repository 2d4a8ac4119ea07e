"""A bracket becomes light: every pixel a weighted mean of its exposures, weighted by what noise leaves.

The weight of an exposure is the inverse variance of the light it shows, from the camera's noise (Hasinoff,
Durand and Freeman 2010, equation 6); it is looked up at the mean of the neighbours' numbers, so that a pixel
that is dark by chance does not get the weight of a dark one. A pixel clipped in one channel counts in none.
Where all exposures are clipped the light is at least the darkest one's: no black suns.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from studio_core.capturing.artifacts import Bracket, Exposures, LensLight, Mask, Motion, Response
from studio_core.colour import LUMINANCE
from studio_core.imaging.ghosts import Look as Reduced
from studio_core.imaging.ghosts import left_out, reduced
from studio_core.imaging.numbers import Look, Numbers
from studio_core.imaging.photograph import in_rec709
from studio_core.imaging.projection import Circle, Lens
from studio_core.imaging.warping import warp
from studio_core.parallel import Workers
from studio_core.shading.job import Job

F32 = npt.NDArray[np.float32]
_Placed = tuple[npt.NDArray[Any], npt.NDArray[Any], Mask, Mask, Mask]
_LUMINANCE = np.array(LUMINANCE, np.float32)
_BAND = 1 << 18  # pixels worked on at a time
_UNRESOLVED = 0.5  # relative noise from which a pixel counts as too dark
_ASTRAY = 1e-3  # weight of a frame that could not be aligned: it tells what no other shows


@dataclass(frozen=True, eq=False)
class _Frame:
    """One exposure under way. `light` and `weight` of numbers; dropped: share left out, reduced; trust:
    what its weight is multiplied by."""

    pixels: npt.NDArray[Any]
    clipped: npt.NDArray[np.uint8]
    near: npt.NDArray[np.uint8]
    motion: Motion
    light: Look
    weight: Look
    dropped: F32 | None
    trust: float


def merge(
    bracket: Bracket,
    motions: Sequence[Motion],
    response: Response,
    exposures: Exposures,
    job: Job | None = None,
    *,
    ghosts: bool = True,
    circle: Circle | None = None,
    lens: Lens | None = None,
    workers: Workers | None = None,
) -> LensLight:
    """Linear Rec.709 light (H, W, 3) as the shot that does not move shows it; 1 is EV 0's middle number.

    `motions` of the shots, in their order; `circle` and `lens` where they turn in space. `ghosts`: leave
    out, place by place, exposures that disagree with the best exposed one. Any order of the shots gives the
    same light.
    """
    job = job or Job("merge")
    numbers = Numbers(response)
    order = _order(exposures, bracket)
    gains = [_gain(exposures, i) for i in order]
    pictures = [bracket.shots[i].pixels for i in order]
    moves = [motions[i] for i in order]
    clips = [numbers.clipped(picture) for picture in pictures]
    height, width = pictures[0].shape[:2]
    dropped: list[F32 | None] = [None] * len(order)
    notes: tuple[str, ...] = ()
    job.checkpoint(1, 10)
    if ghosts and len(order) > 1:
        looks = [
            reduced(picture, clip, move, gain, numbers, circle, lens)
            for picture, clip, move, gain in zip(pictures, clips, moves, gains, strict=True)
        ]
        dropped, notes = _left_out(looks, [bracket.shots[i].facts.name for i in order])
    job.checkpoint(3, 10)
    frames = [
        _Frame(
            picture,
            clip,
            _grown(clip) if k else clip,
            move,
            *numbers.weighing(picture.dtype, gain),
            drop,
            1.0 if move.trusted else _ASTRAY,
        )
        for k, (picture, clip, move, gain, drop) in enumerate(
            zip(pictures, clips, moves, gains, dropped, strict=True)
        )
    ]
    light = np.zeros((height, width, 3), np.float32)
    noise = np.ones((height, width), np.float32)
    masks = np.zeros((3, height, width), np.bool_)
    rows = max(8, _BAND // width)

    def band(first: int, last: int) -> None:
        parts = _band(frames, (first, last), circle, lens)
        light[first:last] = in_rec709(parts[0], bracket.shots[0].colour)
        noise[first:last], masks[:, first:last] = parts[1:]

    if workers is None:
        for first in range(0, height, rows):
            job.checkpoint(30 + 70 * first // height, 100)
            band(first, min(first + rows, height))
    else:
        workers.run(height, rows, band, _Share(job, height))
    job.checkpoint(10, 10)
    return LensLight(
        light, masks[0], masks[1], masks[2], noise, tuple(motions), exposures, notes
    )  # fmt: skip


class _Share:
    """The last part of a job's progress."""

    def __init__(self, job: Job, count: int) -> None:
        self._job, self._count = job, count

    def checkpoint(self, done: int, total: int) -> None:
        """Rows that are done, of all."""
        self._job.checkpoint(30 + 70 * done // max(total, 1), 100)


def _order(exposures: Exposures, bracket: Bracket) -> list[int]:
    """Dark to bright; equal ones by what they are, so that the order of the files does not matter."""
    return sorted(range(len(bracket.shots)), key=lambda i: (exposures.solved[i], bracket.shots[i].digest, i))


def _gain(exposures: Exposures, shot: int) -> F32:
    tint = np.asarray(exposures.tints[shot] if exposures.tints else (0.0, 0.0, 0.0))
    return np.exp2(-(exposures.solved[shot] + tint)).astype(np.float32)


def _grown(clip: npt.NDArray[np.uint8]) -> npt.NDArray[np.uint8]:
    """Clipped pixels and their neighbours, whose numbers compression and resampling mix with them."""
    import cv2

    return np.asarray(cv2.dilate(clip, np.ones((3, 3), np.uint8)), np.uint8)


def _left_out(looks: Sequence[Reduced], names: Sequence[str]) -> tuple[list[F32 | None], tuple[str, ...]]:
    dropped, shares = left_out(looks)
    notes = tuple(
        f"{name} disagrees with the other exposures nearly everywhere: it may not have been aligned, or the "
        "light changed."
        for name, share in zip(names, shares, strict=True)
        if share > 0.4
    )
    return dropped, notes


def _band(
    frames: Sequence[_Frame], rows: tuple[int, int], circle: Circle | None, lens: Lens | None
) -> tuple[F32, F32, Mask]:
    """Light, relative noise, and the masks clipped, dark, moved of some rows. `frames`: dark to bright."""
    first, last = rows
    height, width = frames[0].pixels.shape[:2]
    shape = (last - first, width, 3)
    total, weights = np.zeros(shape, np.float32), np.zeros(shape, np.float32)
    moved = np.zeros(shape[:2], np.bool_)
    looks = [_placed(frame, rows, circle, lens) for frame in frames]
    for frame, (pixels, around, known, _, near) in zip(frames, looks, strict=True):
        usable = (known & ~near).astype(np.float32)
        if frame.dropped is not None:
            drop = _enlarged(frame.dropped, (height, width), rows)
            moved |= (drop > 0.5) & (usable > 0)
            usable *= 1 - drop
        weight = frame.weight(around)
        weight *= (usable * np.float32(frame.trust))[..., None]
        weights += weight
        weight *= frame.light(pixels)
        total += weight
    resolved = weights[..., 1] > 0
    np.maximum(weights, np.float32(1e-30), out=weights)
    light = np.divide(total, weights, out=total)
    clipped = np.zeros(shape[:2], np.bool_)
    if not resolved.all():
        here = np.nonzero(~resolved)
        light[here], clipped[here] = _unresolved(frames, looks, here)
    level = light @ _LUMINANCE
    spread = np.reciprocal(weights, out=weights) @ _LUMINANCE**2
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        noise = np.where(resolved & (level > 0), np.sqrt(spread) / level, np.float32(1))
    noise = np.minimum(noise, np.float32(1))
    return light, noise, np.stack([clipped, ~clipped & (noise >= _UNRESOLVED), moved])


def _unresolved(
    frames: Sequence[_Frame], looks: Sequence[_Placed], here: tuple[npt.NDArray[Any], ...]
) -> tuple[F32, Mask]:
    """Light of pixels that no exposure resolves: at least that at which any of them was clipped."""
    bound = np.zeros((len(here[0]), 3), np.float32)
    darkest = np.zeros_like(bound)
    unseen = np.ones(len(bound), np.bool_)
    for frame, (pixels, _, known, clip, _) in zip(frames, looks, strict=True):
        light = frame.light(pixels[here][None])[0]
        seen = known[here]
        bound = np.where((clip[here] & seen)[:, None], np.maximum(bound, light), bound)
        darkest = np.where((unseen & seen)[:, None], light, darkest)
        unseen &= ~seen
    clipped = bound.max(axis=1) > 0
    return np.where(clipped[:, None], np.maximum(bound, darkest), darkest), clipped


def _placed(frame: _Frame, rows: tuple[int, int], circle: Circle | None, lens: Lens | None) -> _Placed:
    """Numbers, their neighbours' means, what is known, clipped, and near to clipped, where it belongs."""
    import cv2

    first, last = rows
    height = frame.pixels.shape[0]
    above, below = min(1, first), min(1, height - last)
    reach = (first - above, last + below)
    pixels, known = warp(frame.pixels, frame.motion, circle, lens, reach)
    around = cv2.blur(pixels, (3, 3))
    masks = np.stack([frame.clipped, frame.near], axis=-1)[slice(*reach)] if _still(frame.motion) else None
    if masks is None:
        masks, _ = warp(np.stack([frame.clipped, frame.near], axis=-1), frame.motion, circle, lens, reach)
    inner = slice(above, above + last - first)
    return pixels[inner], around[inner], known[inner], masks[inner, :, 0] > 0, masks[inner, :, 1] > 0


def _still(motion: Motion) -> bool:
    return not (motion.dx or motion.dy or motion.degrees or any(motion.rotation))


def _enlarged(share: F32, size: tuple[int, int], rows: tuple[int, int]) -> F32:
    """Rows of a reduced map in full size, without steps between its cells."""
    import cv2

    height, width = size
    first, last = rows
    y = (np.arange(first, last, dtype=np.float32) + 0.5) * (share.shape[0] / height) - 0.5
    x = (np.arange(width, dtype=np.float32) + 0.5) * (share.shape[1] / width) - 0.5
    at_x, at_y = np.meshgrid(x, y)
    made = cv2.remap(share, at_x, at_y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    return np.asarray(made, np.float32)
