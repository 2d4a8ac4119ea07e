"""Kept rays by the lobes of glossy receivers; drawn anew where eye, material or pose are others."""

from __future__ import annotations

import operator
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from studio_core.contract import Services
from studio_core.scene.nodes import Scene
from studio_core.shading.artifacts import Casters, Receivers, Shapes, Surfaces
from studio_core.shading.job import Job
from studio_core.transport.lobes import Lobes, LobeTable, draw_lobes, spread_numbers
from studio_core.transport.operator import RayTransport
from studio_core.transport.patterns import variants_of

F32 = npt.NDArray[np.float32]
CHUNK = 1 << 8
VARIANTS = 64
SEED = 3000


@dataclass(frozen=True, eq=False)
class Drawn:
    """Lobes, `count` rays each along directions (G, count, 3); no transport where nobody has a lobe."""

    lobes: Lobes
    count: int
    directions: F32
    transport: RayTransport | None
    rays: int


class LobeRays:
    """Owned by the compute thread."""

    def __init__(self, services: Services) -> None:
        self._workers = services.workers
        self._table = LobeTable(services.registry)
        self._rays = 0
        self._transport = RayTransport(services.workers, 0)
        self._numbers: dict[tuple[int, int], F32] = {}
        self._drawn: tuple[tuple[object, ...], Drawn] | None = None

    @property
    def nbytes(self) -> int:
        """Bytes of kept rays."""
        return self._transport.nbytes

    def update(
        self,
        scene: Scene,
        surfaces: Surfaces,
        casters: Casters,
        shapes: Shapes,
        receivers: Receivers,
        count: int,
        job: Job,
    ) -> Drawn:
        """Rays of all glossy receivers; those that go where they went are not traced again.

        Where only light is another, nobody is asked.
        """
        key = surfaces, casters, shapes, receivers
        known = self._drawn
        if known is not None and known[1].count in (0, count) and all(map(operator.is_, known[0], key)):
            return replace(known[1], rays=0)
        self._drawn = None
        made = self._draw(scene, *key, count, job)
        self._drawn = key, made
        return made

    def _draw(
        self,
        scene: Scene,
        surfaces: Surfaces,
        casters: Casters,
        shapes: Shapes,
        receivers: Receivers,
        count: int,
        job: Job,
    ) -> Drawn:
        mesh, row = surfaces.mesh, shapes.rows(surfaces.mesh)
        lobes = self._table(scene, surfaces.materials, shapes)
        glossy = np.append(lobes.rows, False)[row] & receivers.seen
        rows = np.flatnonzero(glossy)
        directions = np.zeros((len(rows), count, 3), np.float32)
        if not len(rows):
            return Drawn(lobes, 0, directions, None, 0)
        numbers = self._spread(shapes.width, count)
        eye = (receivers.eye - mesh.origin).astype(np.float32)
        variant = variants_of(rows, VARIANTS)

        def draw(start: int, stop: int) -> None:
            draw_lobes(
                start,
                stop,
                rows,
                variant,
                mesh.positions,
                mesh.normals,
                mesh.tangents,
                row,
                eye,
                shapes.offset,
                shapes.data,
                lobes.sampler,
                lobes.peaked,
                numbers,
                directions,
            )

        self._workers.run(len(rows), CHUNK, draw, job)
        if count != self._rays:
            self._transport, self._rays = RayTransport(self._workers, count), count
        done = self._transport.update(surfaces, casters, rows, directions, job)
        return Drawn(lobes, count, self._transport.directions, self._transport, done.rays)

    def _spread(self, terms: int, count: int) -> F32:
        """(VARIANTS, terms, count, 2) evenly spread numbers in [0, 1)."""
        key = (terms, count)
        if key not in self._numbers:
            self._numbers[key] = spread_numbers(VARIANTS, terms, count, SEED)
        return self._numbers[key]
