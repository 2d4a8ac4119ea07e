"""What two lenses back to back both see: their rims unrolled side by side, and how points of them belong.

Each lens' rim is unrolled into a strip of azimuth a × angle t. The front lens' is polar: a from its right
over its top, t from its axis. The back lens' frame is first turned by half a turn about y, so that both
strips show the same at the same place when the lenses stand exactly back to back. Strips are made once, with
the lens as it is given; what a `Stand` changes (field of view, centres) moves places in them, not pixels.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from studio_core.capturing.artifacts import F32, F64, Mask, View
from studio_core.capturing.standing import HALF_TURN
from studio_core.colour import LUMINANCE
from studio_core.imaging.projection import Circle, Lens, project

EDGE = 0.985
"""Of θ_max: further out the circle's soft border begins, which both lenses have at different places."""
_FINER = 1.5
_FLOOR = 1e-4


@dataclass(frozen=True, eq=False)
class Strip:
    """A lens' rim (rows of t, columns of a): log2 luminance, log2 of the channels, where it is usable
    and where exposures resolved it too.

    `first`: radians at the upper edge of the first row; `step`: radians a pixel both ways. `turned`: the back
    lens'. `lens` and `circle` are those it was unrolled with.
    """

    tone: F32
    light: F32
    usable: Mask
    resolved: Mask
    first: float
    step: float
    turned: bool
    lens: Lens
    circle: Circle

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns."""
        return self.tone.shape[0], self.tone.shape[1]

    def pixels(self, places: F64) -> tuple[F32, F32]:
        """Columns and rows for cv2.remap (pixel centres are whole), a wrapped into the padded strip."""
        column = np.mod(places[..., 0] / self.step, self.shape[1]) - 0.5 + PAD
        row = (places[..., 1] - self.first) / self.step - 0.5
        return np.asarray(column, np.float32), np.asarray(row, np.float32)

    def grid(self) -> F64:
        """(rows, columns, 2): a and t of all pixels."""
        return _places(*self.shape, self.first, self.step)


PAD = 8
"""Columns that `padded` repeats at both ends."""


def padded(picture: F32) -> F32:
    """A strip's picture with `PAD` columns more at both ends, as it closes in itself."""
    return np.concatenate([picture[:, -PAD:], picture, picture[:, :PAD]], axis=1)


@dataclass(frozen=True, eq=False)
class Stand:
    """How two lenses stand: `turn` (3, 3) front's frame from the back's after its half turn, fov in degrees.

    `front`, `back` (2,): how far the circles' centres lie from where they were said to be, in radii.
    """

    turn: F64
    fov: float
    front: F64 = field(default_factory=lambda: np.zeros(2))
    back: F64 = field(default_factory=lambda: np.zeros(2))


@dataclass(frozen=True, eq=False)
class Patches:
    """Shifts that were seen: `here` in the front strip, `there` in the back strip (N, 2), `surety` (N, 2, 2)
    inverse covariance of the front place, radians⁻²; `likeness` (N,) correlation of the two; `contrast`
    (N,) of what both show, in log2, and `tried` its sum over all patches, those that fit no better too."""

    here: F64
    there: F64
    surety: F64
    likeness: F64
    contrast: F64
    tried: float


NOTHING = Patches(np.zeros((0, 2)), np.zeros((0, 2)), np.zeros((0, 2, 2)), np.zeros(0), np.zeros(0), 0.0)


def unroll(view: View, turned: bool, inner: float, per_degree: float) -> Strip:
    """A lens' rim from the angle `inner` (radians from its axis) to its edge, `per_degree` pixels a degree.

    Light is averaged where the photograph is finer. Beyond `EDGE` nothing is usable.
    """
    import cv2

    columns = round(360 * per_degree)
    step = 2 * math.pi / columns
    rows = max(8, math.ceil((view.lens.half - inner) / step))
    first = math.pi - view.lens.half if turned else view.lens.half - rows * step
    light, usable, resolved, scale, offset = _shrunk(view, view.circle.radius / view.lens.half * step)
    places = _places(rows, columns, first, step)
    points, _ = project(view.lens, view.circle, _polar(places) @ (HALF_TURN if turned else np.eye(3)))
    x, y = np.moveaxis(((points - offset) * scale - 0.5).astype(np.float32), -1, 0)
    x, y = np.ascontiguousarray(x), np.ascontiguousarray(y)

    def shown(picture: F32) -> F32:
        return np.asarray(cv2.remap(picture, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT))

    made, there, sure = shown(light), shown(usable) > 0.99, shown(resolved) > 0.99
    luminance = made @ np.array(LUMINANCE, np.float32)
    some = luminance[there]
    floor = max(_FLOOR * float(np.median(some)), 1e-20) if some.size else 1.0
    there &= luminance > floor
    theta = math.pi - places[..., 1] if turned else places[..., 1]
    there &= theta < EDGE * view.lens.half
    tone = np.log2(np.maximum(luminance, floor)).astype(np.float32)
    channels = np.log2(np.maximum(made, floor)).astype(np.float32)
    return Strip(tone, channels, there, there & sure, first, step, turned, view.lens, view.circle)


