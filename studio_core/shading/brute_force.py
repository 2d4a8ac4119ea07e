"""Equation (2) of Iwasaki et al. by brute force: every direction, traced visibility, every vertex.

The truth that backends are measured against. What was traced is kept as bits (S/8 bytes a vertex) while
the geometry stands still, so that light, material and view cost no rays.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import numpy as np
import numpy.typing as npt

from studio_core.kernels.directions import DirectionList, DirectionSet, direction_set
from studio_core.kernels.light_tree import LightTree
from studio_core.kernels.radiance import BATCH, environment_terms, lamp_terms
from studio_core.kernels.raycast import RayCaster
from studio_core.kernels.tilted import FIELDS
from studio_core.kernels.visibility import occlusion_rays, trace_visibility
from studio_core.parallel import Workers
from studio_core.shading.artifacts import (
    Lamp,
    LayerRadiance,
    Lighting,
    ShadingPoints,
    Shapes,
)
from studio_core.shading.job import Job
from studio_core.shading.lamps import lamp_light, lamp_targets
from studio_core.shading.tilting import Facing, facings, gather_tilts

F32 = npt.NDArray[np.float32]
U64 = npt.NDArray[np.uint64]
Bools = npt.NDArray[np.bool_]
Points = npt.NDArray[np.int64]

POINTS = 512  # vertices a chunk: a checkpoint every few milliseconds at 2^10 directions
BITS_LIMIT = 1 << 30
BLOCK_BYTES = 64 << 20
WHITE = np.ones((1, 3), np.float32)
HEAVY = 2e-4  # share of all light above which a direction is split

Directions = DirectionSet | DirectionList


class VisibilityBits:
    """Visibility of shading vertices over sets of directions, traced when first asked for.

    bits[p, w] bit b: direction 64·w + b leaves vertex p unoccluded and above its shading horizon.
    """

    def __init__(self, mesh: ShadingPoints, shadow: RayCaster, workers: Workers) -> None:
        self._mesh, self._shadow, self._workers = mesh, shadow, workers
        self._kept: dict[str, tuple[Directions, U64, Bools]] = {}
        self.rays = 0
        self.skipped = 0

    def belongs_to(self, mesh: ShadingPoints, shadow: RayCaster) -> bool:
        """Whether it was traced from these points; a mesh that moves is another one."""
        return self._mesh is mesh and self._shadow is shadow

    def of(self, points: Points, directions: Directions, name: str, job: Job) -> U64:
        """(len(points), S/64) words; kept unless all vertices would need over 1 GiB.

        One set of a `name` is kept, while the directions stay what they are.
        """
        count, words = len(self._mesh.positions), directions.size // 64
        if count * words * 8 > BITS_LIMIT:
            return self._trace(points, directions, job)
        known, bits, done = self._kept.get(name, (None, None, None))
        if bits is None or done is None or known is None or not _same(known, directions):
            bits, done = np.zeros((count, words), np.uint64), np.zeros(count, np.bool_)
        self._kept[name] = directions, bits, done
        missing = points[~done[points]]
        if len(missing):
            bits[missing] = self._trace(missing, directions, job)
            done[missing] = True
        wanted: U64 = bits[points]
        return wanted

    def _trace(self, points: Points, directions: Directions, job: Job) -> U64:
        mesh = self._mesh
        found = trace_visibility(
            self._shadow,
            mesh.positions[points] + mesh.origin,
            mesh.normals[points],
            directions,
            self._workers,
            job,
            geometric_normals=mesh.geometric[points],
            inset=mesh.inset[points],
        )
        self.rays += found.rays
        self.skipped += found.skipped
        return found.words


def _same(a: Directions, b: Directions) -> bool:
    return a is b or np.array_equal(a.directions, b.directions)


def blank_layer(mesh: ShadingPoints, shapes: Shapes) -> LayerRadiance:
    """A layer without light."""
    count, width = len(mesh.positions), shapes.width
    tilts = None if shapes.tilt is None else np.zeros((count, FIELDS, width, 3), np.float32)
    return LayerRadiance(np.zeros((count, width, 3), np.float32), np.zeros((count, 3), np.float32), tilts)


@dataclass(frozen=True)
class Beams:
    """Light from some directions: radiance (S, 3), zeros included, times their solid angle."""

    name: str
    directions: Directions
    light: F32


def beams(lighting: Lighting, level: int, quarters: bool = True) -> list[Beams]:
    """All that the environment's layer is summed over: leaves of 2^level, parts of some, samples of suns."""
    found = split_light(lighting.tree, level, quarters) if lighting.tree is not None else []
    if lighting.sun is not None:
        samples = DirectionList(lighting.sun.directions.astype(np.float32))
        found.append(Beams("suns", samples, _filled(lighting.sun.irradiance, samples)))
    return found


