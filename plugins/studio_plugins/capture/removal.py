"""Replacing reflections of the lens' frame by what is behind them: seamless cloning on the lens' ring.

The source is what the other lens shows there, moved through the registration and the shift of near things;
or a clean part of the same ring. Only pixels inside of the rectangles change.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from studio_core.capturing.artifacts import F32, F64, Mask, Reflections, Registration, View
from studio_core.capturing.looking import look
from studio_core.capturing.settings import BACK, FRONT, OTHER_LENS, RING, Patch
from studio_core.imaging.poisson import membrane
from studio_core.imaging.projection import unproject
from studio_core.shading.job import Job
from studio_plugins.capture.compare import EDGE, Comparison, compare, falloff_at, towards
from studio_plugins.capture.ring import angles, coarser, covers, directions

_FLOOR = 1e-4  # of the median light
_ODD = math.log(4.0)  # a border that is further off than this from the others is something else
_BRIGHTER, _FAR_MORE = 1.1, 4.0
_LAMP = 4.0  # degrees across, at most
_PENUMBRA = 1.5  # degrees of a rectangle's inner border that are taken as a source all the same
_COVERED = 0.4  # of a rectangle that the other lens has to see
_ACROSS, _ALONG = 0.5, 2.0  # degrees: steps of looking for a clean part of the ring
_SKEWED = 0.02  # of the radius: how far a picture's own shear moves a ring
_ROW, _FRAYED = 4096, 4
_FINEST = 2 * math.pi / 16384


def remove(
    views: Mapping[str, View],
    registration: Registration | None,
    patches: Sequence[Patch],
    job: Job,
) -> Reflections:
    """Light of all sides with the rectangles that are `used` replaced, in their order.

    Views hold light as photographed. The patches come back with the source that was really taken: a
    rectangle that the other lens does not see is filled from elsewhere on the ring, with a note; one
    without any clean source stays as it is.
    """
    lights = {side: view.light for side, view in views.items()}
    made, notes = [], []
    shifts: dict[str, Comparison | None] = {}
    for index, patch in enumerate(patches):
        job.checkpoint(index, len(patches))
        own = views.get(patch.side)
        if not patch.used or own is None:
            made.append(patch)
            continue
        area = _area(own, patch)
        if not len(area.pixels):
            made.append(patch)
            continue
        taken: _Source | None = None
        other = views.get(_opposite(patch.side))
        if (
            patch.source == OTHER_LENS
            and other is not None
            and registration is not None
            and registration.trusted
        ):
            if patch.side not in shifts:
                shifts[patch.side] = compare(own, other, registration, patch.side, job)
            avoided = [
                replace(p, inner=p.inner + _PENUMBRA) for p in patches if p.side != patch.side and p.used
            ]
            taken = _from_other(own, other, registration, area, patch, avoided, shifts[patch.side])
        if taken is None:
            if patch.source == OTHER_LENS:
                start = clean_azimuth(own, patch, patches)
                if start is None:
                    notes.append(_named(patch, "has no clean part of the ring to replace it"))
                    made.append(patch)
                    continue
                if other is not None:
                    notes.append(_named(patch, "is not seen by the other lens; it is filled from the ring"))
                patch = replace(patch, source=RING, source_azimuth=start)
            taken = _from_ring(own, area, patch)
        lights[patch.side] = _filled(replace(own, light=lights[patch.side]), area, taken)
        made.append(patch)
    job.checkpoint(len(patches), len(patches))
    return Reflections(tuple(made), lights, tuple(notes))


def clean_azimuth(own: View, patch: Patch, patches: Sequence[Patch]) -> float | None:
    """Degrees where the rectangle of the same size begins that is free of reflections and fits best.

    What fits: light around it differs from that around the patch by the same factor everywhere.
    """
    small = coarser(own, math.degrees(own.lens.half) / _ACROSS)
    count = round(360 / _ALONG)
    azimuth = np.radians((np.arange(count) + 0.5) * _ALONG)
    outer = min(patch.outer, math.degrees(own.lens.half))
    rows = max(2, round((outer - patch.inner) / _ACROSS) + 1)
    theta = np.radians(np.linspace(patch.inner - _ACROSS, outer, rows))
    light, seen = look(small, directions(azimuth[None, :], theta[:, None]))
    told = seen.mean(axis=1) > 0.98
    if not told.any():
        return None
    light, seen, theta = light[told], seen[told], theta[told]
    tone = _log(light, _floor(own))
    taken = [p for p in patches if p.side == patch.side and p.used]
    grid = np.broadcast_arrays(azimuth[None, :], theta[:, None])
    free = seen & ~np.any([covers(p, *grid) for p in (*taken, patch)], axis=0)
    width = math.ceil(patch.width / _ALONG) + 2
    first = round(patch.azimuth / _ALONG) - 1
    if width >= count:
        return None

    def border(start: int) -> F32:
        columns = (start + np.arange(width)) % count
        return np.concatenate([tone[0, columns], tone[:, columns[0]], tone[:, columns[-1]]])

    wanted, best = border(first), (np.inf, 0)
    for start in range(count):
        if free[:, (start + np.arange(width)) % count].mean() < 0.99:
            continue
        off = border(start) - wanted
        level = np.median(off, axis=0)
        best = min(best, (float(np.abs(off - level).mean() + 0.1 * np.abs(level).mean()), start))
    return None if best[0] == np.inf else float((best[1] - first) * _ALONG + patch.azimuth) % 360


@dataclass(frozen=True, eq=False)
class _Area:
    """A rectangle on its lens: a grid around it (`azimuth` unwrapped, `theta`: radians), and its pixels.

    The grid's first row, and first and last column, lie outside; the last row does where `held`, else the
    rectangle ends at the frame. `pixels` (N, 2): row and column in the picture; `way` (N, 3).
    """

    azimuth: F64
    theta: F64
    closed: bool
    held: bool
    pixels: npt.NDArray[np.intp]
    way: F64


@dataclass(frozen=True, eq=False)
class _Source:
    """Log light to be cloned: on the grid (R, C, 3), at the pixels (N, 3), and where it is known."""

    grid: F64
    pixels: F64
    known: Mask
    known_pixels: Mask


def _area(own: View, patch: Patch) -> _Area:
    half, circle = own.lens.half, own.circle
    height, width = own.usable.shape
    x, y = np.arange(width, dtype=np.float32) + 0.5, np.arange(height, dtype=np.float32) + 0.5
    reach = np.hypot(x - np.float32(circle.x), (y - np.float32(circle.y))[:, None]) / circle.radius
    near = own.lens.radius_of(math.radians(patch.inner)) - _SKEWED, own.lens.radius_of(half) + _SKEWED
    pixels = np.argwhere((reach >= near[0]) & (reach <= near[1]) & own.usable)
    way, _ = unproject(own.lens, circle, pixels[:, ::-1] + 0.5)
    azimuth, theta = angles(way)
    inside = covers(patch, azimuth, theta)
    pixels, way, theta = pixels[inside], way[inside], theta[inside]
    step = max(half / circle.radius, _FINEST)
    last = math.radians(patch.outer)
    edge = float(theta.max()) if len(theta) else half  # the frame, where pictures end before it
    held = last + 2 * step < edge or (last < half - math.radians(1.5) and last <= edge)
    last = last if held else edge
    closed = patch.width >= 360
    start, end = math.radians(patch.azimuth), math.radians(patch.azimuth + min(patch.width, 360.0))
    across = max(3, round((end - start) / step))
    down = max(3, round((last - math.radians(patch.inner)) / step))
    extra = 0 if closed else 1
    at = (np.arange(-extra, across + extra) + 0.5) / across
    rim = (np.arange(-1, down + (1 if held else 0)) + 0.5) / down
    return _Area(
        azimuth=start + at * (end - start),
        theta=math.radians(patch.inner) + rim * (last - math.radians(patch.inner)),
        closed=closed,
        held=held,
        pixels=pixels,
        way=way,
    )


def _filled(own: View, area: _Area, source: _Source) -> F32:
    """The lens' light with the source in the area, level taken from its border."""
    import cv2

    grid = directions(area.azimuth[None, :], area.theta[:, None])
    light, seen = look(own, grid)
    ratio = _log(light, _floor(own)) - source.grid
    shadow = area.theta > own.lens.half - math.radians(EDGE)
    told = seen & source.known & ~shadow[:, None]
    sides: list[Any] = [np.s_[0, :]]
    if area.held:
        sides.append(np.s_[-1, :])
    if not area.closed:
        sides += [np.s_[:, 0], np.s_[:, -1]]
    inside = np.ones(seen.shape, np.bool_)
    for side in sides:
        inside[side] = False
    made = own.light.copy()
    if not (told & ~inside).any():
        return made
    level = np.median(ratio[told & ~inside], axis=0)
    ratio = np.clip(ratio, level - _ODD, level + _ODD)
    for side in sides:
        _bridge(ratio[side], told[side], level)
    smooth = membrane(ratio, inside, wrap=area.closed)
    if area.closed:
        smooth = np.concatenate([smooth, smooth[:, :1]], axis=1)
    azimuth, theta = angles(area.way)
    x = np.mod(azimuth - area.azimuth[0], 2 * np.pi) / (area.azimuth[1] - area.azimuth[0])
    y = (theta - area.theta[0]) / (area.theta[1] - area.theta[0])
    x, y = _rows_of(x), _rows_of(y)
    there = cv2.remap(smooth, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    level_there = there.reshape(-1, 3)[: len(azimuth)]
    known = source.known_pixels
    at = area.pixels[known]
    if not len(at):
        return made
    (top, left), (bottom, right) = np.maximum(at.min(axis=0) - 2, 0), at.max(axis=0) + 3
    around, y, x = own.light[top:bottom, left:right], at[:, 0] - top, at[:, 1] - left
    lamp = int(math.radians(_LAMP) * own.circle.radius / own.lens.half) | 1
    wide = cv2.morphologyEx(around, cv2.MORPH_OPEN, np.ones((lamp, lamp), np.uint8))
    most = cv2.dilate(around, np.ones((5, 5), np.uint8))[y, x] * np.float32(_BRIGHTER)
    clone = np.exp(source.pixels + level_there)[known]
    made[at[:, 0], at[:, 1]] = _thrown_off(around[y, x], clone, most, (around - wide)[y, x])
    return made


def _thrown_off(light: F32, clone: F64, most: F32, detail: F32) -> npt.NDArray[Any]:
    """`clone` (N, 3), as far as a frame can have made `light` of it.

    A frame only adds light: what comes out brighter than `most` is a lamp that the shift of near things has
    brought in. And it adds calm light: small bright `detail` that is lost, and is far more than what is lost
    elsewhere, is a lamp that the source does not show.
    """
    lost = light - clone
    even = _FAR_MORE * np.percentile(np.maximum(lost, 0), 75, axis=0)
    kept = np.minimum(clone, most)
    lamps = np.maximum(kept, np.minimum(light - even, kept + detail))
    return np.asarray(np.where(lost > even, lamps, kept))


def _from_other(
    own: View,
    other: View,
    registration: Registration,
    area: _Area,
    patch: Patch,
    avoided: Sequence[Patch],
    comparison: Comparison | None,
) -> _Source | None:
    """What the other lens shows; further in than it sees, the own light, made as dark as it is there."""
    if comparison is None:
        return None
    rotation, gain = towards(registration, patch.side)
    floor = _floor(own)

    def seen_there(way: F64) -> tuple[F64, Mask]:
        azimuth, theta = angles(way)
        at = np.mod(azimuth / (2 * np.pi) * len(comparison.shift) - 0.5, len(comparison.shift))
        low = np.floor(at).astype(np.intp)
        part = (at - low)[..., None]
        shift = comparison.shift
        off = shift[low] * (1 - part) + shift[(low + 1) % len(shift)] * part
        there = directions(azimuth + off[..., 1], theta + off[..., 0]) @ rotation.T
        light, known = look(other, there) if there.ndim == 3 else _look_along(other, there)
        around, away = angles(there)
        for one in avoided:
            known &= ~covers(one, around, away)
        fall = falloff_at(registration, theta, own.lens.half) / falloff_at(
            registration, away, other.lens.half
        )
        return _log(light * gain * fall[..., None], floor), known

    way = directions(area.azimuth[None, :], area.theta[:, None])
    grid, known = seen_there(way)
    if known.mean() < _COVERED:
        return None
    pixels, known_pixels = seen_there(area.way)
    if known.all() and known_pixels.all():
        return _Source(grid, pixels, known, known_pixels)
    return _joined(own, area, way, _Source(grid, pixels, known, known_pixels))


def _joined(own: View, area: _Area, way: F64, source: _Source) -> _Source:
    """The source with its unknown places filled by the own light, at the source's level where both meet."""
    from scipy import ndimage

    light, seen = look(own, way)
    tone = _log(light, _floor(own))
    known, rows = source.known, np.arange(len(way))[:, None]
    first = np.minimum(known.argmax(axis=0), len(way) - 3)  # further in, the own light is taken
    meeting = (rows >= first) & (rows < first + 3) & known & seen
    off = ((tone - source.grid) * meeting[..., None]).sum(axis=0)
    count = meeting.sum(axis=0)[:, None].astype(np.float64)
    calm = math.radians(2) / (area.azimuth[1] - area.azimuth[0])
    mode = "wrap" if area.closed else "nearest"
    total = ndimage.gaussian_filter1d(off, calm, axis=0, mode=mode)
    weight = ndimage.gaussian_filter1d(count, calm, axis=0, mode=mode)
    off = np.clip(total / np.maximum(weight, 1e-9), 0, None)  # a reflection is brighter
    outside = rows < first
    grid = np.where(outside[..., None], tone - off, source.grid)
    azimuth, theta = angles(area.way)
    step = area.azimuth[1] - area.azimuth[0]
    column = np.mod(np.rint(np.mod(azimuth - area.azimuth[0] + step, 2 * np.pi) / step - 1), 2 * np.pi / step)
    column = np.clip(column.astype(np.intp), 0, len(first) - 1)
    row = (theta - area.theta[0]) / (area.theta[1] - area.theta[0])
    within = (row < first[column] - 0.5) | ~source.known_pixels
    here = own.light[area.pixels[:, 0], area.pixels[:, 1]]
    pixels = np.where(within[:, None], _log(here, _floor(own)) - off[column], source.pixels)
    everywhere = np.ones_like(source.known_pixels)
    return _Source(grid, pixels, np.where(outside, seen, known), everywhere)


def _from_ring(own: View, area: _Area, patch: Patch) -> _Source:
    turn = math.radians(patch.source_azimuth - patch.azimuth)
    grid, known = look(own, directions(area.azimuth[None, :] + turn, area.theta[:, None]))
    azimuth, theta = angles(area.way)
    pixels, known_pixels = _look_along(own, directions(azimuth + turn, theta))
    for inward in range(1, _FRAYED):  # where the source's edge is a little further in
        lost = np.flatnonzero(~known_pixels)
        step = own.lens.half / own.circle.radius
        pixels[lost], known_pixels[lost] = _look_along(
            own, directions(azimuth[lost] + turn, theta[lost] - inward * step)
        )
    floor = _floor(own)
    return _Source(_log(grid, floor), _log(pixels, floor), known, known_pixels)


def _floor(view: View) -> float:
    every = np.s_[:: max(1, view.light.shape[0] // 512), :: max(1, view.light.shape[1] // 512)]
    light = view.light[every][view.usable[every]]
    return max(_FLOOR * float(np.median(light)), 1e-30) if light.size else 1e-30


def _log(light: npt.NDArray[np.floating], floor: float) -> F64:
    return np.asarray(np.log(np.maximum(light, floor)), np.float64)


def _opposite(side: str) -> str:
    return BACK if side == FRONT else FRONT


def _named(patch: Patch, what: str) -> str:
    return f"The reflection at {patch.azimuth + patch.width / 2:.0f}° of the {patch.side} picture {what}."


def _bridge(values: F64, told: Mask, level: F64) -> None:
    """Put what lies between the told values (N, 3) of a border in place of the others."""
    if not told.any():
        values[:] = level
        return
    places = np.arange(len(values))
    for channel in range(3):
        values[~told, channel] = np.interp(places[~told], places[told], values[told, channel])


def _rows_of(values: F64) -> F32:
    """(rows, _ROW) of values (N,): cv2.remap's pictures are less than 32768 wide and high."""
    rows = -(-len(values) // _ROW)
    made = np.zeros(rows * _ROW, np.float32)
    made[: len(values)] = values
    return made.reshape(rows, _ROW)


def _look_along(view: View, way: F64) -> tuple[F32, Mask]:
    """As `look`, for directions (N, 3)."""
    if not len(way):
        return np.zeros((0, 3), np.float32), np.zeros(0, np.bool_)
    rows = -(-len(way) // _ROW)
    padded = np.zeros((rows * _ROW, 3))
    padded[: len(way)] = way
    light, seen = look(view, padded.reshape(rows, _ROW, 3))
    return light.reshape(-1, 3)[: len(way)], seen.reshape(-1)[: len(way)]
