"""The photograph that a scene stands in: behind what is seen, and on surfaces that catch shadows.

A surface that catches shadows shows the photograph times the irradiance that arrives there over what arrived
when nothing stood there (Debevec, SIGGRAPH 1998, section 5). Lamps of the scene brighten it; what it hides of
the light is in the photograph already, so it casts no shadow itself.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
import numpy.typing as npt

from studio_core.arrays import readonly
from studio_core.kernels.background import FAR_AWAY, backdrop_at, background_hits
from studio_core.kernels.compose import add_samples
from studio_core.parallel import Workers
from studio_core.scene.nodes import ON_THE_GROUND, Environment, Light, Scene
from studio_core.scene.transform import rotation_matrix
from studio_core.session import View
from studio_core.shading.artifacts import Backdrop, Ground, Hits, Radiance
from studio_core.shading.job import Job
from studio_core.shading.kept import Kept
from studio_core.shading.lamps import shown_environment
from studio_core.shading.layers import EVERY, NO_COLOUR, PIXELS, Part, averaged
from studio_core.shading.materials import linear_rgb
from studio_core.shading.open_light import OpenLight
from studio_core.shading.primary import pinhole

F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]
I64 = npt.NDArray[np.int64]
WHITE = np.ones(3, np.float32)
ROOM = 1.25  # of a dome around the eye


@dataclass(frozen=True, eq=False)
class Behind:
    """The backdrop in a part: of its pixels (P, 3), and per layer (N, 3) behind the hits that are caught.

    The first has the environment's gain, the others have not: there light is counted by the radiance.
    """

    pixels: F32
    caught: tuple[F32, ...]


NOTHING = Behind(NO_COLOUR, ())


class BackdropPainter:
    """What of an environment is seen. Owned by the compute thread."""

    def __init__(self, workers: Workers) -> None:
        self._workers = workers
        self._sky: Kept[F32] = Kept()
        self._open: Kept[OpenLight] = Kept()
        self._before: Kept[F64] = Kept()
        self._turned: tuple[float, float] | None = None

    def backdrop(self, scene: Scene) -> Backdrop | None:
        """The environment that is seen; None where there is none."""
        environment = shown_environment(scene)
        if environment is None or not environment.background:
            return None
        to_picture = environment.background_rotation().matrix()[:3, :3].T.astype(np.float32)
        gain = np.array(environment.gain(), np.float32)
        return Backdrop(self._pixels(environment), to_picture, gain, ground_of(environment))

    def behind(self, backdrop: Backdrop, part: Part, job: Job | None) -> Behind:
        """What the pixels of a part see beside objects and through them, and what objects there catch."""
        layers, view = part.layers, part.layers[0].hits.view
        samples, lens = part.of_picture(EVERY), pinhole(view)
        sky = (*way_into(backdrop, view), backdrop.pixels)

        def look(start: int, stop: int, values: F32) -> None:
            background_hits(start, stop, lens, samples, layers[0].hits.face, *sky, backdrop.gain, values)

        out = averaged(layers[0], look, NO_COLOUR, self._workers, job)
        for layer in layers[1:]:
            values = np.empty((len(layer.samples), 3), np.float32)
            place = part.of_picture(layer.samples)
            background_hits(0, len(values), lens, place, layer.hits.face, *sky, backdrop.gain, values)
            add_samples(layer.samples, layer.hits.samples**2, layer.weight, values, out)
        caught = [
            self.under(backdrop, layer.hits, layer.caught, part.of_picture(layer.caught_samples), job)
            for layer in layers
        ]
        return Behind(out, tuple(caught))

    def under(self, backdrop: Backdrop, hits: Hits, rows: I64, samples: I64, job: Job | None = None) -> F32:
        """(N, 3) the photograph, without gain, that some hits (N,) meet, which are samples of the picture."""
        values = np.empty((len(rows), 3), np.float32)
        if len(rows):
            sky = (*way_into(backdrop, hits.view), backdrop.pixels, WHITE)
            given = (pinhole(hits.view), samples, hits.distance[rows], *sky, values)
            self._workers.run(len(rows), PIXELS, partial(_look_at, given), job)
        return values

    def light(self, scene: Scene, radiance: Radiance, record: F32) -> None:
        """What catches shadows is black by itself; record[:, 3:6] becomes what the photograph is multiplied
        with: the irradiance that arrives over what arrived from an environment at unit gain. Vertices of
        which nothing is known are taken for open ones.
        """
        mesh, catches = radiance.surfaces.mesh, radiance.surfaces.catches
        rows = np.flatnonzero(np.append(catches, False)[mesh.material])
        record[rows, :6] = 0
        environment = shown_environment(scene)
        if environment is None or not environment.background:
            return
        turned = (environment.azimuth, environment.tilt)
        if turned != self._turned:
            self._turned, self._before = turned, Kept()
        kept = (mesh.normals, mesh.material, catches, environment.image)
        before = self._before(lambda: self.before(environment, mesh.normals[rows]), *kept)
        lights = {node.id: node for node in scene.of(Light) if scene.shown(node.id)}
        now = radiance.irradiance(lights)[rows]
        ratio = np.divide(now, before, out=np.zeros(now.shape), where=before > 0)
        record[rows, 3:6] = np.where(radiance.valid[rows, None], ratio, environment.gain())

    def before(self, environment: Environment, normals: F32) -> F64:
        """(N, 3) irradiance at unit gain of places where nothing stands, with normals (N, 3) in the world."""
        pixels = self._pixels(environment)
        light = self._open(lambda: OpenLight(pixels), pixels)
        return light.irradiance(normals @ environment.rotation().matrix()[:3, :3])

    def _pixels(self, environment: Environment) -> F32:
        return self._sky(lambda: readonly(linear_rgb(environment.image), np.float32), environment.image)


def ground_of(environment: Environment) -> Ground | None:
    """Where an environment's picture lies on the ground; None where it is far away."""
    if environment.projection != ON_THE_GROUND:
        return None
    return Ground(environment.transform.translation, environment.ground_height, environment.ground_radius)


def way_into(backdrop: Backdrop, view: View) -> tuple[F32, F64]:
    """How camera rays of a view lead into a backdrop: turn and dome of `kernels.background`.

    The dome grows with an eye that steps back, so that it stays inside and the ground lies still.
    """
    camera = rotation_matrix(view.transform.rotation)
    ground = backdrop.ground
    if ground is None:
        return np.ascontiguousarray(backdrop.turn @ camera, np.float32), FAR_AWAY
    x, y, z = np.subtract(view.transform.translation, ground.centre)
    radius = max(ground.radius, ROOM * float(np.linalg.norm((x, y, z))))
    dome = np.array([x, y - ground.height, z, ground.height, radius, *camera.ravel()])
    return np.ascontiguousarray(backdrop.turn), dome


def _look_at(given: tuple[Any, ...], start: int, stop: int) -> None:
    backdrop_at(start, stop, *given)