def _shrunk(view: View, finer: float) -> tuple[F32, F32, F32, F64, F64]:
    """Light, share that is usable and share that is resolved too, averaged over `finer` pixels both ways.

    With the factors (2,) and the offset (2,) that lead from the view's points to theirs.
    """
    import cv2

    usable, resolved = view.usable, view.usable
    for lost in (view.clipped, view.dark):
        resolved = resolved if lost is None else resolved & ~lost
    if finer <= _FINER:
        return view.light, usable.astype(np.float32), resolved.astype(np.float32), np.ones(2), np.zeros(2)
    circle = view.circle
    x0, y0 = max(0, int(circle.x - circle.radius) - 2), max(0, int(circle.y - circle.radius) - 2)
    cut = np.s_[y0 : int(circle.y + circle.radius) + 3, x0 : int(circle.x + circle.radius) + 3]
    height, width = usable[cut].shape
    size = max(1, round(width / finer)), max(1, round(height / finer))

    def mean(picture: F32) -> F32:
        return np.asarray(cv2.resize(picture, size, interpolation=cv2.INTER_AREA), np.float32)

    shares = [mean(mask[cut].astype(np.float32)) for mask in (usable, resolved)]
    light = mean(view.light[cut] * usable[cut][..., None].astype(np.float32))
    light /= np.maximum(shares[0], np.float32(1e-6))[..., None]
    scale = np.array([size[0] / width, size[1] / height])
    return light, shares[0], shares[1], scale, np.array([x0, y0], np.float64)


def _places(rows: int, columns: int, first: float, step: float) -> F64:
    """(rows, columns, 2): a and t of a strip's pixels."""
    a, t = np.meshgrid((np.arange(columns) + 0.5) * step, first + (np.arange(rows) + 0.5) * step)
    return np.stack([a, t], axis=-1)


def _polar(places: F64) -> F64:
    """(..., 3) directions of places (..., 2): a and t."""
    a, t = places[..., 0], places[..., 1]
    ring = np.sin(t)
    return np.stack([ring * np.cos(a), ring * np.sin(a), -np.cos(t)], axis=-1)


def ways(strip: Strip, places: F64, stand: Stand) -> F64:
    """Unit directions (..., 3) of places (..., 2) in a strip, in its lens' (turned) frame."""
    shift = stand.back if strip.turned else stand.front
    lens = strip.lens if stand.fov == strip.lens.fov else strip.lens.with_fov(stand.fov)
    if lens is strip.lens and not shift.any():
        return _polar(places)
    a, t = places[..., 0], places[..., 1]
    if strip.turned:
        a, t = math.pi - a, math.pi - t
    reach = strip.lens.radius_of(t)
    right, down = reach * np.cos(a) - shift[0], -reach * np.sin(a) - shift[1]
    reach = np.hypot(right, down)
    theta = lens.angle_of(reach)
    a = np.arctan2(-down, right)
    if strip.turned:
        a, theta = math.pi - a, math.pi - theta
    return _polar(np.stack([a, theta], axis=-1))


def places(strip: Strip, directions: F64, stand: Stand) -> F64:
    """Where directions (..., 3) of a lens' (turned) frame lie in its strip: (..., 2), a of any turn."""
    x, y, z = directions[..., 0], directions[..., 1], directions[..., 2]
    a, theta = np.arctan2(y, x), np.arctan2(np.hypot(x, y), -z)
    shift = stand.back if strip.turned else stand.front
    lens = strip.lens if stand.fov == strip.lens.fov else strip.lens.with_fov(stand.fov)
    if lens is strip.lens and not shift.any():
        return np.stack([a, theta], axis=-1)
    if strip.turned:
        a, theta = math.pi - a, math.pi - theta
    reach = lens.radius_of(theta)
    right, down = reach * np.cos(a) + shift[0], -reach * np.sin(a) + shift[1]
    theta = strip.lens.angle_of(np.hypot(right, down))
    a = np.arctan2(-down, right)
    if strip.turned:
        a, theta = math.pi - a, math.pi - theta
    return np.stack([a, theta], axis=-1)


def across(front: Strip, back: Strip, at: F64, stand: Stand) -> F64:
    """Places (..., 2) in the back lens' strip of what the front lens' strip shows at places `at`."""
    return places(back, ways(front, at, stand) @ stand.turn, stand)


def flattened(tone: F32, usable: Mask, sigma: float) -> F32:
    """A strip's tones without what changes over more than `sigma` pixels; 0 where nothing is usable."""
    weight = usable.astype(np.float32)
    mean = spread(np.dstack([np.where(usable, tone, np.float32(0)), weight]), sigma)
    made = np.where(usable, tone - mean[..., 0] / np.maximum(mean[..., 1], 1e-6), 0)
    return np.asarray(made, np.float32)


def spread(picture: F32, sigma: float) -> F32:
    """Gaussian means (rows, columns, C) of a strip's channels: it closes in itself, beyond its rows is 0."""
    import cv2

    wide = min(int(3 * sigma) + 1, picture.shape[1])
    around = np.concatenate([picture[:, -wide:], picture, picture[:, :wide]], axis=1)
    size = 2 * int(3 * sigma) + 1
    made = np.empty_like(picture)
    for first in range(0, picture.shape[2], 4):
        part = np.ascontiguousarray(around[..., first : first + 4], np.float32)
        blurred = cv2.GaussianBlur(part, (size, size), sigma, borderType=cv2.BORDER_CONSTANT)
        made[..., first : first + 4] = blurred.reshape(part.shape)[:, wide:-wide]
    return made


def rotation_of(stand: Stand) -> F64:
    """(3, 3): the front lens' frame from the back lens' frame."""
    return np.asarray(stand.turn @ HALF_TURN, np.float64)


def stand_of(rotation: F64, lens: Lens) -> Stand:
    """Where nothing else is known than the rotation, front lens' frame from the back lens'."""
    return Stand(np.asarray(rotation @ HALF_TURN, np.float64), lens.fov)
