"""Views for moving pictures: a turn around a point, and a smooth path through cameras.

A path is a cubic between keys. Positions (and the logarithms of focus and of the picture's half height, so
that zooms are even) have the tangents of a centripetal Catmull–Rom spline (Yuksel et al., "Parameterization
and applications of Catmull-Rom curves", 2011); rotations are Bézier curves on the unit quaternions with
tangents by the same rule (Shoemake, "Animating rotation with quaternion curves", 1985). Tangents are limited
like those of monotone cubics (Fritsch and Carlson, 1980): what stands still between two keys stays still.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from studio_core.errors import InputError
from studio_core.scene.nodes import DirectionalLamp, Environment, Node, Scene
from studio_core.scene.transform import Quat, Transform, Vec3, axis_angle, normalized, vec3
from studio_core.session import View

F64 = npt.NDArray[np.float64]
STEPS = 64  # of a segment, when its length is measured
STEEPEST = 3.0  # a tangent over the slower of its two chords
TINY = 1e-9


def turn_angles(frames: int, degrees: float = 360.0) -> list[float]:
    """Degrees of each frame; whole turns end one step before where they began, others at their end."""
    whole = abs(degrees) >= 360 and math.isclose(degrees % 360, 0, abs_tol=1e-9)
    steps = frames if whole else max(frames - 1, 1)
    return [degrees * index / steps for index in range(frames)]


def turntable(view: View, frames: int, degrees: float = 360.0, centre: Vec3 | None = None) -> list[View]:
    """Views around the vertical through `centre` (by default what the view looks at), at its height.

    Counter-clockwise from above where `degrees` is positive; the first is the view itself.
    """
    if frames < 1:
        raise InputError(f"{frames} frames: a turntable has at least one")
    return [turned(view, angle, centre or view.target) for angle in turn_angles(frames, degrees)]


def turned(view: View, degrees: float, centre: Vec3) -> View:
    """The view after the camera went around the vertical through a point."""
    there = Transform(vec3(np.multiply(centre, -1)))
    turn = Transform(rotation=axis_angle((0, 1, 0), degrees))
    return dataclasses.replace(view, transform=Transform(centre) @ turn @ there @ view.transform)


def light_turned(scene: Scene, degrees: float) -> Scene:
    """The scene with environments and suns turned about the vertical; lamps stay where they stand."""
    turn = Transform(rotation=axis_angle((0, 1, 0), degrees))
    nodes: list[Node] = []
    for sky in scene.of(Environment):
        azimuth = (sky.azimuth + degrees + 180) % 360 - 180
        nodes.append(dataclasses.replace(sky, azimuth=azimuth))
    for sun in scene.of(DirectionalLamp):
        above = scene.world(sun.parent) if sun.parent is not None else Transform()
        world = scene.world(sun.id)
        stood = dataclasses.replace(turn @ world, translation=world.translation)
        nodes.append(dataclasses.replace(sun, transform=above.inverse() @ stood))
    return scene.with_nodes(*nodes) if degrees else scene


class CameraPath:
    """A smooth path through views (two or more); pixels and samples are those of the first.

    `closed` leads from the last back to the first. InputError for fewer than two keys.
    """

    def __init__(self, keys: Sequence[View], *, closed: bool = False) -> None:
        if len(keys) < 2:
            raise InputError("a path needs two cameras or more")
        self.keys, self.closed = tuple(keys), closed
        places = np.array([[*key.transform.translation, *_zoom(key)] for key in keys])
        turns = _same_side(np.array([key.transform.rotation for key in keys]), closed)
        if closed:
            places = np.concatenate([places, places[:1]])
        self._reach = float(np.mean([key.focus for key in keys]))
        chords, bends = np.diff(places, axis=0), _between(turns[:-1], turns[1:])
        lengths = self._lengths(chords, bends)
        self._spans = np.sqrt(np.maximum(lengths, TINY))
        self._places, self._turns = places, turns
        self._slopes = _tangents(chords / self._spans[:, None], self._spans, closed, split=3)
        self._spins = _tangents(bends / self._spans[:, None], self._spans, closed, split=3)

    @property
    def segments(self) -> int:
        """Stretches between keys."""
        return len(self._spans)

    def at(self, place: float) -> View:
        """The view at a place on the path: whole numbers are the keys."""
        return self._views(np.array([place]))[0]

    def _views(self, places: F64) -> list[View]:
        made = []
        for state, turn in zip(*self._states(places), strict=True):
            half, focus = math.atan(math.exp(state[3])), math.exp(state[4])
            w, x, y, z = (float(c) for c in turn)
            place = Transform(vec3(state[:3]), normalized((w, x, y, z)))
            view = dataclasses.replace(self.keys[0], transform=place, fov=math.degrees(2 * half), focus=focus)
            made.append(view)
        return made

    def _states(self, places: F64) -> tuple[F64, F64]:
        """(N, 5) position, zoom and focus, and (N, 4) rotation at places (N,)."""
        index = np.clip(np.floor(places).astype(np.int64), 0, self.segments - 1)
        t = np.clip(places - index, 0.0, 1.0)[:, None]
        span = self._spans[index][:, None]
        values = (
            (2 * t**3 - 3 * t**2 + 1) * self._places[index]
            + (t**3 - 2 * t**2 + t) * span * self._slopes[index]
            + (3 * t**2 - 2 * t**3) * self._places[index + 1]
            + (t**3 - t**2) * span * self._slopes[index + 1]
        )
        before, after = self._turns[index], self._turns[index + 1]
        reach = span / 3
        points = [
            before,
            _product(before, _exp(reach * self._spins[index])),
            _product(after, _exp(-reach * self._spins[index + 1])),
            after,
        ]
        while len(points) > 1:
            points = [_slerp(a, b, t) for a, b in pairwise(points)]
        return values, points[0]

    def views(self, frames: int, *, even: bool = True, ease: bool = False) -> list[View]:
        """So many views along the path, the first at the first key.

        An open path ends at its last key, a closed one a step before its first. `even`: at constant speed (of
        metres, and of turning at the distance looked at), otherwise with as many frames between any two keys.
        `ease`: slowly off and slowly in; a closed path has no ends.
        """
        if frames < 1:
            raise InputError(f"{frames} frames: a path has at least one")
        shares = np.arange(frames) / (frames if self.closed else max(frames - 1, 1))
        if ease and not self.closed:
            shares = shares**2 * (3 - 2 * shares)
        places = shares * self.segments
        if even:
            grid = np.linspace(0, self.segments, STEPS * self.segments + 1)
            along = self._along(grid)
            if along[-1] > TINY:
                places = np.interp(shares * along[-1], along, grid)
        return self._views(places)

    def _along(self, grid: F64) -> F64:
        """How far the path has come at each place."""
        values, turns = self._states(grid)
        steps = self._lengths(np.diff(values, axis=0), _between(turns[:-1], turns[1:]))
        return np.concatenate([[0.0], np.cumsum(steps)])

    def _lengths(self, chords: F64, bends: F64) -> F64:
        """Metres that the eye, what it looks at, and the picture's border move, about."""
        moved = np.linalg.norm(chords[:, :3], axis=1)
        swung = np.linalg.norm(bends, axis=1) + np.abs(chords[:, 3])
        made: F64 = moved + self._reach * swung
        return made


