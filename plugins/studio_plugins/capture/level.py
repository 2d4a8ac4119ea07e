"""Levelling: the vertical found from upright edges of walls, doors and furniture.

Straight edges of a room are arcs of great circles on the sphere of directions; those that are upright in the
room all pass through the vertical. Segments are found in flat cuts all around (LSD, von Gioi et al. 2010),
each gives a great circle, and the direction that most of them pass through wins, if it wins clearly.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from studio_core.capturing.artifacts import F32, F64, Mask
from studio_core.capturing.looking import camera_rays
from studio_core.imaging.latlong import direction_to_uv
from studio_core.imaging.resample import resize_area
from studio_core.imaging.sphere import lookup, with_border

REACH = 30.0
"""Degrees from the picture's own up within which the vertical is looked for."""
_WIDTH = 2048
_CUTS, _FOV, _SIZE = 8, 84.0, 512
_SHORTEST = 24  # pixels of a cut
_NEAR = math.radians(1.2)
_SECTORS = 6
_LEAST_LINES, _LEAST_SECTORS, _UNSURE = 10, 2, 0.5
# of other directions' score, of all edges, of those that are steep: rooms have at least 2.4, 0.08 and 0.58,
# what has no uprights at most 1.9, 0.07 and 0.38
_CLEAR, _SHARE, _STEEP_SHARE = 2.2, 0.1, 0.5


@dataclass(frozen=True, eq=False)
class Level:
    """`rotation` (3, 3) makes the picture upright; None: no vertical that can be trusted.

    `tilt`: degrees the picture was off; `uncertainty`: standard deviation of it, degrees; `lines`: upright
    edges found; `told`: the same in a sentence.
    """

    rotation: F64 | None
    tilt: float
    uncertainty: float
    lines: int
    told: str


def find_level(light: F32, seen: Mask) -> Level:
    """The turn that makes an equirectangular picture (H, 2H, 3) upright, from what is `seen` (H, 2H)."""
    normals, weights = great_circles(light, seen)
    return vertical(normals, weights)


def great_circles(light: F32, seen: Mask) -> tuple[F64, F64]:
    """Unit normals (N, 3) of the planes of straight edges in a picture, and their lengths in radians."""
    import cv2

    height, width = seen.shape
    if width > _WIDTH:
        height, width = _WIDTH // 2, _WIDTH
        light = np.asarray(resize_area(light, height, width), np.float32)
        seen = resize_area(seen[..., None].astype(np.float32), height, width)[..., 0] > 0.99
    size = int(min(_SIZE, max(64, width * math.tan(math.radians(_FOV) / 2) / np.pi)))
    grey = np.log(light.sum(axis=2) + 1e-3 * max(float(np.median(light[seen])), 1e-12) if seen.any() else 1.0)
    layers = with_border(np.stack([np.broadcast_to(grey, seen.shape), seen], axis=2).astype(np.float32), 1)
    rays = camera_rays(_FOV, size, size)
    step = math.radians(_FOV) / size
    detector = cv2.createLineSegmentDetector()
    planes, lengths = [], []
    for index in range(_CUTS):
        turn = 2 * np.pi * index / _CUTS
        c, s = math.cos(turn), math.sin(turn)
        frame = np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])
        u, v = direction_to_uv(rays @ frame.T)
        cut = lookup(layers, 1, np.mod(u, 1.0), v)
        known = cv2.erode((cut[..., 1] > 0.99).astype(np.uint8), np.ones((7, 7), np.uint8)) > 0
        if not known.any():
            continue
        low, high = np.percentile(cut[..., 0][known], [1, 99])
        if high - low < 0.05:
            continue
        shown = np.clip((cut[..., 0] - low) * (255 / (high - low)), 0, 255).astype(np.uint8)
        found = detector.detect(shown)[0]
        if found is None:
            continue
        ends = np.asarray(found, np.float64).reshape(-1, 2, 2)
        long = np.hypot(*(ends[:, 1] - ends[:, 0]).T) >= max(_SHORTEST * size / _SIZE, 8)
        places = np.clip(np.concatenate([ends, ends.mean(axis=1, keepdims=True)], axis=1), 0, size - 1)
        at = places.astype(np.intp)
        ends = ends[long & known[at[..., 1], at[..., 0]].all(axis=1)]
        scale = 2 * math.tan(math.radians(_FOV) / 2) / size
        x, y = (ends[..., 0] + 0.5 - size / 2) * scale, (size / 2 - 0.5 - ends[..., 1]) * scale
        ways = np.stack([x, y, -np.ones_like(x)], axis=-1) @ frame.T
        ways /= np.linalg.norm(ways, axis=-1, keepdims=True)
        normal = np.cross(ways[:, 0], ways[:, 1])
        sine = np.linalg.norm(normal, axis=1)
        some = sine > step
        planes.append(normal[some] / sine[some, None])
        lengths.append(np.arcsin(np.minimum(sine[some], 1)))
    if not planes:
        return np.empty((0, 3)), np.empty(0)
    return np.concatenate(planes), np.concatenate(lengths)


