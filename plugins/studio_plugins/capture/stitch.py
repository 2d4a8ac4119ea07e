"""From lenses to one equirectangular picture: each direction from the lens that sees it, without a seam."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from studio_core.capturing.artifacts import F32, F64, Mask, Registration, Stitched, View
from studio_core.capturing.settings import BACK, FEATHER, FRONT, StitchSettings
from studio_core.capturing.standing import HALF_TURN, user_turn
from studio_core.errors import InputError
from studio_core.imaging.latlong import direction_to_uv, pixel_directions
from studio_core.imaging.resample import resize_area
from studio_core.imaging.sphere import with_border
from studio_core.parallel import Workers
from studio_core.shading.job import Job
from studio_plugins.capture.fill import fill
from studio_plugins.capture.level import Level, find_level
from studio_plugins.capture.sampling import COARSE, Seen, Source, harshness, lens_source, look_through
from studio_plugins.capture.seam import Joint, join

_TILE = (128, 256)
_BORDER = 4
_LEVEL_WIDTH = 1280
_NOT_QUITE = 0.04


def stitch(
    views: Mapping[str, View],
    registration: Registration | None,
    settings: StitchSettings,
    job: Job,
    workers: Workers | None = None,
    upright: Level | None = None,
) -> Stitched:
    """The finished picture's light from one lens or two, before calibration.

    `views`: by side; with both there must be a `registration`, whose lens, circles, falloff and gain count (a
    registration of a single lens counts for its lens and falloff). What no lens sees is filled with the
    light of its surroundings and marked. `upright`: what `level_of` found for these views, where it is known
    already (it does not depend on the settings). Raises ValueError without views, Cancelled.
    """
    if settings.level and upright is None:
        upright = level_of(views, registration, job, workers)
    lenses = _lenses(views, registration, 2 * np.pi / settings.width)
    return _finished(lenses, HALF_TURN, settings, upright, job, workers)


def level_of(
    views: Mapping[str, View], registration: Registration | None, job: Job, workers: Workers | None = None
) -> Level:
    """How far these views are off level, by the upright edges in a draft of their picture."""
    finest = max((2 * np.pi * v.circle.radius / v.lens.half for v in views.values()), default=0)
    draft = StitchSettings(width=int(np.clip(finest, 128, _LEVEL_WIDTH)), blend=FEATHER)
    lenses = _lenses(views, registration, 2 * np.pi / draft.width)
    made = _compose(lenses, draft, HALF_TURN, job, workers)
    return find_level(made.light, ~made.unseen)


def turned(settings: StitchSettings) -> F64:
    """(3, 3) what the designer turns, after levelling."""
    return user_turn(settings.pitch, settings.roll, settings.north)


def stitch_equirectangular(
    view: View, settings: StitchSettings, job: Job, workers: Workers | None = None
) -> Stitched:
    """The same for a picture that is equirectangular already: levelled, turned and resized.

    Unchanged, bit for bit, where nothing has to be done. Pixels that are not usable are filled. `view`'s
    circle and lens do not matter. A picture that is nearly twice as wide as high is taken for all of the
    sphere; InputError for others.
    """
    view = _two_to_one(view)
    height, width = view.light.shape[:2]
    found = None
    if settings.level:
        found = find_level(np.where(view.usable[..., None], view.light, np.float32(0)), view.usable)
    frame, tilt, notes = _frame(np.eye(3), settings, found)
    if settings.width == width and np.array_equal(frame, np.eye(3)):
        none = np.zeros((height, width), np.bool_)
        clipped, dark = (none if mask is None else mask for mask in (view.clipped, view.dark))
        share = view.usable.astype(np.float32)
        made = _Composed(view.light.copy(), clipped, dark, ~view.usable, share)
        return _stitched(made, frame, tilt, notes)
    source = _picture_source(view, 2 * np.pi / settings.width)
    whole = [_Lens(source, np.eye(3), None, np.ones(3))]
    return _finished(whole, np.eye(3), settings, found, job, workers)


def _two_to_one(view: View) -> View:
    height, width = view.light.shape[:2]
    if width == 2 * height:
        return view
    if abs(width / height - 2) > _NOT_QUITE:
        raise InputError(
            f"The picture cannot be taken for all directions: {width} × {height} is not twice as wide as high"
        )
    size = max(1, width // 2), 2 * max(1, width // 2)

    def mask(given: Mask | None) -> Mask | None:
        if given is None:
            return None
        made: Mask = resize_area(given[..., None].astype(np.float32), *size)[..., 0] > 0.5
        return made

    light = np.asarray(resize_area(view.light, *size), np.float32)
    usable = mask(view.usable)
    assert usable is not None
    return View(light, usable, view.circle, view.lens, mask(view.clipped), mask(view.dark))


def _finished(
    lenses: list[_Lens],
    base: F64,
    settings: StitchSettings,
    level: Level | None,
    job: Job,
    workers: Workers | None,
) -> Stitched:
    frame, tilt, notes = _frame(base, settings, level)
    return _stitched(_compose(lenses, settings, frame, job, workers), frame, tilt, notes)


def _frame(
    base: F64, settings: StitchSettings, level: Level | None
) -> tuple[F64, float | None, tuple[str, ...]]:
    """The finished picture's frame from the lens', by how much it was levelled, and what is told."""
    if not settings.level or level is None:
        return turned(settings) @ base, None, ()
    if level.rotation is None:
        return turned(settings) @ base, None, (level.told,)
    return turned(settings) @ level.rotation @ base, level.tilt, (level.told,)


def _stitched(made: _Composed, frame: F64, tilt: float | None, notes: tuple[str, ...]) -> Stitched:
    fill(made.light, made.unseen)
    return Stitched(made.light, made.clipped, made.unseen, made.share, frame, made.dark, tilt, notes)


@dataclass(frozen=True, eq=False)
class _Lens:
    """A source, its frame from the front lens' frame, and what its light is multiplied by."""

    source: Source
    frame: F64
    falloff: Callable[[F64], F32] | None
    gain: F64

    def look(self, directions: F64) -> Seen:
        """Directions (h, w, 3) of the front lens' frame."""
        own = directions @ self.frame.T
        seen = look_through(self.source, own)
        if seen.seen.any():
            light = seen.light
            light *= self.gain.astype(np.float32)
            if self.falloff is not None:
                light /= self.falloff(-own[..., 2])[..., None]
        return seen


