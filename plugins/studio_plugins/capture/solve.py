"""The stand of two lenses from many directions that both see: robust least squares.

Parameters are a small rotation, the field of view, and how far both circles' centres are off. Weights are
Cauchy's, with the scatter along the ring and towards the axis apart, and no octant has more than its say.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from studio_core.capturing.artifacts import F64
from studio_core.imaging.warping import turn
from studio_plugins.capture.overlap import Patches, Stand, Strip, ways

_FLOOR = math.radians(0.04)  # what a patch's shift may be wrong by in any case
_CENTRE = 0.0012, 0.25  # how far off the circles' centres may well be: radii, and pixels
_FOV = 0.05  # share by which the field of view may well be off
_SECTORS = 36


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
        """Of all contrast around the ring, what agrees."""
        return float((self.weights * self.patches.contrast).sum()) / max(self.patches.tried, 1e-12)

    @property
    def support(self) -> float:
        """Degrees of azimuth with patches that agree."""
        some = self.patches.here[self.weights > 0.3, 0]
        return len(np.unique(np.floor(np.degrees(some) / 5))) * 5.0


def solved(front: Strip, back: Strip, seen: Patches, stand: Stand, fit_fov: bool, near: float = 0.0) -> Fit:
    """The stand that brings patches' directions together best, from a stand nearby.

    `near` (degrees): things so near that their directions differ by about that much between the lenses may
    stand in any direction. Then each 10° of the ring may be shifted as a whole, and what is left to tell a
    turn is how shifts along the ring change across it; the field of view stays.
    """
    fit_fov = fit_fov and not near
    octant = np.minimum((np.mod(seen.here[:, 0], 2 * math.pi) / (math.pi / 4)).astype(np.intp), 7)
    start, weights = stand, np.ones(len(seen.here))
    prior = _prior(front, back, fit_fov, near)
    free = len(prior) - 8
    slopes = np.zeros((len(seen.here), 2, 8 + free))
    if free:
        sector = np.mod(seen.here[:, 0], 2 * math.pi) / (2 * math.pi) * (free // 2)
        index = 8 + 2 * np.minimum(sector.astype(np.intp), free // 2 - 1)
        for axis in (0, 1):
            slopes[np.arange(len(index)), axis, index + axis] = 1
    shifts = np.zeros(free)
    noise = np.linalg.inv(seen.surety + 1e-3 * np.eye(2))
    scale = np.radians([0.15, 0.3])  # along the ring, and from the axis, which near things move
    system = np.eye(8)
    for _ in range(12):
        plain = _left(front, back, seen, stand)
        left = plain + slopes[:, :, 8:] @ shifts
        cost = np.einsum("ni,nij,nj->n", left, np.linalg.inv(noise + np.diag(scale**2)), left)
        weights = 1 / (1 + cost / 4)
        scale = np.array([1.3 * _middle(np.abs(one), weights) for one in left.T])
        scale = np.clip(scale, _FLOOR, math.radians(1.5))
        scale[1] *= min(max(scale[1] / (1.5 * scale[0]), 1.0), 5.0)
        inverse = np.linalg.inv(noise + np.diag(scale**2))
        say = np.bincount(octant, weights * inverse.trace(axis1=1, axis2=2), 8)
        fair = np.minimum(1, np.median(say[say > 0]) * 2 / np.maximum(say, 1e-12))
        inverse = inverse * (weights * fair[octant])[:, None, None]
        slopes[:, :, :8] = _slopes(front, back, seen, stand, plain)
        already = np.concatenate([_parameters(start, stand), shifts])
        system = np.einsum("nip,nij,njq->pq", slopes, inverse, slopes, optimize=True) + np.diag(prior)
        force = np.einsum("nip,nij,nj->p", slopes, inverse, left, optimize=True) + prior * already
        step = -np.linalg.solve(system, force)
        stand, shifts = _stepped(stand, step[:8], fit_fov), shifts + step[8:]
        if np.abs(step).max() < 1e-6:
            break
    left = _left(front, back, seen, stand)
    doubt = math.degrees(math.sqrt(max(np.linalg.eigvalsh(np.linalg.inv(system)[:3, :3])[-1], 0.0)))
    return Fit(stand, seen, weights, np.hypot(*left.T), doubt)


def _prior(front: Strip, back: Strip, fit_fov: bool, near: float) -> F64:
    """Inverse variances of rotation (3), ln fov, both centres (2 each) and, with near things, all shifts."""
    centre = np.array([_CENTRE[0] + _CENTRE[1] / strip.circle.radius for strip in (front, back)])
    fov = 1 / _FOV**2 if fit_fov else 1e12
    shifts = np.full(2 * _SECTORS if near else 0, 1 / math.radians(near or 1.0) ** 2)
    return np.concatenate([np.full(3, 1e-6), [fov], 1 / np.repeat(centre, 2) ** 2, shifts])


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