def vertical(normals: F64, weights: F64) -> Level:
    """The vertical of edges whose great circles have these normals (N, 3), with their lengths as weights."""
    if len(normals) < _LEAST_LINES:
        return _none(0, "there are hardly any straight edges")
    candidates = _cap(math.radians(REACH), math.radians(1.0))
    score = _score(candidates, normals, weights, _NEAR)
    best = candidates[int(score.argmax())]
    for near in (_NEAR, 0.7 * _NEAR, 0.5 * _NEAR, 0.5 * _NEAR):
        best = _refined(best, normals, weights, near)
    away = np.arcsin(np.clip(np.abs(normals @ best), 0, 1))
    upright = away < _NEAR
    lines = int(upright.sum())
    peak = float(_score(best[None], normals, weights, _NEAR)[0])
    others = score[candidates @ best < math.cos(math.radians(8))]
    clear = peak / max(float(np.percentile(others, 98)), 1e-12) if len(others) else np.inf
    sectors = len(set(_sector(normals[upright], best)))
    uncertainty = _uncertainty(best, normals[upright], weights[upright], away[upright])
    tilt = math.degrees(math.acos(min(max(float(best[1]), -1.0), 1.0)))
    length = float(weights[upright].sum())
    steep = float(weights[np.abs(normals @ best) < 0.5].sum())
    many = length > _SHARE * float(weights.sum()) or length > _STEEP_SHARE * steep
    if lines < _LEAST_LINES or sectors < _LEAST_SECTORS or clear < _CLEAR or not many:
        return _none(lines, "too few edges agree on what is upright")
    if uncertainty > _UNSURE:
        return _none(lines, f"upright edges tell the vertical only within {uncertainty:.1f}°")
    if tilt > REACH - 1:
        return _none(lines, f"the best vertical is {tilt:.0f}° off")
    told = f"{lines} upright edges say that the picture was {tilt:.1f}° off level (± {uncertainty:.2f}°)."
    return Level(_turn_to_up(best), tilt, uncertainty, lines, told)


def _none(lines: int, why: str) -> Level:
    return Level(None, 0.0, math.inf, lines, f"The horizon is left as it is: {why}.")


def _cap(reach: float, step: float) -> F64:
    """Directions around +y, about `step` apart."""
    count = int(2 * np.pi * (1 - math.cos(reach)) / step**2) + 1
    index = np.arange(count) + 0.5
    y = 1 - (1 - math.cos(reach)) * index / count
    ring, angle = np.sqrt(1 - y * y), index * (np.pi * (3 - math.sqrt(5)))
    return np.stack([ring * np.cos(angle), y, ring * np.sin(angle)], axis=1)


def _sector(normals: F64, up: F64) -> npt.NDArray[np.intp]:
    """Which way the walls of edges face, as one of six sectors of half a turn."""
    turn = _turn_to_up(up)
    flat = normals @ turn.T
    angle = np.mod(np.arctan2(flat[:, 2], flat[:, 0]), np.pi)
    made: npt.NDArray[np.intp] = np.minimum((angle * (_SECTORS / np.pi)).astype(np.intp), _SECTORS - 1)
    return made


def _score(candidates: F64, normals: F64, weights: F64, near: float) -> F64:
    """How much edge passes near each candidate; the root in each sector, so that one wall does not decide."""
    sectors = _sector(normals, np.array([0.0, 1.0, 0.0]))
    total = np.zeros(len(candidates))
    for sector in range(_SECTORS):
        own = sectors == sector
        if own.any():
            miss = (candidates @ normals[own].T) / math.sin(near)
            total += np.sqrt(np.exp(-miss * miss) @ weights[own])
    return total


def _refined(up: F64, normals: F64, weights: F64, near: float) -> F64:
    """Least squares over the edges near a vertical, far ones counting less and less."""
    miss = normals @ up
    soft = weights * np.exp(-((miss / near) ** 2))
    moments = (normals * soft[:, None]).T @ normals + 1e-12 * np.eye(3)
    _, vectors = np.linalg.eigh(moments)
    made = vectors[:, 0]
    made = made * np.sign(made @ up)
    return made if made @ up > math.cos(2 * _NEAR) else up


def _uncertainty(up: F64, normals: F64, weights: F64, away: F64) -> float:
    """Standard deviation of the vertical in its worse direction, degrees, lines counting as independent."""
    if len(normals) < 3:
        return math.inf
    soft = weights / weights.mean()
    moments = (normals * soft[:, None]).T @ normals
    second = float(np.linalg.eigvalsh(moments)[1])  # the smallest is that of `up` itself
    spread = math.sqrt(float((soft * away**2).mean()) + math.radians(0.05) ** 2)
    return math.degrees(spread / math.sqrt(max(second, 1e-9)))


def _turn_to_up(direction: F64) -> F64:
    """The smallest rotation that takes a direction to +y."""
    x, y, z = direction
    if y < -1 + 1e-9:
        return np.diag([1.0, -1.0, -1.0])
    cross = np.array([[0, -x, 0], [x, 0, z], [0, -z, 0]])  # of the axis direction × y
    return np.asarray(np.eye(3) + cross + cross @ cross / (1 + y), np.float64)