def split_light(tree: LightTree, level: int, quarters: bool = True) -> list[Beams]:
    """The leaves of 2^level (of fewer, where the tree is coarser), the brightest of them in `quarters`.

    One visibility ray stands for a leaf. Where a leaf holds over `HEAVY` of all light (and four times its
    even share), the error of a shadow's edge in it would show, so its four parts are looked at one by one
    (up to 2^17): without, irradiance under the sky of a courtyard is 0.7 % wrong instead of 0.3.
    """
    level = min(level, tree.k)
    leaves = np.array(tree.coarsened(level).radiance)
    found = [Beams(f"2^{level}", direction_set(level), leaves)]
    if level + 2 > tree.k or not quarters:
        return found
    light = leaves.sum(axis=1)
    heavy = np.flatnonzero(light > max(HEAVY, 4 / len(light)) * light.sum())
    if len(heavy):
        leaves[heavy] = 0
        inside = (heavy[:, None] * 4 + np.arange(4)).ravel()
        parts = DirectionList.of_leaves(level + 2, inside)
        bright = _filled(tree.coarsened(level + 2).radiance[inside], parts)
        found.append(Beams(f"parts of 2^{level}", parts, bright))
    return found


def _filled(light: F32, directions: DirectionList) -> F32:
    made = np.zeros((directions.size, 3), np.float32)
    made[: len(light)] = light
    return made


def environment_layer(
    mesh: ShadingPoints,
    shapes: Shapes,
    lighting: Lighting,
    visibility: VisibilityBits,
    eye: npt.NDArray[np.float64],
    points: Points,
    level: int,
    workers: Workers,
    job: Job,
    quarters: bool = True,
) -> LayerRadiance:
    """The environment's layer at unit gain for `points`: see `beams`."""
    layer = blank_layer(mesh, shapes)
    if not len(points):
        return layer
    local_eye, rows = (eye - mesh.origin).astype(np.float32), shapes.rows(mesh)
    ways = facings(mesh, shapes, layer)
    for beam in beams(lighting, level, quarters):
        directions = beam.directions
        step = max(POINTS, BLOCK_BYTES * 8 // max(directions.size, 1))
        for first in range(0, len(points), step):
            block = points[first : first + step]
            bits = visibility.of(block, directions, beam.name, job)

            def run(
                start: int,
                stop: int,
                block: Points,
                bits: U64,
                beam: Beams,
                facing: Facing,
            ) -> None:
                environment_terms(
                    start,
                    stop,
                    block,
                    facing.mesh.positions,
                    facing.mesh.normals,
                    facing.mesh.tangents,
                    rows,
                    local_eye,
                    bits,
                    beam.directions.directions,
                    beam.light,
                    beam.directions.solid_angle,
                    shapes.address,
                    shapes.terms,
                    shapes.offset,
                    shapes.data,
                    facing.terms,
                    facing.irradiance,
                )

            for facing in ways:
                some = facing.some(block)
                own = partial(run, block=block[some], bits=bits[some], beam=beam, facing=facing)
                workers.run(len(block[some]), POINTS, own, job)
    if layer.tilts is not None:
        gather_tilts(shapes, mesh, ways, layer.tilts)
    return layer


def lamp_layer(
    mesh: ShadingPoints,
    shapes: Shapes,
    shadow: RayCaster,
    lamp: Lamp,
    eye: npt.NDArray[np.float64],
    points: Points,
    samples: int,
    workers: Workers,
    job: Job,
    seen_from: ShadingPoints | None = None,
) -> LayerRadiance:
    """One lamp's layer at unit gain for `points`, by traced shadow rays to `samples` places of the lamp.

    Rays leave by the normals of `seen_from`, where that is given, rather than by those of `mesh`.
    """
    layer = blank_layer(mesh, shapes)
    ways, level = facings(mesh, shapes, layer), seen_from or mesh
    targets = lamp_targets(lamp, min(samples, BATCH))
    local_eye, rows = (eye - mesh.origin).astype(np.float32), shapes.rows(mesh)
    step = max(1, (1 << 20) // len(targets))
    for first in range(0, len(points), step):
        job.checkpoint(first, len(points))
        block = points[first : first + step]
        positions = mesh.positions[block] + mesh.origin
        towards, weight = lamp_light(lamp, targets, positions)
        seen = occlusion_rays(
            shadow,
            positions,
            level.normals[block],
            targets,
            workers,
            job,
            geometric_normals=mesh.geometric[block],
            inset=mesh.inset[block],
        )

        def run(
            start: int,
            stop: int,
            block: Points,
            towards: F32,
            weight: F32,
            seen: Bools,
            facing: Facing,
        ) -> None:
            lamp_terms(
                start,
                stop,
                block,
                facing.mesh.positions,
                facing.mesh.normals,
                facing.mesh.tangents,
                rows,
                local_eye,
                towards,
                weight,
                WHITE,
                seen,
                shapes.address,
                shapes.terms,
                shapes.offset,
                shapes.data,
                facing.terms,
                facing.irradiance,
            )

        for facing in ways:
            some = facing.some(block)
            own = partial(
                run,
                block=block[some],
                towards=towards[some] if len(towards) > 1 else towards,
                weight=weight[some] if len(weight) > 1 else weight,
                seen=seen[some],
                facing=facing,
            )
            workers.run(len(block[some]), POINTS, own, job)
    if layer.tilts is not None:
        gather_tilts(shapes, mesh, ways, layer.tilts)
    return layer


def all_points(mesh: ShadingPoints, mask: npt.NDArray[np.bool_] | None = None) -> Points:
    """Indices of the points of `mask`, or of all."""
    count = len(mesh.positions)
    return np.flatnonzero(mask).astype(np.int64) if mask is not None else np.arange(count, dtype=np.int64)