@dataclass(frozen=True, eq=False)
class _Composed:
    light: F32
    clipped: Mask
    dark: Mask
    unseen: Mask
    share: F32


def _lenses(views: Mapping[str, View], registration: Registration | None, pitch: float) -> list[_Lens]:
    if not views:
        raise ValueError("there is nothing to join")
    if len(views) == 2 and registration is None:
        raise ValueError("how the two lenses stand to each other is not known")
    made = []
    for side in (FRONT, BACK):
        if side not in views:
            continue
        view = views[side]
        frame, gain, falloff = np.eye(3), np.ones(3), None
        if registration is not None:
            lens = registration.lens
            moved = registration.front if side == FRONT else registration.back
            view = replace(view, lens=lens, circle=moved or view.circle)
            if registration.loss:
                falloff = _falloff(registration, lens.half)
            if side == BACK and FRONT in views:
                frame, gain = registration.rotation.T, registration.gain
        made.append(_Lens(lens_source(view, pitch), frame, falloff, gain))
    return made


def _falloff(registration: Registration, half: float) -> Callable[[F64], F32]:
    def of(cosine: F64) -> F32:
        light = registration.light_at(np.arccos(np.clip(cosine, -1, 1)) / half)
        return np.maximum(light, 0.05).astype(np.float32)

    return of


