"""From a guess to the last hundredth of a degree: patches of both rims are laid over each other.

Around the ring the back lens' strip is warped to the front lens'; in every patch a shift remains that makes
log light agree best (Gauss–Newton: Lucas and Kanade 1981), with the certainty that the patch's texture gives
in each direction. Rotation, field of view and the circles' centres then follow from all shifts by robust
least squares (Cauchy weights, no octant with more than its say), from coarse to fine.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from studio_core.capturing.artifacts import F32, F64, Mask
from studio_core.imaging.warping import turn
from studio_plugins.capture.overlap import Stand, Strip, across, flattened, padded, ways

_BLURS = (2.0, 1.0, 0.5, 0.25)  # degrees
_CALM = 4.0
_APART = 3.0  # degrees between patches
_FLOOR = math.radians(0.04)  # what a patch's shift may be wrong by in any case
_CENTRE = 0.004  # radii: how far off the circles' centres may well be
_FOV = 0.05  # share by which the field of view may well be off
_AGREE = 0.5  # correlation from which a patch counts


@dataclass(frozen=True, eq=False)
class Patches:
    """Shifts that were seen: `here` in the front strip, `there` in the back strip (N, 2), `surety` (N, 2, 2)
    inverse covariance of the front place, radians⁻²; `likeness` (N,) correlation of the two; `tried`
    patches have texture in both."""

    here: F64
    there: F64
    surety: F64
    likeness: F64
    tried: int


_NONE = Patches(np.zeros((0, 2)), np.zeros((0, 2)), np.zeros((0, 2, 2)), np.zeros(0), 0)


@dataclass(frozen=True, eq=False)
class Fit:
    """A stand, the patches it rests on with their weights (0 … 1), and what is left.

    `left` (N,): angles between what both show, radians; `doubt`: standard deviation of the rotation about
    its least certain axis, degrees.
    """

    stand: Stand
    patches: Patches
    weights: F64
    left: F64
    doubt: float

    @property
    def spread(self) -> float:
        """Median angle between what both show, degrees."""
        return math.degrees(float(np.median(self.left))) if len(self.left) else math.inf

    @property
    def share(self) -> float:
        """Of all patches with texture, those that agree."""
        return float(self.weights.sum()) / max(self.patches.tried, 1)

    @property
    def support(self) -> float:
        """Degrees of azimuth with patches that agree."""
        some = self.patches.here[self.weights > 0.3, 0]
        return len(np.unique(np.floor(np.degrees(some) / 5))) * 5.0


def refined(front: Strip, back: Strip, stand: Stand, fit_fov: bool, blurs: tuple[float, ...] = _BLURS) -> Fit:
    """The stand that makes both strips agree best, near the given one."""
    made = Fit(stand, _NONE, np.zeros(0), np.zeros(0), math.inf)
    flat = flattened(front, _CALM), flattened(back, _CALM)
    for blur in blurs:
        if math.radians(blur) < 0.4 * front.step and made.patches.here.size:
            break
        for _ in range(2):
            seen = compared(front, back, flat, stand, blur)
            if len(seen.here) < 6:
                break
            made = solved(front, back, seen, stand, fit_fov)
            stand = made.stand
    return made


def compared(front: Strip, back: Strip, flat: tuple[F32, F32], stand: Stand, blur: float) -> Patches:
    """What a warp by `stand` leaves to shift, patch by patch; `blur` in degrees."""
    import cv2

    at = front.grid()
    rows = np.flatnonzero(front.usable.any(axis=1))
    reach = back.first + back.shape[0] * back.step, back.first
    t = at[:, 0, 1]
    margin = math.radians(12)
    rows = rows[(t[rows] < reach[0] + margin) & (t[rows] > reach[1] - margin)]
    if not len(rows):
        return _NONE
    part = slice(rows[0], rows[-1] + 1)
    at = at[part]
    x, y = back.pixels(across(front, back, at, stand))
    weight = np.asarray(
        cv2.remap(
            padded(back.usable.astype(np.float32)), x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT
        )
    )
    other = np.asarray(cv2.remap(padded(flat[1]), x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT))
    both: Mask = front.usable[part] & (weight > 0.99)
    if both.sum() < 50:
        return _NONE
    sigma = math.radians(blur) / front.step
    one, other, both = _blurred(np.where(both, flat[0][part], 0), np.where(both, other, 0), both, sigma)
    patch = max(1.6, 1.2 * blur)  # degrees, standard deviation of a patch
    slope_x = np.gradient((one + other) / 2, axis=1)
    slope_y = np.gradient((one + other) / 2, axis=0)
    calm = both.astype(np.float32)
    calm = np.asarray(
        cv2.erode(calm, np.ones((3, 3), np.uint8), borderType=cv2.BORDER_CONSTANT, borderValue=0), np.float32
    )
    missing = one - other
    sums = np.stack(
        [
            slope_x * slope_x, slope_x * slope_y, slope_y * slope_y, slope_x * missing, slope_y * missing,
            missing * missing, one, other, one * one, other * other, one * other, np.ones_like(one),
        ],
        axis=-1,
    )  # fmt: skip
    sums *= calm[..., None]
    sums = _around(sums, math.radians(patch) / front.step)
    apart = max(1, round(math.radians(_APART) / front.step))
    middle = slice(apart // 2, None, apart)
    some = sums[:, middle]
    share = some[..., 11].sum(axis=0) > 0
    # rows of patches: as many as fit the overlap at this azimuth
    picked = np.zeros(some.shape[:2], np.bool_)
    high = np.maximum(1, apart)
    for column in np.flatnonzero(share):
        inside = np.flatnonzero(calm[:, middle][:, column] > 0)
        if not len(inside):
            continue
        first, last = inside[0], inside[-1]
        number = max(1, round((last - first + 1) / high))
        centre = first + (np.arange(number) + 0.5) * (last - first + 1) / number
        picked[np.clip(centre.astype(np.intp), first, last), column] = True
    here = at[:, middle][picked]
    xx, xy, yy, bx, by, rest, mean_a, mean_b, aa, bb, ab, count = (some[picked][:, i] for i in range(12))
    count = np.maximum(count, 1e-9)
    mean_a, mean_b = mean_a / count, mean_b / count
    va, vb = aa / count - mean_a**2, bb / count - mean_b**2
    likeness = (ab / count - mean_a * mean_b) / np.sqrt(np.maximum(va * vb, 1e-12))
    texture = np.stack([np.stack([xx, xy], -1), np.stack([xy, yy], -1)], -2)
    trace = (xx + yy)[:, None, None] * np.eye(2)
    shift = np.linalg.solve(texture + 1e-3 * trace + 1e-12 * np.eye(2), np.stack([bx, by], -1)[..., None])[
        ..., 0
    ]
    unexplained = np.maximum(rest - shift[:, 0] * bx - shift[:, 1] * by, 1e-4 * aa) / count
    pixels = 2 * math.pi * sigma**2 + 1  # correlated by the blur
    surety = texture / (unexplained * pixels)[:, None, None] / front.step**2
    limit = max(1.5 * blur, 0.5)  # degrees
    fits = np.hypot(*shift.T) * front.step < math.radians(limit)
    textured = (va > 1e-5) & (vb > 1e-5) & (count > 0.15 * count.max())
    keep = (likeness > (_AGREE if blur < 1 else 0.3)) & fits & textured
    here, shift, surety, likeness = here[keep], shift[keep], surety[keep], likeness[keep]
    there = across(front, back, here + shift * front.step, stand)
    return Patches(here, there, surety, likeness, int(textured.sum()))


def _blurred(one: F32, other: F32, both: Mask, sigma: float) -> tuple[F32, F32, Mask]:
    if sigma < 0.3:
        return one.astype(np.float32), other.astype(np.float32), both
    stack = np.dstack([one, other, both]).astype(np.float32)
    made = _around(stack, sigma)
    share = np.maximum(made[..., 2], 1e-3)
    return np.where(both, made[..., 0] / share, 0), np.where(both, made[..., 1] / share, 0), both


def _around(picture: F32, sigma: float) -> F32:
    """Gaussian sums of the channels, the columns closing in themselves."""
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


def solved(front: Strip, back: Strip, seen: Patches, stand: Stand, fit_fov: bool) -> Fit:
    """The stand that brings patches' directions together best, from a stand nearby."""
    octant = np.minimum((np.mod(seen.here[:, 0], 2 * math.pi) / (math.pi / 4)).astype(np.intp), 7)
    prior = np.concatenate([np.full(3, 1e-6), [1 / _FOV**2 if fit_fov else 1e12], np.full(4, 1 / _CENTRE**2)])
    start, weights = stand, np.ones(len(seen.here))
    noise = np.linalg.inv(seen.surety + 1e-3 * np.eye(2))
    scale = math.radians(0.3)
    system = np.eye(8)
    for _ in range(12):
        left = _left(front, back, seen, stand)
        cost = np.einsum("ni,nij,nj->n", left, np.linalg.inv(noise + scale**2 * np.eye(2)), left)
        weights = 1 / (1 + cost / 4)
        scale = max(_FLOOR, min(math.radians(1.5), 0.8 * _middle(np.hypot(*left.T), weights)))
        inverse = np.linalg.inv(noise + scale**2 * np.eye(2))
        say = np.bincount(octant, weights * inverse.trace(axis1=1, axis2=2), 8)
        fair = np.minimum(1, np.median(say[say > 0]) * 2 / np.maximum(say, 1e-12))
        inverse = inverse * (weights * fair[octant])[:, None, None]
        slopes = _slopes(front, back, seen, stand, left)
        already = _parameters(start, stand)
        system = np.einsum("nip,nij,njq->pq", slopes, inverse, slopes) + np.diag(prior)
        force = np.einsum("nip,nij,nj->p", slopes, inverse, left) + prior * already
        step = -np.linalg.solve(system, force)
        stand = _stepped(stand, step, fit_fov)
        if np.abs(step).max() < 1e-6:
            break
    left = _left(front, back, seen, stand)
    doubt = math.degrees(math.sqrt(max(np.linalg.eigvalsh(np.linalg.inv(system)[:3, :3])[-1], 0.0)))
    return Fit(stand, seen, weights, np.hypot(*left.T), doubt)


