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
from studio_core.scene.transform import Transform
from studio_core.scene.world_mesh import WorldMesh
from studio_core.shading.artifacts import Casters, Lighting
from studio_core.transport.light_bits import LightBits, LitPoints
from studio_core.transport.light_samples import LightSamples, SampleCounts, distant, shuffles
from studio_core.transport.zones import ZONES, Zones

F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]
I32 = npt.NDArray[np.int32]
I64 = npt.NDArray[np.int64]
Bools = npt.NDArray[np.bool_]

STARTS, RAYS = 192, 4
"""Receivers of the pilot, and rays from each to the points that it asks."""
BY_RADIANCE = 0.1
"""Share of the samples that is drawn by radiance alone."""
WORSE = 1.5
"""How much more variance directions may have than new ones would, before they are drawn anew."""
ALIKE = 0.5
"""Share of vertices seen now or by the pilot that must be seen by both; else it is asked again."""


@dataclass(frozen=True, eq=False)
class _Drawn:
    """Directions for one `SampleCounts`, what was worth how much then, and the probabilities of cells."""

    light: tuple[object, ...]
    samples: LightSamples
    worth: F64
    probability: F64

    def worse(self, power: F64, worth: F64) -> bool:
        """Whether new directions would be much better."""
        if worth is self.worth:
            return False
        return _variance(power, worth, self.probability) > WORSE * _variance(
            power, worth, probabilities(power, worth)
        )


class Pilot:
    """What 2^10 directions are worth to some points that receivers see."""

    def __init__(self, workers: Workers) -> None:
        self._workers = workers
        self._bits = LightBits(workers)
        self._caster: RayCaster | None = None
        self._seen: Bools | None = None
        self._transforms: tuple[Transform, ...] | None = None
        self._vertices: I64 = np.zeros(0, np.int64)
        self.worth: F64 = np.zeros((0, 0))
        """(ZONES, 2^10) as `usefulness` gave it last."""
        self.zones = Zones.about(np.zeros((1, 3)))
        """Zones of the scene, by where the points are."""
        ways = direction_set(SMALLEST).directions.astype(np.float64)
        self._ways = distant(ways[None], np.ones((1, len(ways), 3), np.float32), "", "pilot")

    @property
    def nbytes(self) -> int:
        """Memory of what is kept."""
        return self._bits.nbytes

    def usefulness(
        self,
        mesh: WorldMesh,
        casters: Casters,
        seen: Bools | None,
        moving: bool,
        job: Checkpoints | None = None,
    ) -> F64:
        """(ZONES, 2^10) root mean square of visible cosines at points that are and face about so.

        The same array where nothing has changed; while things are `moving`, it may be as it was before.
        """
        elsewhere = casters.primary is not self._caster or self._strange(seen)
        known = self._transforms is not None and not elsewhere  # else it is new, or was cancelled
        if known and (moving or casters.transforms == self._transforms):
            return self.worth
        if elsewhere:
            self._vertices = self._points(mesh, casters.primary, seen, job)
            self._caster, self._seen = casters.primary, None if seen is None else seen.copy()
            self._bits = LightBits(self._workers)
            self._transforms = None
            if len(self._vertices):
                self.zones = Zones.about(mesh.positions[self._vertices] + mesh.origin)
        count = len(self._vertices)
        if count:
            points = LitPoints.of(mesh, np.zeros(count, np.int32), self._vertices)
            self._bits.update(points, casters, self._ways, job)
            bits = np.unpackbits(self._bits.seen.view(np.uint8), axis=1, bitorder="little")
            cosine = points.normals @ self._ways.place[0, :, :3].T.astype(np.float32)
            worth = (bits[:, : len(self._ways)] * np.maximum(cosine, 0)) ** 2
            share = self.zones.shares(points.positions + points.origin, points.normals).astype(np.float32)
            self.worth = np.sqrt(share @ worth / share.sum(axis=1, keepdims=True), dtype=np.float64)
        else:
            self.worth = np.ones((ZONES, len(self._ways)))
        self._transforms = casters.transforms
        return self.worth

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
        self._transforms: tuple[Transform, ...] | None = None
        self._last: tuple[LightTree, Power] | None = None

    @property
    def nbytes(self) -> int:
        """Memory of what is kept."""
        return self._pilot.nbytes + sum(drawn.probability.nbytes for drawn in self._drawn.values())

    @property
    def worth(self) -> F64 | None:
        """(2^10,) what directions are worth to all zones together, since `choose`; None before."""
        known = self._pilot.worth
        return np.sqrt((known**2).mean(axis=0)) if len(known) else None

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
        power = self._power(tree)
        if not power.total > 0:
            return None
        moving, self._transforms = casters.transforms != self._transforms, casters.transforms
        worth = self._pilot.usefulness(mesh, casters, seen, moving, job)
        light = (lighting.integrated, environment.id, self._pilot.zones)
        drawn = self._drawn.pop(counts, None)
        if drawn is None or drawn.light != light or drawn.worse(power.cells, worth):
            self._version += 1
            probability = probabilities(power.cells, worth)
            directions, given = draw(tree, power, probability, counts.environment, counts.variants)
            samples = distant(directions, given, environment.id, ("sky", self._version))
            drawn = _Drawn(light, samples, worth, probability)
        self._drawn[counts] = drawn
        while len(self._drawn) > 2:
            self._drawn.pop(next(iter(self._drawn)))
        return drawn.samples

    def rows(self, mesh: WorldMesh, zones: int, variants: int) -> I32:
        """(V,) in which row of samples vertices look: those with near numbers in other variants."""
        own = (np.arange(len(mesh)) * 40503 >> 4) % variants
        if zones > 1:
            own += self._pilot.zones.of(mesh.origin, mesh.positions, mesh.normals) * variants
        return own.astype(np.int32)

    def _power(self, tree: LightTree) -> Power:
        if self._last is None or self._last[0] is not tree:
            self._last = tree, Power.of(tree)
        return self._last[1]


