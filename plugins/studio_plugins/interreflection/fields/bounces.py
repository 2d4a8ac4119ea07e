"""Light from object to object, as often as asked for: the stage that all but the eye depends on.

Light straight from all lamps and the sky at every vertex (equation 3 for the first bounce), weights of each
object's radiance (equations 6 and 7), fields of them (equation 5), what arrives at all vertices of other
objects, and from that the next bounce's L_k.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from studio_core.contract import Services
from studio_core.scene.diff import Aspect
from studio_core.scene.nodes import Light
from studio_core.shading.artifacts import Casters, Lighting, Shapes, Surfaces
from studio_core.shading.frame import Frame
from studio_core.shading.job import Job
from studio_core.shading.pipeline import Inputs
from studio_core.transport.light_samples import SampleCounts
from studio_core.transport.reflectance import VertexCoefficients
from studio_core.transport.separable import Separated, Separator
from studio_core.transport.source_light import SourceLight, SourceSums
from studio_plugins.interreflection.fields.bodies import Cast, Casting
from studio_plugins.interreflection.fields.params import Params
from studio_plugins.interreflection.fields.precompute import Field
from studio_plugins.interreflection.fields.store import FieldStore, Settings, fitted
from studio_plugins.interreflection.fields.transfer import (
    Sources,
    combined,
    receive,
    receivers,
    receiving_rows,
)

F32 = npt.NDArray[np.float32]
I32 = npt.NDArray[np.int32]
I64 = npt.NDArray[np.int64]

LAMP_SAMPLES, SKY_SAMPLES = 16, 256


@dataclass(frozen=True, eq=False)
class Sent:
    """What all objects send out, all bounces together, and what receives it.

    vectors (V, 1 + K, bands²) and row (V,) of every vertex.
    """

    surfaces: Surfaces
    sources: Sources
    separated: Separated
    rows: F32
    row: I32
    vectors: F32
    bands: int
    counts: dict[str, int] = field(default_factory=dict)
    facts: dict[str, float] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class _Faced:
    """Vectors of vertices, and what they were made from."""

    normals: F32
    tangents: F32
    row: I32
    rows: F32
    vectors: F32


class BounceStage:
    """All bounces but the last way, to the eye."""

    needs: tuple[type, ...] = (Surfaces, Casters, Shapes, Lighting)
    gives = Sent
    dirtied_by = Aspect.LIGHT | Aspect.GAIN | Aspect.MATERIAL | Aspect.QUALITY

    def __init__(self, services: Services) -> None:
        self._services = services
        self._light = SourceLight(services.workers)
        self._coefficients = VertexCoefficients(services)
        self._separator = Separator()
        self._store = FieldStore(services)
        self._casting = Casting(services)
        self._faced: _Faced | None = None

    def run(self, frame: Frame, inputs: Inputs, job: Job) -> Sent:
        """Raises Cancelled; fields that were made stay."""
        assert frame.bounced is not None
        params: Params = frame.bounced.params
        surfaces, shapes, casters = inputs[Surfaces], inputs[Shapes], inputs[Casters]
        mesh = surfaces.mesh
        separated = self._separator.fixed(shapes, params.functions)
        cast = self._casting(surfaces, casters, shapes, separated, job)
        settings = Settings(
            params.shells, params.cells, params.components, params.lights, params.rays, params.bands
        )
        areas = np.bincount(cast.owner + 1, mesh.area, len(cast.bodies) + 1)[1:].tolist()
        chosen = fitted(cast.bodies, areas, settings, params.megabytes << 20)
        before = self._store.made
        fields = self._store.fields(cast.bodies, chosen, casters.primary, job)
        row = np.asarray(shapes.rows(mesh), np.int32)
        row = np.where(row < 0, len(separated.count), row).astype(np.int32)
        rows = receiving_rows(cast.terms.incoming, params.bands)
        vectors = self._vectors(surfaces, row, rows, params.bands, job)
        coefficients = self._coefficients(frame.scene, surfaces)
        matte = cast.terms.matte_part(row, coefficients)
        glossy = cast.terms.glossy_part(row, coefficients)
        counts = SampleCounts(LAMP_SAMPLES, SKY_SAMPLES)
        traced = self._light.update(surfaces, casters, inputs[Lighting], counts, job)
        lights = {light.id: light for light in frame.scene.of(Light) if frame.scene.shown(light.id)}
        first = self._light.sums(surfaces, shapes, separated, lights, None, job)
        light = _side_by_side(first, glossy.shape[1], separated.count, row)
        every = np.arange(len(mesh), dtype=np.int64)
        total: Sources | None = None
        for bounce in range(params.bounces):
            sent = self._sent(surfaces, cast, fields, light, matte, glossy, job)
            total = sent if total is None else total.plus(sent)
            if bounce + 1 < params.bounces:
                light = receive(
                    vectors, sent.arriving(every, params.bands, self._services, job), self._services, job
                )
        assert total is not None
        kept = {id(one): one for one in fields}.values()
        return Sent(
            surfaces,
            total,
            separated,
            rows,
            row,
            vectors,
            params.bands,
            {"fields_made": self._store.made - before, "rays": traced.rays},
            {
                "N": float(params.components),
                "K": float(params.functions),
                "shells": float(params.shells),
                "places": float(sum(len(one.lattice) for one in kept)),
                "sources": float(len(fields)),
                "bytes": float(sum(one.nbytes for one in kept)),
            },
        )

    def _vectors(self, surfaces: Surfaces, row: I32, rows: F32, bands: int, job: Job) -> F32:
        """Vectors of all vertices; those that did not turn keep theirs."""
        mesh, old = surfaces.mesh, self._faced
        some = np.arange(len(mesh), dtype=np.int64)
        vectors = np.empty((len(mesh), rows.shape[1], rows.shape[2]), np.float32)
        if old is not None and old.vectors.shape == vectors.shape and np.array_equal(old.rows, rows):
            other = (old.normals != mesh.normals).any(axis=1) | (old.tangents != mesh.tangents).any(axis=1)
            some = np.flatnonzero(other | (old.row != row))
            if not len(some):
                return old.vectors
            vectors[:] = old.vectors
        vectors[some] = receivers(mesh, some, row, rows, bands, self._services, job)
        self._faced = _Faced(mesh.normals, mesh.tangents, row, rows, vectors)
        return vectors

    def _sent(
        self,
        surfaces: Surfaces,
        cast: Cast,
        fields: Sequence[Field],
        light: F32,
        matte: F32,
        glossy: F32,
        job: Job,
    ) -> Sources:
        """Fields of what all sources send out of light (V, 1 + K, 3) that reaches them."""
        mesh = surfaces.mesh
        found: list[F32 | None] = [None] * len(fields)

        def make(start: int, stop: int) -> None:
            for number in range(start, stop):
                own, body = mesh.vertices_of(cast.index[number]), cast.bodies[number]
                count = body.reflection.incoming.shape[1]
                sent = [glossy[own, :count] * light[own, 1 : 1 + count]]
                if body.reflection.matte:
                    sent.insert(0, (matte[own] * light[own, 0])[:, None])
                weights = fields[number].basis.weights(np.concatenate(sent, axis=1))
                if weights.any():
                    flat = np.swapaxes(weights, 0, 1).reshape(-1, 3)
                    place = mesh.objects[cast.index[number]].transform
                    found[number] = combined(fields[number], flat, place)

        self._services.workers.run(len(fields), 1, make, job)
        sources = Sources(cast.owner, mesh.positions, mesh.origin)
        for number, one in enumerate(found):
            if one is not None:
                place = mesh.objects[cast.index[number]].transform
                sources.add(number, fields[number].lattice, place, one)
        return sources


def _side_by_side(sums: SourceSums, functions: int, count: I64, row: I32) -> F32:
    """(V, 1 + K, 3) irradiance and L_k."""
    made = np.zeros((len(row), 1 + functions, 3), np.float32)
    made[:, 0] = sums.irradiance
    known = np.append(count, 0)[row]
    for k in range(functions):
        own = np.flatnonzero((known > k) & (sums.slot >= 0))
        made[own, 1 + k] = sums.functions[sums.slot[own] + k]
    return made


__all__ = ["BounceStage", "Sent"]
