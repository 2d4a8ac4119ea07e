"""Which directions of the environment to look at: those whose light is strong and gets where it matters.

A room that is lit through a window sees little of the sky, but that is what lights it. So a pilot follows
rays from the receivers to what they see, and asks from there which of 2^10 directions are open. Directions
are then drawn by radiance times the root mean square of what comes in (which is best for independent
samples), with a share by radiance alone, so that nothing is left out; as systematic samples along the
Morton order of leaves, which puts neighbours of equal importance into strata.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from studio_core.colour import LUMINANCE
from studio_core.kernels.directions import SMALLEST, direction_set
from studio_core.kernels.light_tree import LightTree
from studio_core.kernels.packets import OPAQUE
from studio_core.kernels.raycast import RayCaster
from studio_core.parallel import Checkpoints, Workers
from studio_core.scene.shading_mesh import NO_BACK
from studio_core.scene.world_mesh import WorldMesh
from studio_core.shading.artifacts import Casters, Lighting
from studio_core.transport.light_bits import LightBits, LitPoints
from studio_core.transport.light_samples import LightSamples, SampleCounts, distant, shuffles

F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]
I64 = npt.NDArray[np.int64]
Bools = npt.NDArray[np.bool_]

STARTS, RAYS = 128, 4
"""Receivers of the pilot, and rays from each to the points that it asks."""
BY_RADIANCE = 0.1
"""Share of the samples that is drawn by radiance alone."""
WORSE = 1.5
"""How much more variance directions may have than new ones would, before they are drawn anew."""
ALIKE = 0.5
"""Share of vertices seen now or by the pilot that must be seen by both; else it is asked again."""


@dataclass(frozen=True, eq=False)
class _Drawn:
    """Directions for one `SampleCounts`, and the probability of the leaves (S,) they were drawn with."""

    light: tuple[object, ...]
    samples: LightSamples
    probability: F64


class Pilot:
    """What 2^10 directions are worth to some points that receivers see."""

    def __init__(self, workers: Workers) -> None:
        self._workers = workers
        self._bits = LightBits(workers)
        self._caster: RayCaster | None = None
        self._seen: Bools | None = None
        self._vertices: I64 = np.zeros(0, np.int64)
        ways = direction_set(SMALLEST).directions.astype(np.float64)
        self._ways = distant(ways[None], np.ones((1, len(ways), 3), np.float32), "", "pilot")

    @property
    def nbytes(self) -> int:
        """Memory of what is kept."""
        return self._bits.nbytes

    def usefulness(
        self, mesh: WorldMesh, casters: Casters, seen: Bools | None, job: Checkpoints | None = None
    ) -> F64:
        """(2^10,) root mean square of visible cosines."""
        if casters.primary is not self._caster or self._strange(seen):
            self._vertices = self._points(mesh, casters.primary, seen, job)
            self._caster, self._seen = casters.primary, None if seen is None else seen.copy()
            self._bits = LightBits(self._workers)
        if not len(self._vertices):
            return np.ones(len(self._ways))
        points = LitPoints.of(mesh, self._vertices)
        self._bits.update(points, casters, self._ways, job)
        bits = np.unpackbits(self._bits.seen.view(np.uint8), axis=1, bitorder="little")
        cosine = points.normals @ self._ways.place[0, :, :3].T.astype(np.float32)
        worth = bits[:, : len(self._ways)] * np.maximum(cosine, 0)
        return np.asarray(np.sqrt(np.mean(worth.astype(np.float64) ** 2, axis=0)))

    def _strange(self, seen: Bools | None) -> bool:
        if seen is None or self._seen is None:
            return (seen is None) != (self._seen is None)
        both, any_of = np.count_nonzero(seen & self._seen), np.count_nonzero(seen | self._seen)
        return bool(both < ALIKE * any_of)

    def _points(self, mesh: WorldMesh, caster: RayCaster, seen: Bools | None, job: Checkpoints | None) -> I64:
        """Vertices that rays by cosine from random places of the receivers meet; the places where none do."""
        rng = np.random.default_rng(5)
        area = mesh.area.astype(np.float64) * (1.0 if seen is None else seen)
        upto = np.cumsum(area)
        if not len(upto) or not upto[-1] > 0:
            return np.zeros(0, np.int64)
        starts = np.searchsorted(upto, (np.arange(STARTS) + 0.5) / STARTS * upto[-1], side="right")
        starts = np.repeat(np.minimum(starts, len(upto) - 1), RAYS)
        normal = mesh.normals[starts].astype(np.float64)
        towards = rng.normal(size=normal.shape)
        towards = normal + towards / np.linalg.norm(towards, axis=1, keepdims=True)
        origins = mesh.positions[starts] + mesh.origin + caster.epsilon * mesh.geometric[starts]
        hits = caster.closest(
            origins + mesh.inset[starts], towards, 0.0, np.inf, self._workers, job, mask=OPAQUE
        )
        met = np.flatnonzero(hits.face >= 0)
        face = mesh.face_offsets[hits.object[met]] + hits.face[met]
        weights = np.stack([1 - hits.u - hits.v, hits.u, hits.v], axis=1)[met]
        sides = np.where(hits.front[met, None], mesh.faces[face], mesh.back_faces[face])
        corner = np.take_along_axis(sides, weights.argmax(axis=1)[:, None], axis=1)[:, 0]
        found = corner[corner != NO_BACK].astype(np.int64)
        return found if len(found) >= STARTS // 4 else np.asarray(starts, np.int64)


class SkyChooser:
    """Draws directions, and keeps them while they are good."""

    def __init__(self, workers: Workers) -> None:
        self._pilot = Pilot(workers)
        self._drawn: dict[SampleCounts, _Drawn] = {}
        self._version = 0

    @property
    def nbytes(self) -> int:
        """Memory of what is kept."""
        return self._pilot.nbytes + sum(drawn.probability.nbytes for drawn in self._drawn.values())

    def choose(
        self,
        mesh: WorldMesh,
        casters: Casters,
        lighting: Lighting,
        counts: SampleCounts,
        seen: Bools | None,
        job: Checkpoints | None = None,
    ) -> LightSamples | None:
        """Samples of the environment without its suns; None where it is black.

        The same as before while the light is the same, unless objects or receivers have moved such that
        others would be much better.
        """
        tree, environment = lighting.tree, lighting.environment
        assert tree is not None
        assert environment is not None
        radiance = luminance(tree)
        if not radiance.sum() > 0:
            return None
        worth = self._pilot.usefulness(mesh, casters, seen, job)
        wanted = probabilities(radiance, worth)
        drawn = self._drawn.pop(counts, None)
        light = (lighting.integrated, environment.id)
        if (
            drawn is None
            or drawn.light != light
            or _variance(radiance, worth, drawn.probability) > (WORSE * _variance(radiance, worth, wanted))
        ):
            self._version += 1
            directions, given = draw(tree, wanted, counts.environment, counts.variants)
            samples = distant(directions, given, environment.id, ("sky", self._version))
            drawn = _Drawn(light, samples, wanted)
        self._drawn[counts] = drawn
        while len(self._drawn) > 2:
            self._drawn.pop(next(iter(self._drawn)))
        return drawn.samples


def luminance(tree: LightTree) -> F64:
    """(S,) of the leaves."""
    return np.asarray(tree.radiance.astype(np.float64) @ np.asarray(LUMINANCE, np.float64))


def probabilities(radiance: F64, worth: F64) -> F64:
    """(S,) by which leaves are drawn, from their radiance and what 2^10 directions are worth; sum 1."""
    best: F64 = radiance * np.repeat(worth, len(radiance) // len(worth))
    plain: F64 = radiance / radiance.sum()
    total = best.sum()
    if not total > 0:
        return plain
    return np.asarray((1 - BY_RADIANCE) / total * best + BY_RADIANCE * plain, np.float64)


def draw(tree: LightTree, probability: F64, columns: int, variants: int) -> tuple[F64, F32]:
    """Directions and light (P, C, 3) of systematic samples: P in each of C strata of equal probability."""
    upto = np.cumsum(probability)
    place = (np.arange(columns) + (shuffles(columns, variants, 3) + 0.5) / variants) / columns
    leaf = np.minimum(np.searchsorted(upto, place * upto[-1], side="right"), len(upto) - 1)
    scale = tree.solid_angle / (columns * probability[leaf])
    light = tree.radiance[leaf] * scale[..., None]
    return direction_set(tree.k).directions[leaf].astype(np.float64), light.astype(np.float32)


def _variance(radiance: F64, worth: F64, probability: F64) -> float:
    """That of one sample, about."""
    best: F64 = radiance * np.repeat(worth, len(radiance) // len(worth))
    lit = probability > 0
    return float((best[lit] ** 2 / probability[lit]).sum())
