"""The stage that gathers all lights: the environment integrated over directions, its suns, and the lamps.

At rest the environment is integrated exactly. While a hand turns it, the leaves that were integrated last
are turned: milliseconds, and up to half a leaf beside the truth.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from studio_core.contract import Services
from studio_core.kernels.directions import LARGEST
from studio_core.kernels.environment import EnvironmentMap, checked_map
from studio_core.kernels.light_tree import LightTree, rotate_radiance
from studio_core.kernels.suns import Sun, split_suns
from studio_core.scene.diff import Aspect
from studio_core.scene.nodes import Environment
from studio_core.shading.artifacts import Lighting
from studio_core.shading.frame import Frame
from studio_core.shading.job import Job
from studio_core.shading.lamps import lamps, shown_environment
from studio_core.shading.materials import linear_rgb
from studio_core.shading.pipeline import Inputs

F64 = npt.NDArray[np.float64]
TURNING = 15  # 2^15 leaves while a hand turns the light
METHOD = "environment over 2^17 leaves and suns, 2"


@dataclass(frozen=True)
class _Integrated:
    """An environment as it was last integrated."""

    key: tuple[object, ...]
    rotation: F64
    """World from the picture's frame, (3, 3)."""
    tree: LightTree
    sun: Sun | None
    """In the picture's frame."""
    turned_sun: Sun | None
    ready: EnvironmentMap | None
    """The picture without suns, for other rotations; None where its leaves came from the disk."""

    @property
    def picture(self) -> object:
        """Which it was."""
        return self.key[0]


class LightingStage:
    """The environment over the finest leaves there are, what is too compact for them, and all lamps.

    All at unit gain.
    """

    needs: tuple[type, ...] = ()
    gives = Lighting
    dirtied_by = Aspect.LIGHT | Aspect.VIEW  # VIEW: the frame at rest after a turn

    def __init__(self, services: Services) -> None:
        self._workers = services.workers
        self._cache = services.cache
        self._last: _Integrated | None = None

    def run(self, frame: Frame, inputs: Inputs, job: Job) -> Lighting:
        """The previous where no light changed and it is as exact as asked for."""
        scene = frame.scene
        previous: Lighting | None = inputs.previous
        unchanged = previous is not None and not inputs.changes.aspects & Aspect.LIGHT
        if previous is not None and unchanged and (frame.moving or not previous.coarse):
            return previous
        environment = shown_environment(scene)
        if environment is None:
            return Lighting(None, None, lamps(scene))
        key: tuple[object, ...] = (environment.image.key, environment.azimuth, environment.tilt)
        last = self._last
        if frame.moving and last is not None and last.picture == key[0] and last.key != key:
            key = (*key, TURNING)
            if previous is not None and previous.integrated == key:
                tree, sun = previous.tree, previous.sun
            else:
                tree, sun = self._turned(environment, last, job)
            return Lighting(environment, tree, lamps(scene), key, sun, coarse=True)
        if last is None or last.key != key:
            last = self._last = self._integrated(environment, key, last, job)
        return Lighting(environment, last.tree, lamps(scene), key, last.turned_sun)

    def _turned(self, environment: Environment, last: _Integrated, job: Job) -> tuple[LightTree, Sun | None]:
        rotation = environment.rotation().matrix()[:3, :3]
        way = rotation @ last.rotation.T
        leaves = rotate_radiance(last.tree.radiance, way, TURNING, self._workers, job)
        sun = last.sun.turned(rotation) if last.sun is not None else None
        return LightTree.build(leaves, self._workers), sun

    def _integrated(
        self, environment: Environment, key: tuple[object, ...], last: _Integrated | None, job: Job
    ) -> _Integrated:
        rotation = environment.rotation().matrix()[:3, :3]
        same_picture = last is not None and last.picture == key[0]
        kept = self._cache.get(METHOD, *key) if self._cache is not None else None
        ready = last.ready if last is not None and same_picture else None
        if kept is not None and kept["leaves"].shape == (1 << LARGEST, 3):
            leaves, sun = kept["leaves"], _from_arrays(kept)
        else:
            sun = last.sun if last is not None and same_picture else None
            if ready is None:
                pixels, sun = split_suns(checked_map(linear_rgb(environment.image)))
                ready = EnvironmentMap.prepare(pixels, LARGEST, self._workers, job)
            leaves = ready.over_leaves(rotation, self._workers, job)
            if self._cache is not None and not same_picture:  # not every step of a turn
                self._cache.put({"leaves": leaves, **_as_arrays(sun)}, METHOD, *key)
        tree = LightTree.build(leaves, self._workers)
        return _Integrated(key, rotation, tree, sun, sun.turned(rotation) if sun else None, ready)


def _as_arrays(sun: Sun | None) -> dict[str, npt.NDArray[Any]]:
    if sun is None:
        return {"parts": np.zeros(1, np.int64)}
    return {"directions": sun.directions, "irradiance": sun.irradiance, "parts": sun.parts}


def _from_arrays(kept: Mapping[str, npt.NDArray[Any]]) -> Sun | None:
    if len(kept["parts"]) < 2:
        return None
    return Sun(kept["directions"], kept["irradiance"], kept["parts"])
