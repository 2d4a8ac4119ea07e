"""From which side most light comes: the sun's, or the brightest place of the environment."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import numpy.typing as npt

from studio_core.imaging.latlong import equirect_direction, pixel_solid_angles
from studio_core.scene.diff import Changes
from studio_core.scene.geometry import Image
from studio_core.scene.nodes import DirectionalLamp, Environment, Scene
from studio_core.shading.job import Job
from studio_core.signal import Signal
from studio_ui.context import Context, Subscriptions

F64 = npt.NDArray[np.float64]
_PARTS = (32, 64)
"""Rows and columns that an environment is summed into."""
_MARKED = 4.0
"""Times the mean that a part must give at least, or light comes from no side."""


class MainLight:
    """`changed(direction)`: (3,) in the world, or None. Environments are looked at on the files' thread."""

    def __init__(self, context: Context) -> None:
        self.direction: F64 | None = None
        self.changed: Signal[[F64 | None]] = Signal()
        self._context = context
        self._known: tuple[Image, F64 | None] | None = None
        self._asked: Image | None = None
        self._subscriptions = Subscriptions()
        self._subscriptions.add(context.document.changed.connect(self._edited))
        self.refresh()

    def close(self) -> None:
        """Stop following."""
        self._subscriptions.close()

    def refresh(self) -> None:
        """What the scene has now."""
        scene = self._context.document.scene
        sun = next((lamp for lamp in scene.of(DirectionalLamp) if scene.shown(lamp.id)), None)
        if sun is not None:
            self._tell(scene.world(sun.id).matrix()[:3, 2] / scene.world(sun.id).scale)
            return
        environment = next((e for e in scene.of(Environment) if scene.shown(e.id)), None)
        if environment is None:
            self._tell(None)
        elif self._known is not None and self._known[0] is environment.image:
            own = self._known[1]
            self._tell(None if own is None else environment.rotation().matrix()[:3, :3] @ own)
        else:
            self._look_at(environment.image)

    def _edited(self, before: Scene, after: Scene, changes: Changes) -> None:
        self.refresh()

    def _tell(self, direction: F64 | None) -> None:
        self.direction = direction
        self.changed.emit(direction)

    def _look_at(self, image: Image) -> None:
        if image is self._asked:
            return
        self._asked = image

        def work(job: Job) -> F64 | None:
            return brightest(image.pixels)

        def done(found: F64 | None) -> None:
            self._known, self._asked = (image, found), None
            self.refresh()

        self._context.tasks.run("Looking where light comes from", work, done, quiet=True)


def brightest(pixels: npt.NDArray[np.generic]) -> F64 | None:
    """(3,) direction of the part of an equirectangular picture (H, W, C) that gives most light.

    Parts of equal angles are compared by their solid angle times their mean; None for an even sky.
    """
    height, width = pixels.shape[:2]
    rows = np.unique(np.linspace(0, height, min(_PARTS[0], height) + 1).astype(int))
    columns = np.unique(np.linspace(0, width, min(_PARTS[1], width) + 1).astype(int))
    grey = np.stack([pixels[a:b].mean(axis=2).sum(axis=0) for a, b in pairwise(rows)])
    power = np.add.reduceat(np.asarray(grey, np.float64), columns[:-1], axis=1)
    middle = (rows[:-1] + rows[1:]) // 2
    power *= pixel_solid_angles(height, width)[np.minimum(middle, height - 1), None]
    row, column = np.unravel_index(int(power.argmax()), power.shape)
    if power[row, column] < _MARKED * power.mean():
        return None
    u = (columns[column] + columns[column + 1]) / 2 / width
    v = (rows[row] + rows[row + 1]) / 2 / height
    return equirect_direction(u, v)