def _middle(values: F64, weights: F64) -> float:
    """Weighted median."""
    order = np.argsort(values)
    sums = np.cumsum(weights[order])
    return float(values[order][np.searchsorted(sums, sums[-1] / 2)])


def _left(front: Strip, back: Strip, seen: Patches, stand: Stand) -> F64:
    """(N, 2) angles along a and t between what both lenses show, radians."""
    a, b = ways(front, seen.here, stand), ways(back, seen.there, stand) @ stand.turn.T
    ring = np.hypot(a[:, 0], a[:, 1])
    along = np.stack([-a[:, 1], a[:, 0], 0 * ring], -1) / ring[:, None]
    outward = np.cross(along, a)  # growing t
    apart = b - a
    return np.stack([(apart * along).sum(-1), (apart * outward).sum(-1)], axis=-1)


def _slopes(front: Strip, back: Strip, seen: Patches, stand: Stand, left: F64) -> F64:
    made = np.empty((len(left), 2, 8))
    for index in range(8):
        step = np.zeros(8)
        step[index] = 1e-5
        made[:, :, index] = (_left(front, back, seen, _stepped(stand, step, True)) - left) / 1e-5
    return made


def _stepped(stand: Stand, step: F64, fit_fov: bool) -> Stand:
    size = float(np.linalg.norm(step[:3]))
    limit = min(1.0, 0.2 / max(size, 1e-12))
    x, y, z = np.degrees(step[:3] * limit)
    fov = stand.fov * math.exp(float(np.clip(step[3], -0.05, 0.05))) if fit_fov else stand.fov
    return replace(
        stand,
        turn=turn((x, y, z)) @ stand.turn,
        fov=min(max(fov, 150.0), 290.0),
        front=np.clip(stand.front + step[4:6], -0.03, 0.03),
        back=np.clip(stand.back + step[6:8], -0.03, 0.03),
    )


def _parameters(start: Stand, stand: Stand) -> F64:
    """What priors hold on to: the field of view near the start's, the centres near 0; rotations are free."""
    return np.concatenate([np.zeros(3), [math.log(stand.fov / start.fov)], stand.front, stand.back])