def _picture_source(view: View, pitch: float) -> Source:
    """An equirectangular picture, with a border so that nothing ends at its edges."""
    height, width = view.light.shape[:2]
    light = with_border(np.where(view.usable[..., None], view.light, np.float32(0)), _BORDER)

    def at(directions: F64) -> tuple[F64, Mask]:
        u, v = direction_to_uv(directions)
        points = np.stack([u * width + _BORDER, v * height + _BORDER], axis=-1)
        return points, np.ones(u.shape, np.bool_)

    def mask(given: Mask | None) -> np.ndarray | None:
        return (
            None if given is None or not given.any() else with_border(given.astype(np.uint8) * 255, _BORDER)
        )

    good = with_border(view.usable.astype(np.uint8) * 255, _BORDER)
    coarse = pitch * width / (2 * np.pi) > COARSE
    return Source(light, good, mask(view.clipped), mask(view.dark), harshness(light), coarse, at, width)


def _compose(
    lenses: list[_Lens], settings: StitchSettings, upright: F64, job: Job, workers: Workers | None
) -> _Composed:
    """All tiles of the picture; what no lens sees is 0."""
    width = settings.width - settings.width % 2
    height = width // 2
    joint = None
    if len(lenses) == 2:
        one, other = lenses
        joint = join(_looking(one), _looking(other), width, settings.blend, math.radians(settings.feather))
    size = height, width
    light, share = np.empty((*size, 3), np.float32), np.empty(size, np.float32)
    clipped, dark, unseen = np.empty(size, np.bool_), np.empty(size, np.bool_), np.empty(size, np.bool_)
    made = _Composed(light, clipped, dark, unseen, share)
    down, across = (max(1, -(-size // tile)) for size, tile in zip((height, width), _TILE, strict=True))

    def tiles(start: int, stop: int) -> None:
        for index in range(start, stop):
            row, column = divmod(index, across)
            rows = _part(row, down, height)
            columns = _part(column, across, width)
            _tile(made, lenses, joint, upright, rows, columns)

    if workers is not None:
        workers.run(down * across, 1, tiles, job)
    else:
        for index in range(down * across):
            job.checkpoint(index, down * across)
            tiles(index, index + 1)
    return made


def _part(index: int, parts: int, size: int) -> slice:
    return slice(index * size // parts, (index + 1) * size // parts)


def _looking(lens: _Lens) -> Callable[[F64], tuple[F32, Mask]]:
    def look(directions: F64) -> tuple[F32, Mask]:
        seen = lens.look(directions)
        return seen.light, seen.seen

    return look


def _tile(
    made: _Composed, lenses: list[_Lens], joint: Joint | None, upright: F64, rows: slice, columns: slice
) -> None:
    height, width = made.unseen.shape
    directions = pixel_directions(height, width, rows, columns) @ upright  # the inverse of upright @ d
    place = (rows, columns)
    front = lenses[0].look(directions)
    if joint is None:
        one = front.seen
        made.light[place], made.share[place], made.unseen[place] = front.light, one, ~one
        made.clipped[place], made.dark[place] = front.clipped, front.dark
        return
    back = lenses[1].look(directions)
    azimuth = np.arctan2(directions[..., 1], directions[..., 0])
    theta = np.arccos(np.clip(-directions[..., 2], -1, 1))
    share = joint.share(azimuth, theta)
    share = np.where(front.seen & back.seen, share, front.seen.astype(np.float32))
    light = front.light * share[..., None] + back.light * (1 - share)[..., None]
    near = (theta > joint.strip.low) & (theta < joint.strip.high)
    if near.any():
        factor = joint.evened(azimuth, theta, share)
        if factor is not None:
            light *= factor
    first = share >= 0.5
    made.light[place], made.share[place] = light, share
    made.unseen[place] = ~(front.seen | back.seen)
    made.clipped[place] = np.where(first, front.clipped, back.clipped)
    made.dark[place] = np.where(first, front.dark, back.dark)