def _zoom(view: View) -> tuple[float, float]:
    return math.log(math.tan(math.radians(view.fov) / 2)), math.log(view.focus)


def _tangents(chords: F64, spans: F64, closed: bool, split: int) -> F64:
    """(K, C) at the keys, of slopes (K − 1, C) between them: Catmull–Rom's, limited.

    Columns before `split`, and each of those after it, are limited on their own.
    """
    if closed:
        before, after = np.roll(chords, 1, axis=0), chords
        left, right = np.roll(spans, 1), spans
        made = _mean(before, after, left, right, split)
        return np.concatenate([made, made[:1]])
    inner = _mean(chords[:-1], chords[1:], spans[:-1], spans[1:], split)
    first = 1.5 * chords[:1] - 0.5 * inner[:1] if len(inner) else chords[:1]
    last = 1.5 * chords[-1:] - 0.5 * inner[-1:] if len(inner) else chords[-1:]
    return np.concatenate([first, inner, last])


def _mean(before: F64, after: F64, left: F64, right: F64, split: int) -> F64:
    made = (right[:, None] * before + left[:, None] * after) / (left + right)[:, None]
    parts = [slice(0, split), *(slice(c, c + 1) for c in range(split, made.shape[1]))]
    for part in parts:
        slower = np.minimum(np.linalg.norm(before[:, part], axis=1), np.linalg.norm(after[:, part], axis=1))
        length = np.linalg.norm(made[:, part], axis=1)
        made[:, part] *= np.minimum(1, STEEPEST * slower / np.maximum(length, TINY))[:, None]
    return made


def _same_side(turns: F64, closed: bool) -> F64:
    """Quaternions with signs that make each next one the nearer of its two; the first again if closed."""
    made = [turns[0]]
    for turn in [*turns[1:], *(turns[:1] if closed else [])]:
        made.append(-turn if np.dot(made[-1], turn) < 0 else turn)
    return np.array(made)


def _product(a: F64, b: F64) -> F64:
    """(N, 4) quaternions a · b."""
    w, v, x, u = a[:, :1], a[:, 1:], b[:, :1], b[:, 1:]
    real = w * x - (v * u).sum(axis=1, keepdims=True)
    return np.concatenate([real, w * u + x * v + np.cross(v, u)], axis=1)


def _exp(half: F64) -> F64:
    """(N, 4) unit quaternions of rotation vectors (N, 3) of half angles."""
    angle = np.linalg.norm(half, axis=1, keepdims=True)
    return np.concatenate([np.cos(angle), np.sinc(angle / np.pi) * half], axis=1)


def _between(a: F64, b: F64) -> F64:
    """(N, 3) rotation vectors of half angles from unit quaternions to others, in the first's frame."""
    turn = _product(a * (1, -1, -1, -1), b)
    length = np.linalg.norm(turn[:, 1:], axis=1, keepdims=True)
    made: F64 = turn[:, 1:] * np.where(
        length < 1e-12, 1.0, np.arctan2(length, turn[:, :1]) / np.maximum(length, 1e-12)
    )
    return made


def _slerp(a: F64, b: F64, t: F64) -> F64:
    return _product(a, _exp(t * _between(a, b)))


def rotation_between(a: Quat, b: Quat) -> float:
    """Degrees of the shortest turn between two rotations."""
    away = _between(np.array([a]), np.array([b]))
    half = float(np.linalg.norm(away))
    return math.degrees(2 * min(half, math.pi - half))
