"""The paper's own path as a source of nodes: products of SVC and VCF instead of traced visibility."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from studio_core.kernels.light_tree import LightTree
from studio_core.parallel import Workers
from studio_core.shading.artifacts import Casters, Surfaces
from studio_core.shading.job import Job
from studio_plugins.cuts.nodes import NodeTable
from studio_plugins.cuts.occluders import occluder_keys
from studio_plugins.cuts.paper.path import PaperPath
from studio_plugins.cuts.paper.settings import PaperParams

I64 = npt.NDArray[np.int64]


class PaperLight:
    """Nodes of equation (3) for the vertices that are asked for; owned by the compute thread."""

    def __init__(self, workers: Workers) -> None:
        self.table = NodeTable(0)
        self.path: PaperPath | None = None
        self._workers = workers
        self._known: tuple[Any, ...] = ()
        self._points: I64 = np.zeros(0, np.int64)

    def gather(
        self,
        surfaces: Surfaces,
        casters: Casters,
        tree: LightTree,
        points: I64,
        params: PaperParams,
        job: Job,
    ) -> int:
        """Nodes and irradiance of the points; how many were made."""
        mesh = surfaces.mesh
        if self.path is None or self.path.params != params:
            self.path = PaperPath(self._workers, params)
        if len(self.table) != len(mesh.positions):
            self.table = self.table.resized(len(mesh.positions))
        known = (mesh, tree, self.path)
        same = len(known) == len(self._known) and all(a is b for a, b in zip(known, self._known, strict=True))
        if same and np.array_equal(points, self._points):
            return 0
        todo = np.setdiff1d(points, self._points) if same else points
        self._known, self._points = (), np.zeros(0, np.int64)
        self.path.place(mesh, casters.shadow, occluder_keys(surfaces, casters))
        self.path.prepare(todo, job)
        self.table.irradiance[todo] = self.path.irradiance(todo, tree, job)
        self.table.replace(self.path.nodes(todo, tree, job))
        self._known, self._points = known, points
        return len(todo)
