"""Light straight from lamps and suns at elements: seen along rays that are kept, then put in exactly.

A lamp is far smaller than a cell. Its light goes into the series of the incident light (`moments`) at its own
azimuth, where the operator's mean over a cell is undone, and between the two rings that it is between: so
both columns have it, and the matte one exactly.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Mapping

import numpy as np
import numpy.typing as npt

from studio_core.jit import kernel
from studio_core.parallel import Checkpoints, Workers
from studio_core.scene.nodes import Light, NodeId
from studio_core.shading.artifacts import Casters, Lighting, Surfaces
from studio_core.transport.cells import PARTS, RINGS
from studio_core.transport.light_bits import LightBits, LitPoints
from studio_core.transport.light_kernels import arriving_from
from studio_core.transport.light_samples import LightSamples, joined, lamp_samples, sun_samples
from studio_plugins.slf.elements import Elements
from studio_plugins.slf.lobes import FREQUENCIES, cell_weights

F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]
I8 = npt.NDArray[np.int8]
U64 = npt.NDArray[np.uint64]

SAMPLES = 4
"""Places on an area lamp, or on a sun."""


class StraightLight:
    """What elements see of lamps and suns; follows lights and moves. Owned by the compute thread."""

    def __init__(self, workers: Workers) -> None:
        self._bits = LightBits(workers)
        self._samples: LightSamples = joined([], 1)
        self._light: F32 = np.zeros((0, 3), np.float32)
        self._place: F64 = np.zeros((0, 4))
        self._positions: F32 = np.zeros((0, 3), np.float32)

    @property
    def nbytes(self) -> int:
        """Memory of what is kept."""
        return self._bits.nbytes

    def update(
        self,
        surfaces: Surfaces,
        casters: Casters,
        lighting: Lighting,
        lights: Mapping[NodeId, Light],
        elements: Elements,
        job: Checkpoints | None = None,
    ) -> int:
        """Of the elements now, with the gains of `lights`; other lights are off. How many rays it took."""
        mesh, environment = surfaces.unrefined.mesh, lighting.environment
        parts = [lamp_samples(lamp, SAMPLES, 1, 1) for lamp in lighting.lamps]
        if environment is not None and lighting.sun is not None:
            key = (lighting.integrated, "sun", SAMPLES)
            parts.append(sun_samples(lighting.sun, SAMPLES, 1, 1, environment.id, key))
        self._samples = joined(parts, 1)
        points = LitPoints.of(mesh, np.zeros(len(elements), np.int32), elements.vertex)
        rays, _ = self._bits.update(points, casters, self._samples, job)
        self._positions = points.positions
        self._light = self._samples.coloured(lights)[0]
        self._place = self._samples.relative(mesh.origin)[0]
        return rays

    def add_to(self, series: F32, start: int, frames: F32) -> None:
        """Adds it to the series (N, 3, RINGS, WIDTH) of elements from `start` on, with frames (N, 3, 3)."""
        if len(self._samples):
            stop = start + len(series)
            add_straight(
                self._positions[start:stop],
                frames,
                self._bits.seen[start:stop],
                self._samples.kind,
                self._place,
                self._samples.lamp,
                self._light,
                *_measures(),
                series,
            )


@functools.cache
def _measures() -> tuple[F64, F64]:
    """(RINGS,) one over a cell's projected angle; (FREQUENCIES,) one over the mean of a wave over a part."""
    return 1 / cell_weights(), 1 / np.sinc(np.arange(FREQUENCIES) / PARTS)


@kernel
def add_straight(
    positions: F32,
    frames: F32,
    seen: U64,
    kind: I8,
    place: F64,
    lamp: F64,
    light: F32,
    per_measure: F64,
    sharper: F64,
    series: F32,
) -> None:
    """place (C, 4), lamp (C, 5) and light (C, 3) of samples, seen (N, words) who sees them."""
    half = series.shape[3] // 2
    for n in range(len(series)):
        x, y, z = float(positions[n, 0]), float(positions[n, 1]), float(positions[n, 2])
        for column in range(len(kind)):
            if not (seen[n, column >> 6] >> np.uint64(column & 63)) & np.uint64(1):
                continue
            px, py, pz = place[column, 0], place[column, 1], place[column, 2]
            dx, dy, dz, weight = arriving_from(kind[column], px, py, pz, lamp, column, x, y, z)
            u = frames[n, 0, 0] * dx + frames[n, 0, 1] * dy + frames[n, 0, 2] * dz
            v = frames[n, 1, 0] * dx + frames[n, 1, 1] * dy + frames[n, 1, 2] * dz
            w = frames[n, 2, 0] * dx + frames[n, 2, 1] * dy + frames[n, 2, 2] * dz
            if not w > 0.0:
                continue
            weight *= w
            red, green, blue = weight * light[column, 0], weight * light[column, 1], weight * light[column, 2]
            across = math.sqrt(u * u + v * v)
            height = math.atan2(across, w) * (RINGS / (math.pi / 2)) - 0.5
            lower = math.floor(height)
            upper_share = height - lower
            turn = math.atan2(v, u) - math.pi / PARTS
            cosine, sine = math.cos(turn), -math.sin(turn)
            for side in range(2):
                ring, share = lower + side, upper_share if side == 1 else 1.0 - upper_share
                opposite = ring < 0  # across the pole
                ring = min(max(ring, 0), RINGS - 1)
                share *= per_measure[ring]
                real, imaginary = share, 0.0
                for m in range(half):
                    a, b = real * sharper[m], imaginary * sharper[m]
                    if m == half - 1:  # the fastest wave has no other phase
                        b = 0.0
                    series[n, 0, ring, m] += red * a
                    series[n, 1, ring, m] += green * a
                    series[n, 2, ring, m] += blue * a
                    series[n, 0, ring, half + m] += red * b
                    series[n, 1, ring, half + m] += green * b
                    series[n, 2, ring, half + m] += blue * b
                    real, imaginary = real * cosine - imaginary * sine, real * sine + imaginary * cosine
                    if opposite:
                        real, imaginary = -real, -imaginary


__all__ = ["SAMPLES", "StraightLight"]
