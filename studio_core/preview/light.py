"""The light that previews stand in: a scene's environment, small and blurred in steps, and its suns."""

from __future__ import annotations

import functools
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from studio_core.imaging.latlong import direction_to_uv, pixel_directions, pixel_solid_angles
from studio_core.imaging.resample import resize_area
from studio_core.imaging.sphere import even_rows, lookup, with_border
from studio_core.kernels.environment import checked_map
from studio_core.kernels.suns import Sun, split_suns
from studio_core.scene.nodes import Environment
from studio_core.shading.materials import linear_rgb

F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]

ROWS = 256  # of the finest level: 0.7°
_COARSEST = 8
_BORDER = 1
_SUN_SAMPLES = 4  # the ball widens them anyway


@dataclass(frozen=True, eq=False)
class PreviewLight:
    """Radiance from all around at unit gain: what has equal `key` is the same light.

    `levels` are equirectangular pictures in the world's frame turned by `turn` (3, 3, from the world), each
    half as fine as the one before, with a border; `sun` is in the world. `average` (3,) is the mean over all
    directions, suns included.
    """

    key: tuple[object, ...]
    levels: tuple[F32, ...]
    turn: F64
    sun: Sun | None
    average: F64

    def radiance(self, directions: npt.NDArray[np.floating], solid: npt.NDArray[np.floating]) -> F32:
        """(K, J, 3) towards world directions (K, J, 3), blurred over about `solid` (J,) steradians each.

        Suns are left out.
        """
        u, v = direction_to_uv(directions @ self.turn.T)
        rows = self.levels[0].shape[0] - 2 * _BORDER
        with np.errstate(divide="ignore"):
            wanted = np.log2(np.sqrt(np.asarray(solid, np.float64)) * rows / np.pi)
        level = np.clip(np.rint(wanted), 0, len(self.levels) - 1).astype(np.intp)
        made = np.empty((*u.shape, 3), np.float32)
        for index in np.unique(level):
            own = np.flatnonzero(level == index)
            made[:, own] = lookup(self.levels[index], _BORDER, u[:, own], v[:, own])
        return made


def environment_key(environment: Environment | None) -> tuple[object, ...]:
    """What `environment_light` depends on."""
    if environment is None:
        return ("neutral",)
    return (environment.image.key, environment.azimuth, environment.tilt)


def environment_light(environment: Environment | None) -> PreviewLight:
    """The light of an environment at unit gain; a neutral room where there is none.

    Raises InputError where the picture cannot light anything.
    """
    key = environment_key(environment)
    if environment is None:
        return _neutral()
    turn = environment.rotation().matrix()[:3, :3].T
    pixels, sun = split_suns(checked_map(linear_rgb(environment.image)))
    shining = sun.turned(turn.T).coarsened(_SUN_SAMPLES) if sun is not None else None
    return _prepared(key, pixels, turn, shining)


def _prepared(key: tuple[object, ...], pixels: F32, turn: F64, sun: Sun | None) -> PreviewLight:
    weight = pixel_solid_angles(*pixels.shape[:2])
    average = weight @ pixels.sum(axis=1, dtype=np.float64) / (4 * np.pi)
    if sun is not None:
        average = average + sun.irradiance.sum(axis=0, dtype=np.float64) / (4 * np.pi)
    rows = ROWS
    levels = []
    level = resize_area(np.ascontiguousarray(pixels), rows, 2 * rows)
    while rows >= _COARSEST:
        levels.append(with_border(even_rows(level, np.pi / rows), _BORDER))
        rows //= 2
        level = _halved(level)
    return PreviewLight(key, tuple(levels), turn, sun, average)


def _halved(pixels: F32) -> F32:
    """Half as many rows and columns, weighted by solid angle."""
    height, width = pixels.shape[:2]
    weight = np.repeat(pixel_solid_angles(height, width)[:, None, None], width, axis=1)
    parts = (height // 2, 2, width // 2, 2, -1)
    light = (pixels * weight).reshape(parts).sum(axis=(1, 3))
    return np.asarray(light / weight.reshape(parts).sum(axis=(1, 3)), np.float32)


@functools.cache
def _neutral() -> PreviewLight:
    """A grey room with a bright window to the left: for scenes without an environment.

    Immutable, and the same for everybody.
    """
    directions = pixel_directions(128, 256)
    up = directions[..., 1]
    grey = 0.35 + 0.25 * up
    window = np.array([-0.62, 0.5, 0.6])
    window /= np.linalg.norm(window)
    across = np.cross([0.0, 1.0, 0.0], window)
    across /= np.linalg.norm(across)
    high = np.cross(window, across)
    toward = directions @ window
    with np.errstate(divide="ignore", invalid="ignore"):
        x, y = directions @ across / toward, directions @ high / toward
    inside = (toward > 0) & (np.abs(x) < 0.45) & (np.abs(y) < 0.55) & (np.abs(x) > 0.03)
    pixels = np.repeat((grey + 7.0 * inside)[..., None], 3, axis=2).astype(np.float32)
    return _prepared(("neutral",), pixels, np.eye(3), None)


__all__ = ["PreviewLight", "environment_key", "environment_light"]
