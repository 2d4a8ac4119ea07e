"""The last stage: BRDFs summed over nodes, for the vertices where anything is other than before."""

from __future__ import annotations

import itertools
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from studio_core.contract import Services
from studio_core.kernels.tilted import FIELDS
from studio_core.scene.diff import Aspect
from studio_core.scene.nodes import NodeId
from studio_core.shading.artifacts import Hits, LayerRadiance, Radiance, ShadingPoints, Shapes, Surfaces
from studio_core.shading.frame import Frame
from studio_core.shading.job import Job
from studio_core.shading.pipeline import Inputs
from studio_core.shading.pixel_lamps import NEEDS, PixelLampsMaker
from studio_plugins.cuts.fill import fill, lift
from studio_plugins.cuts.focus_stage import Focused
from studio_plugins.cuts.light_stage import Arriving
from studio_plugins.cuts.nodes import NodeTable
from studio_plugins.cuts.visibility_stage import Seen

F32 = npt.NDArray[np.float32]
I64 = npt.NDArray[np.int64]
Bools = npt.NDArray[np.bool_]


@dataclass
class _Layer:
    """What was last handed on for a layer, and from which nodes."""

    radiance: LayerRadiance
    version: list[I64] = field(default_factory=list)


class RadianceStage:
    """Sums BRDFs over nodes, for the vertices where nodes, material or eye are others than before."""

    needs: tuple[type, ...] = (*NEEDS, Seen, Arriving, Focused)
    gives = Radiance
    dirtied_by = Aspect.VIEW | Aspect.QUALITY

    def __init__(self, services: Services) -> None:
        self._workers = services.workers
        self._lamps = PixelLampsMaker(services)
        self._layers: dict[NodeId, _Layer] = {}
        self._eye: tuple[float, ...] = ()
        self._kernels: dict[tuple[int, bytes, float], int] = {}
        self._numbering = itertools.count(1)
        self._kernel: I64 = np.zeros(0, np.int64)
        self._material: npt.NDArray[np.int32] = np.zeros(0, np.int32)
        self._positions: F32 = np.zeros((0, 3), np.float32)
        self._numbers: tuple[object, ...] = ()

    def run(self, frame: Frame, inputs: Inputs, job: Job) -> Radiance:
        """Radiance of all layers; vertices that are not seen have none."""
        surfaces, shapes, seen = inputs[Surfaces], inputs[Shapes], inputs[Seen]
        mesh, arriving = surfaces.mesh, inputs[Arriving]
        count = len(mesh.positions)
        eye = tuple(frame.view.transform.translation)
        local_eye = (np.asarray(eye, np.float64) - mesh.origin).astype(np.float32)
        numbers = (seen.store, seen.store.generation)
        moved = eye != self._eye or numbers != self._numbers
        kernel = self._kernel_of(shapes, mesh)
        other = np.ones(count, np.bool_)
        if numbers == self._numbers:  # who moves sees the eye elsewhere
            other = (self._kernel != kernel) | (self._material != mesh.material)
            if self._positions is not mesh.positions:
                other |= (self._positions != mesh.positions).any(axis=1)
        summed = seen.summed
        layers: dict[NodeId, LayerRadiance] = {}
        kept: dict[NodeId, _Layer] = {}
        looked = shaded = 0
        for node, pairs in inputs[Focused].layers:
            before = self._layers.get(node)
            if before is not None:  # materials that have other terms now are shaded again anyway
                before = _Layer(before.radiance.of_width(shapes.width), before.version)
            tables = [table for pair in pairs for table in pair if table is not None]
            versions = [table.version.copy() for table in tables]
            if before is None or moved or len(before.version) != len(versions):
                dirty = summed
                terms = np.zeros((count, shapes.width, 3), np.float32)
                irradiance = np.zeros((count, 3), np.float32)
                tilts = _blank_tilts(count, shapes)
            else:
                fresh = ~other
                for was, is_ in zip(before.version, versions, strict=True):
                    fresh &= was == is_
                dirty = summed & ~fresh
                if not dirty.any() and seen.between is None:
                    done = [np.where(other, -1, version) for version in before.version]
                    layers[node], kept[node] = before.radiance, _Layer(before.radiance, done)
                    continue
                terms, irradiance = before.radiance.terms.copy(), before.radiance.irradiance.copy()
                terms[dirty] = 0
                tilts = _tilts_of(before.radiance, shapes)
                if tilts is not None:
                    tilts[dirty] = 0
            rows = np.flatnonzero(dirty)
            irradiance[rows] = _irradiance(pairs, rows)
            for nodes, instead in pairs:
                own = dirty if instead is None else dirty & ~instead.owned
                given = (terms, self._workers, job, tilts)
                looked += nodes.shade(mesh, shapes, local_eye, own, *given)
                if instead is not None:
                    looked += instead.shade(mesh, shapes, local_eye, dirty, *given)
            shaded += len(rows)
            done = [
                np.where(dirty, v, np.where(other, -1, w))
                for v, w in zip(versions, _or_blank(before, versions, moved), strict=True)
            ]
            if seen.between is not None:
                rest = seen.mask & ~summed
                settled = arriving.settled.get(node, np.zeros(count, np.bool_))
                rows = np.flatnonzero(rest & settled)
                irradiance[rows] = _irradiance(pairs, rows)
                if node in arriving.standing:
                    past, known = arriving.standing[node]
                    settled = settled | lift(seen.between, summed, rest, settled, past, known, irradiance)
                between = (seen.between, mesh.material, summed, rest, settled)
                if tilts is not None:  # first: what is not settled gets its irradiance with the terms
                    fill(*between, tilts.reshape(count, -1, 3), irradiance.copy())
                fill(*between, terms, irradiance)
                done = [np.where(rest, -1, version) for version in done]
            layers[node] = LayerRadiance(terms, irradiance, tilts)
            kept[node] = _Layer(layers[node], done)
        self._layers, self._eye, self._kernel, self._material = kept, eye, kernel, mesh.material
        self._positions, self._numbers = mesh.positions, numbers
        counts = {
            **seen.store.summary(),
            "vertices": count,
            "skipped_vertices_unseen": count - int(seen.mask.sum()),
            "skipped_vertices_between": int(seen.mask.sum()) - len(seen.points),
            "vertices_shaded": shaded,
            "vertices_summed": arriving.summed if Arriving in inputs.rebuilt else 0,
            "vertices_traced_to_lamps": arriving.lamp_points if Arriving in inputs.rebuilt else 0,
            "nodes": looked,
        }
        made = Radiance(surfaces, inputs[Hits], layers, seen.mask, 1 << seen.level, seen.exact, counts)
        return self._lamps(frame, inputs, made) if frame.params.pixel_lamps else made

    def _kernel_of(self, shapes: Shapes, mesh: ShadingPoints) -> I64:
        """(V,) a number for each vertex' kernel and shape: the same while they are; 0 without a material."""
        bounds = np.append(shapes.offset, len(shapes.data))
        rows = [
            (int(address), shapes.data[begin:end].tobytes(), float(steep))
            for address, begin, end, steep in zip(
                shapes.address, bounds[:-1], bounds[1:], _tilt_of(shapes), strict=True
            )
        ]
        known = self._kernels
        self._kernels = {row: known[row] if row in known else next(self._numbering) for row in set(rows)}
        return np.array([*(self._kernels[row] for row in rows), 0], np.int64)[shapes.rows(mesh)]


def _tilt_of(shapes: Shapes) -> F32:
    return np.zeros(len(shapes.address), np.float32) if shapes.tilt is None else shapes.tilt


def _blank_tilts(count: int, shapes: Shapes) -> F32 | None:
    """(V, FIELDS, T, 3); None where no material has a normal map."""
    return None if shapes.tilt is None else np.zeros((count, FIELDS, shapes.width, 3), np.float32)


def _tilts_of(radiance: LayerRadiance, shapes: Shapes) -> F32 | None:
    """Those of a layer, to be changed; blank where it had none and now has."""
    if shapes.tilt is None or radiance.tilts is None:
        return _blank_tilts(len(radiance.terms), shapes)
    return radiance.tilts.copy()


def _irradiance(pairs: tuple[tuple[NodeTable, NodeTable | None], ...], rows: I64) -> F32:
    made = np.zeros((len(rows), 3), np.float32)
    for nodes, _ in pairs:
        made += nodes.irradiance[rows]
    return made


def _or_blank(before: _Layer | None, versions: list[I64], moved: bool) -> list[I64]:
    if before is None or moved or len(before.version) != len(versions):
        return [np.full_like(version, -1) for version in versions]
    return before.version
