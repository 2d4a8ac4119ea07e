"""The stage that gathers all lights: the environment integrated over directions, and the lamps."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from studio_core.contract import Services
from studio_core.kernels.directions import LARGEST
from studio_core.kernels.environment import integrate_environment
from studio_core.kernels.light_tree import LightTree
from studio_core.scene.diff import Aspect
from studio_core.scene.nodes import Environment
from studio_core.shading.artifacts import Lighting
from studio_core.shading.frame import Frame
from studio_core.shading.job import Job
from studio_core.shading.lamps import lamps, shown_environment
from studio_core.shading.materials import linear_rgb
from studio_core.shading.pipeline import Inputs

F32 = npt.NDArray[np.float32]


class LightingStage:
    """The environment integrated over the finest leaves there are, and all lamps, at unit gain."""

    needs: tuple[type, ...] = ()
    gives = Lighting
    dirtied_by = Aspect.LIGHT

    def __init__(self, services: Services) -> None:
        self._workers = services.workers
        self._cache = services.cache

    def run(self, frame: Frame, inputs: Inputs, job: Job) -> Lighting:
        """Integrates again only for another picture, rotation or finer directions."""
        scene = frame.scene
        environment = shown_environment(scene)
        tree: LightTree | None = None
        key: tuple[object, ...] = ()
        if environment is not None:
            key = (environment.image.key, environment.azimuth, environment.tilt)
            previous: Lighting | None = inputs.previous
            if previous is not None and previous.integrated == key:
                tree = previous.tree
            else:
                turned = previous is not None and previous.integrated[:1] == key[:1]
                tree = LightTree.build(self._leaves(environment, key, job, keep=not turned))
        return Lighting(environment, tree, lamps(scene), key)

    def _leaves(self, environment: Environment, key: tuple[object, ...], job: Job, keep: bool) -> F32:
        method = "environment over 2^17 leaves, 1"
        kept = self._cache.get(method, *key) if self._cache is not None else None
        if kept is not None and kept["leaves"].shape == (1 << LARGEST, 3):
            found: F32 = kept["leaves"]
            return found
        rotation = environment.rotation().matrix()[:3, :3]
        pixels = linear_rgb(environment.image)
        leaves = integrate_environment(pixels, rotation, LARGEST, self._workers, job)
        if self._cache is not None and keep:  # not every step of a turn
            self._cache.put({"leaves": leaves}, method, *key)
        return leaves
