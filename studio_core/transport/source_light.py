"""Light straight from lamps, suns and the environment at every vertex: what the first bounce starts from.

What vertices see of the lights is kept as bits (`light_bits`), so that colours and gains cost no rays; sums
are made from the bits, with weights by distance and angle, in one pass.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple, Protocol

import numpy as np
import numpy.typing as npt

from studio_core.parallel import Checkpoints, Workers
from studio_core.scene.nodes import Light, NodeId
from studio_core.shading.artifacts import Casters, Lighting, Shapes, Surfaces
from studio_core.transport.light_bits import LightBits, LitPoints
from studio_core.transport.light_kernels import sum_light
from studio_core.transport.light_samples import (
    LightSamples,
    SampleCounts,
    joined,
    lamp_samples,
    sun_samples,
)
from studio_core.transport.sky_samples import SkyChooser
from studio_core.transport.zones import ZONES

F32 = npt.NDArray[np.float32]
I64 = npt.NDArray[np.int64]
U64 = npt.NDArray[np.uint64]
Bools = npt.NDArray[np.bool_]

POINTS_A_CHUNK = 1024
KEPT = 2
"""Sets of bits that are kept, one for each of the last `SampleCounts`."""


class Incoming(Protocol):
    """What sums need of separated BRDFs: functions by row of `Shapes` and cell of a direction."""

    @property
    def count(self) -> I64:
        """(R,) functions of a row."""
        ...

    @property
    def base(self) -> I64:
        """(R,) where a row starts in `incoming`: function k at cell c is at base + c · count + k."""
        ...

    @property
    def incoming(self) -> F32:
        """All rows' functions."""
        ...


class SourceSums(NamedTuple):
    """Irradiance (V, 3); where the functions of a vertex start in `functions` (N, 3), or −1, as slot (V,)."""

    irradiance: F32
    slot: I64
    functions: F32


class LightCounts(NamedTuple):
    """Rays that were traced, and pairs of vertex and sample that needed none."""

    rays: int
    kept: int


class SourceLight:
    """Light straight from all lights at the vertices of the unrefined meshes; owned by the compute thread."""

    def __init__(self, workers: Workers, sky: SkyChooser | None = None) -> None:
        self._workers = workers
        self._bits: dict[SampleCounts, LightBits] = {}
        self.sky = sky or SkyChooser(workers)
        """Chooses directions of the environment; may be shared, so that two look the same way."""
        self._current = LightBits(workers)
        self.samples: LightSamples = joined([], 1)
        """What vertices look at, since the last update."""
        self.variant: npt.NDArray[np.int32] = np.zeros(0, np.int32)
        """(V,) and in which row of it."""

    @property
    def nbytes(self) -> int:
        """Memory of what is kept."""
        return self.sky.nbytes + sum(bits.nbytes for bits in self._bits.values())

    @property
    def seen(self) -> U64:
        """(V, words) bits of the columns of `samples` that come through."""
        return self._current.seen

    def update(
        self,
        surfaces: Surfaces,
        casters: Casters,
        lighting: Lighting,
        samples: SampleCounts,
        job: Checkpoints | None = None,
        seen: Bools | None = None,
    ) -> LightCounts:
        """Follows meshes, lights and moves. After it was cancelled, call it again before `sums`.

        The sky is looked at where its light matters to what the vertices `seen` (V,) see, or to all.
        """
        mesh = surfaces.unrefined.mesh
        variants, environment, sky = samples.variants, lighting.environment, None
        if environment is not None and lighting.tree is not None and samples.environment > 0:
            sky = self.sky.choose(mesh, casters, lighting, samples, seen, job)
        zones = 1 if sky is None else ZONES
        parts = [lamp_samples(lamp, samples.lamp, variants, zones) for lamp in lighting.lamps]
        if environment is not None and lighting.sun is not None:
            key = (lighting.integrated, "sun", samples)
            parts.append(sun_samples(lighting.sun, samples.lamp, variants, zones, environment.id, key))
        if sky is not None:
            parts.append(sky)
        self.samples = joined(parts, zones * variants)
        self.variant = self.sky.rows(mesh, zones, variants)
        bits = self._bits.pop(samples, None) or LightBits(self._workers)
        self._bits[samples] = self._current = bits
        while len(self._bits) > KEPT:
            self._bits.pop(next(iter(self._bits)))
        return LightCounts(*bits.update(LitPoints.of(mesh, self.variant), casters, self.samples, job))

    def sums(
        self,
        surfaces: Surfaces,
        shapes: Shapes,
        separated: Incoming,
        lights: Mapping[NodeId, Light],
        some: Bools | None = None,
        job: Checkpoints | None = None,
    ) -> SourceSums:
        """Light as `update` left it, with the gains of `lights`; other lights are off.

        Function k of vertex v is Σ light · h_k(ω_i) · cosθ_i. Vertices that are not in `some` (V,) are 0.
        `shapes` belong to the unrefined meshes.
        """
        mesh = surfaces.unrefined.mesh
        count = len(mesh.positions)
        row = np.ascontiguousarray(shapes.rows(mesh), np.int32)
        own = (
            np.where(row >= 0, separated.count[row], 0) if len(separated.count) else np.zeros(count, np.int64)
        )
        upto = np.concatenate([[0], np.cumsum(own)]).astype(np.int64)
        slot = np.where(own > 0, upto[:-1], -1)
        irradiance = np.zeros((count, 3), np.float32)
        functions = np.zeros((int(upto[-1]), 3), np.float32)
        samples, seen = self.samples, self._current.seen
        points = np.flatnonzero(seen.any(axis=1) if some is None else seen.any(axis=1) & some)
        place = samples.relative(mesh.origin)
        light = samples.coloured(lights)

        def body(start: int, stop: int) -> None:
            sum_light(
                mesh.positions,
                mesh.normals,
                mesh.tangents,
                samples.kind,
                self.variant,
                place,
                samples.lamp,
                light,
                seen,
                row,
                separated.count,
                separated.base,
                separated.incoming,
                slot,
                points,
                irradiance,
                functions,
                start,
                stop,
            )

        self._workers.run(len(points), POINTS_A_CHUNK, body, job)
        return SourceSums(irradiance, slot, functions)
