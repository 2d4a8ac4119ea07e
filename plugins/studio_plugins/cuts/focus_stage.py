"""The stage that splits nodes further for sharp materials, for the eye that looks now."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from studio_core.colour import LUMINANCE
from studio_core.contract import Registry, Services
from studio_core.scene.diff import Aspect
from studio_core.scene.nodes import Material, NodeId, Scene
from studio_core.shading.artifacts import Shapes, Surfaces
from studio_core.shading.frame import Frame
from studio_core.shading.job import Job
from studio_core.shading.materials import coefficients, resolve
from studio_core.shading.pipeline import Inputs
from studio_plugins.cuts.choose import MOST_NODES, Prefix
from studio_plugins.cuts.focus import focus_nodes
from studio_plugins.cuts.light_stage import Arriving
from studio_plugins.cuts.lobes import LobeTable
from studio_plugins.cuts.nodes import FLOATS, NodeBlock, NodeTable, starts
from studio_plugins.cuts.quality import quality
from studio_plugins.cuts.visibility_stage import Seen

F32 = npt.NDArray[np.float32]
I64 = npt.NDArray[np.int64]
Bools = npt.NDArray[np.bool_]

BROADEST = 1.5  # slope of lobes for which nodes do as they are
SHARPER = 0.85  # a lobe narrower than this share of the one that nodes were split for needs them split again
AHEAD = 0.7  # of the width of a lobe is split for while it changes
MOVING = 6.0  # times as much is allowed while somebody looks around or turns the light
DRIFT = 0.25  # share of a lobe's width that the way to the eye may turn by while somebody looks around
_ROOM = 512


@dataclass(frozen=True, eq=False)
class Focused:
    """Tables of nodes of every layer.

    layers: per light, pairs of a table and the one that stands in for it at the vertices it owns, or None.
    """

    layers: tuple[tuple[NodeId, tuple[tuple[NodeTable, NodeTable | None], ...]], ...]
    newest: tuple[int, ...]


class FocusStage:
    """Keeps split nodes while eye, light and visibility stay and no lobe becomes much sharper."""

    needs: tuple[type, ...] = (Surfaces, Shapes, Seen, Arriving)
    gives = Focused
    dirtied_by = Aspect.VIEW | Aspect.QUALITY | Aspect.MATERIAL

    def __init__(self, services: Services, lobes: LobeTable) -> None:
        self._workers = services.workers
        self._lobes = lobes
        self._weights = LobeWeights(services.registry)
        self._table = NodeTable(0)
        self._version: I64 = np.zeros(0, np.int64)
        self._alpha: F32 = np.zeros(0, np.float32)
        self._tolerance: F32 = np.zeros(0, np.float32)
        self._eye: F32 = np.zeros((0, 3), np.float32)
        self._positions: F32 = np.zeros((0, 3), np.float32)
        self._state: tuple[object, ...] = ()

    def run(self, frame: Frame, inputs: Inputs, job: Job) -> Focused:
        """The previous where nothing had to be split."""
        arriving, seen = inputs[Arriving], inputs[Seen]
        mesh = inputs[Surfaces].mesh
        base, prefix = arriving.environment, arriving.prefix
        if base is not None and prefix is not None:
            shapes = inputs[Shapes]
            lobes = self._lobes(shapes)
            slopes = [lobe.slope if lobe.slope < BROADEST else 0.0 for lobe in lobes]
            alpha = np.array([*slopes, 0.0], np.float32)
            wanted = quality(frame.params.quality).lobe
            eye = (np.asarray(frame.view.transform.translation, np.float64) - mesh.origin).astype(np.float32)
            self._follow(seen, prefix, mesh.positions)
            mine = alpha[shapes.rows(mesh)]
            asked = seen.summed & (mine > 0)
            stale = (self._version != base.version) | (mine < SHARPER * self._alpha)
            if not frame.moving:
                stale |= (self._tolerance > wanted) | (self._eye != eye).any(axis=1)
            rows = np.flatnonzero(asked & ~stale)
            rows = rows[(self._eye[rows] != eye).any(axis=1)]
            stale[rows] = turned(mesh.positions[rows], self._eye[rows], eye) > DRIFT * mine[rows]
            stale &= asked
            self._version[mine <= 0] = -1  # what gets sharp again is split again
            self._table.drop(self._version != base.version)
            if stale.any():
                weights = shapes.of_rows(self._weights(frame.scene, inputs[Surfaces].materials))
                tolerance = MOVING * wanted if frame.moving else wanted
                ahead = np.float32(AHEAD if frame.moving else 1)  # a slider goes on the way it goes
                self._split(base, prefix, inputs, stale, eye, ahead * alpha, weights, tolerance, job)
                self._version[stale], self._alpha[stale] = base.version[stale], ahead * mine[stale]
                self._tolerance[stale], self._eye[stale] = tolerance, eye
        layers = []
        for node, tables in arriving.layers:
            pairs = [(table, self._table if table is base else None) for table in tables]
            layers.append((node, tuple(pairs)))
        newest = (*arriving.newest, self._table.newest)
        previous: Focused | None = inputs.previous
        if previous is not None and previous.newest == newest and previous.layers == tuple(layers):
            return previous
        return Focused(tuple(layers), newest)

    def _follow(self, seen: Seen, prefix: Prefix, positions: F32) -> None:
        """Forget what was split for other vertices, in other light or elsewhere."""
        count = len(positions)
        state = (seen.store, seen.store.generation, prefix)
        if state != self._state or count != len(self._table):
            self._table = self._table.resized(count)
            self._version, self._alpha = np.full(count, -1, np.int64), np.zeros(count, np.float32)
            self._tolerance, self._eye = np.zeros(count, np.float32), np.zeros((count, 3), np.float32)
            self._state = state
        elif self._positions is not positions:
            self._version[(self._positions != positions).any(axis=1)] = -1
        self._positions = positions

    def _split(
        self,
        base: NodeTable,
        prefix: Prefix,
        inputs: Inputs,
        stale: Bools,
        eye: F32,
        alpha: F32,
        weights: F32,
        tolerance: float,
        job: Job,
    ) -> None:
        mesh, shapes = inputs[Surfaces].mesh, inputs[Shapes]
        runs = inputs[Arriving].runs
        numbered = [(number, block) for number, block in base.numbered() if block.detail is not None]
        found: dict[int, list[NodeBlock]] = {}

        def one(index: int, stop: int) -> None:
            number, block = numbered[index]
            detail = block.detail
            assert detail is not None
            mine = []
            counts = np.zeros(len(block.points), np.int64)
            begin = 0
            while begin < len(block.points):
                room = MOST_NODES + _ROOM * (len(block.points) - begin)
                out = np.empty(FLOATS * room, np.float32)
                done = focus_nodes(
                    begin,
                    len(block.points),
                    number,
                    block.points,
                    block.first,
                    block.data,
                    detail.spread,
                    detail.cell,
                    runs.pool,
                    runs.start,
                    runs.length,
                    base.owner,
                    stale,
                    mesh.positions,
                    mesh.normals,
                    mesh.tangents,
                    shapes.rows(mesh),
                    eye,
                    shapes.address,
                    shapes.terms,
                    shapes.offset,
                    shapes.data,
                    weights,
                    alpha,
                    prefix.block,
                    prefix.leaf,
                    np.float32(tolerance),
                    out,
                    counts,
                )
                own = counts[begin : begin + done]
                split = own >= 0
                first = starts(own[split])
                data = out[: FLOATS * int(first[-1])].copy()
                mine.append(NodeBlock(block.points[begin : begin + done][split], first, data))
                begin += done
            found[index] = mine

        self._table.drop(stale)
        self._workers.run(len(numbered), 1, one, job)
        self._table.replace([block for index in sorted(found) for block in found[index] if len(block.points)])


def turned(positions: F32, before: F32, eye: F32) -> F32:
    """The chord (P,) between the unit ways from positions (P, 3) to where the eye was (P, 3) and is."""
    was, now = before - positions, eye - positions
    was /= np.maximum(np.linalg.norm(was, axis=1, keepdims=True), np.float32(1e-12))
    now /= np.maximum(np.linalg.norm(now, axis=1, keepdims=True), np.float32(1e-12))
    return np.asarray(np.linalg.norm(now - was, axis=1), np.float32)


class LobeWeights:
    """Mean luminous coefficients of materials' terms: which of them matter."""

    def __init__(self, registry: Registry) -> None:
        self._registry = registry
        self._kept: dict[MaterialKey, tuple[Material, F32]] = {}

    def __call__(self, scene: Scene, materials: tuple[str, ...]) -> F32:
        """(M + 1, T)."""
        kept: dict[MaterialKey, tuple[Material, F32]] = {}
        for name in materials:
            material = scene.material(name)
            had = self._kept.get(name)
            if had is None or had[0] is not material:
                table = coefficients(resolve(material, self._registry))
                mean = table.reshape(-1, *table.shape[-2:]).mean(axis=0) @ np.array(LUMINANCE, np.float32)
                had = material, np.asarray(mean, np.float32)
            kept[name] = had
        self._kept = kept
        found = [kept[name][1] for name in materials]
        made = np.zeros((len(found) + 1, max(map(len, found), default=1)), np.float32)
        for row, mean in enumerate(found):
            made[row, : len(mean)] = mean
        return made


MaterialKey = str
