"""Elements that strokes lie on, and the light that arrives at them: no others are asked (listing 1).

An element that no stroke touches has no reason to change. So rays are traced for those alone, one in each
cell; what is met sends what the light between surfaces says, and where nothing is met there is the sky,
averaged over as much as the cell is wide. Lamps and suns are added where they are (`straight`).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from studio_core.kernels.directions import direction_set
from studio_core.parallel import Checkpoints, Workers
from studio_core.scene.nodes import Light, Scene
from studio_core.scene.world_mesh import WorldMesh
from studio_core.shading.artifacts import Lighting
from studio_core.strokes.solution import Lit
from studio_core.transport.bounces import sent_towards
from studio_core.transport.cells import CELLS, PARTS, RINGS, cell_directions
from studio_core.transport.hits import NOTHING
from studio_core.transport.operator import Transport
from studio_plugins.slf.elements import Elements
from studio_plugins.slf.links import cell_pattern, frames_of
from studio_plugins.slf.series import series_of
from studio_plugins.slf.skylight import DIRECTIONS, FINENESS, averages, size_of_ring
from studio_plugins.slf.straight import StraightLight
from studio_plugins.slf.whole import BURIED

F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]
I64 = npt.NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Around:
    """Of E elements: series (E, 3, RINGS, WIDTH) of what arrives, frames (E, 3, 3); rays that were traced.

    Nothing arrives at those that are buried in something.
    """

    series: F32
    frames: F32
    rays: int


class Touched:
    """What elements near strokes see, kept. Owned by the compute thread."""

    def __init__(self, workers: Workers) -> None:
        self._workers = workers
        self._table = Transport(workers, cell_pattern())
        self._straight = StraightLight(workers)
        self._elements: tuple[object, Elements] | None = None
        self._sky: tuple[object, F32] | None = None

    def owners(self, mesh: WorldMesh, key: object, vertices: I64) -> I64:
        """The elements, as vertices, that vertices (N,) belong to; itself where that is of another slot."""
        if self._elements is None or self._elements[0] != key:
            self._elements = (key, Elements.of(mesh, np.ones(len(mesh), np.bool_)))
        every = self._elements[1]
        element = every.vertex[every.owner[vertices]]
        slot = np.concatenate([placed.mesh.slot for placed in mesh.objects])
        same = (mesh.object[element] == mesh.object[vertices]) & (slot[element] == slot[vertices])
        return np.where(same, element, vertices)

    def light(self, scene: Scene, lit: Lit, vertices: I64, job: Checkpoints | None = None) -> Around:
        """What arrives at the elements `vertices` (E,), all different."""
        surfaces = lit.surfaces.unrefined
        mesh = surfaces.mesh
        wanted = np.zeros(len(mesh), np.bool_)
        wanted[vertices] = True
        rays = self._table.update(surfaces, lit.casters, wanted, job).rays
        where = self._table.row_of[vertices].astype(np.int64)
        met, cell = self._table.table.vertex[where], self._table.table.cell[where]
        light = np.zeros((len(vertices), CELLS, 3), np.float32)
        known = met < len(mesh)
        if lit.indirect is not None and lit.indirect.sent is not None:
            sent, surface = lit.indirect.sent.light, lit.indirect.sent.surface
            hit, back = met[known].astype(np.int64), cell[known].astype(np.int64)
            light[known] = sent_towards(sent, surface, hit, back, self._workers, None)
        frames = frames_of(mesh, vertices)
        sky = self._sky_of(scene, lit.lighting, job)
        if sky is not None:
            row, ray = np.nonzero(met == NOTHING)
            ways = np.einsum("nkc,nk->nc", frames[row], cell_directions()[ray])
            leaf = direction_set(FINENESS).leaf_of(ways)
            light[row, ray] = sky[size_of_ring()[ray // PARTS] * DIRECTIONS + leaf]
        made = light.swapaxes(1, 2).reshape(len(vertices), 3, RINGS, PARTS)
        series = series_of(made)
        lights = {node.id: node for node in scene.of(Light) if scene.shown(node.id)}
        own = Elements(vertices, np.zeros(0, np.int32), np.zeros(0))
        rays += self._straight.update(lit.surfaces, lit.casters, lit.lighting, lights, own, job)
        self._straight.add_to(series, 0, frames)
        series[self._table.share_back[where] > BURIED] = 0
        return Around(series, frames, rays)

    def _sky_of(self, scene: Scene, lighting: Lighting, job: Checkpoints | None) -> F32 | None:
        """(SKY, 3) of `skylight`, with its gain; None where there is none."""
        tree, environment = lighting.tree, lighting.environment
        node = None if environment is None else scene.nodes.get(environment.id)
        if tree is None or not isinstance(node, Light) or not scene.shown(node.id):
            return None
        if self._sky is None or self._sky[0] != lighting.integrated:
            self._sky = (lighting.integrated, averages(tree, self._workers, job))
        return np.asarray(self._sky[1] * np.asarray(node.gain(), np.float32), np.float32)


__all__ = ["Around", "Touched"]