@dataclass(frozen=True, eq=False)
class Power:
    """Luminance of the leaves (S,), its running sum (S + 1,) and that of 2^10 cells."""

    leaves: F64
    upto: F64
    cells: F64

    @staticmethod
    def of(tree: LightTree) -> Power:
        """That of a tree's leaves."""
        leaves = tree.radiance.astype(np.float64) @ np.asarray(LUMINANCE, np.float64)
        upto = np.concatenate([[0.0], np.cumsum(leaves)])
        return Power(leaves, upto, np.diff(upto[:: len(leaves) >> SMALLEST]))

    @property
    def total(self) -> float:
        """All of it."""
        return float(self.upto[-1])


def probabilities(power: F64, worth: F64) -> F64:
    """(ZONES, 2^10) by which cells are looked into, from their light and what they are worth."""
    best = power * worth
    total = best.sum(axis=1, keepdims=True)
    share = np.where(total > 0, (1 - BY_RADIANCE) / np.where(total > 0, total, 1), 0.0)
    plain = np.where(total > 0, BY_RADIANCE, 1.0) * power / power.sum()
    return np.asarray(share * best + plain, np.float64)


def draw(tree: LightTree, power: Power, probability: F64, columns: int, variants: int) -> tuple[F64, F32]:
    """Directions and light (ZONES · P, C, 3): P systematic samples in each of C equally probable strata.

    Within a cell leaves are drawn by their luminance.
    """
    place = (np.arange(columns) + (shuffles(columns, variants, 3) + 0.5) / variants) / columns
    inside = len(power.leaves) >> SMALLEST
    leaves, scales = [], []
    for own in probability:
        upto = np.cumsum(own)
        at = place * upto[-1]
        cell = np.minimum(np.searchsorted(upto, at, side="right"), len(own) - 1)
        within = np.clip(1 - (upto[cell] - at) / own[cell], 0.0, 1 - 1e-9)
        sought = power.upto[cell * inside] + within * power.cells[cell]
        leaf = np.searchsorted(power.upto, sought, side="right") - 1
        leaf = np.clip(leaf, cell * inside, cell * inside + inside - 1)
        leaves.append(leaf)
        scales.append(power.cells[cell] / own[cell])
    leaf, scale = np.concatenate(leaves), np.concatenate(scales)
    scale *= tree.solid_angle / columns / np.maximum(power.leaves[leaf], np.finfo(np.float32).tiny)
    light = tree.radiance[leaf] * scale[..., None]
    return direction_set(tree.k).directions[leaf].astype(np.float64), light.astype(np.float32)


def _variance(power: F64, worth: F64, probability: F64) -> float:
    """That of one sample, about."""
    best, lit = power * worth, probability > 0
    return float((best[lit] ** 2 / probability[lit]).sum())
