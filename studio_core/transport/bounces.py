"""Light that goes from surface to surface, n times or until it settles.

X ← B + T X: B is what surfaces send of the light that comes straight to them, T one bounce over kept hits.
After n − 1 steps from X = B, X holds the light of n bounces' sources, B_0 + … + B_(n−1). In closed, bright
rooms that takes long to settle; there each step is mixed with the last few so that what is left over is
smallest (Anderson 1965, "Iterative Procedures for Nonlinear Integral Equations"): what all surfaces have in
common, which plain steps change by the rooms' albedo alone, is found at once.
"""

from __future__ import annotations

import functools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
import numpy.typing as npt

from studio_core.parallel import Workers
from studio_core.shading.job import Job
from studio_core.transport.cells import cells_of
from studio_core.transport.gather import gather_bounce, reflect, send, uncover
from studio_core.transport.hits import HitTable
from studio_core.transport.patterns import Pattern
from studio_core.transport.separable import Separated

F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]
I32 = npt.NDArray[np.int32]
I64 = npt.NDArray[np.int64]

CHUNK = 1 << 11
HISTORY = 5
SETTLED = 1e-4
MOST_STEPS = 64


class KeptRays(Protocol):
    """Hits of cosine-distributed rays of some receivers (`operator.Transport`)."""

    @property
    def rows(self) -> I64:
        """(R,) vertices."""
        ...

    @property
    def table(self) -> HitTable:
        """(R, N) hits."""
        ...

    @property
    def variant(self) -> I32:
        """(R,) which variant of the pattern each of them uses."""
        ...

    @property
    def pattern(self) -> Pattern:
        """Of its rays."""
        ...


@dataclass(frozen=True, eq=False)
class Covered:
    """Vertices (C,) that something stands on, and which others (C, N) next to them are free, with weights.

    Rays meet faces beside a thing that stands on them: their covered corners are dark, and would darken what
    is free. −1 among the others ends a row.
    """

    vertices: I64
    others: I32
    weights: F32

    @classmethod
    def of(cls, inside: npt.NDArray[np.bool_], positions: F32, neighbours: I32) -> Covered:
        """Of vertices whose rays start `inside` (V,) closed things; neighbours (V, N), the nearest first."""
        vertices = np.flatnonzero(inside)
        near = neighbours[vertices]
        free = (near >= 0) & ~inside[near]
        order = np.argsort(~free, axis=1, kind="stable")
        near, free = np.take_along_axis(near, order, axis=1), np.take_along_axis(free, order, axis=1)
        away = ((positions[near] - positions[vertices][:, None]) ** 2).sum(axis=2, dtype=np.float64)
        weights = np.where(free, 1 / np.maximum(away, 1e-12), 0)
        weights /= np.maximum(weights.sum(axis=1, keepdims=True), 1e-30)
        known = free.any(axis=1)
        others = np.where(free, near, -1).astype(np.int32)
        return cls(vertices[known], others[known], weights[known].astype(np.float32))


@dataclass(frozen=True, eq=False)
class Surface:
    """How vertices send light back.

    row (V,) of the separated BRDFs, −1: none; slot (V,) where a vertex' functions start in (S, 3), −1: none;
    coefficients (V, T, 3) of the materials' terms.
    """

    row: I32
    slot: I64
    size: int
    coefficients: F32
    separated: Separated
    covered: Covered | None = None


@dataclass(frozen=True, eq=False)
class Light:
    """What vertices receive, irradiance (V, 3) and functions (S, 3), or send: matte radiance and functions
    (3 S,) in the order of `gather`."""

    matte: F32
    functions: F32

    def __add__(self, other: Light) -> Light:
        return Light(self.matte + other.matte, self.functions + other.functions)


@functools.lru_cache(maxsize=16)
def ray_cells(pattern: Pattern) -> npt.NDArray[np.uint16]:
    """(P, N) the cell of each ray of a pattern."""
    made = np.empty(pattern.directions.shape[:2], np.uint16)
    cells_of(pattern.directions.reshape(-1, 3), made.reshape(-1))
    return made


def reflected(received: Light, surface: Surface, workers: Workers, job: Job | None = None) -> Light:
    """What is sent back of irradiance and of light weighted with the functions h_k.

    What covered vertices receive is written over.
    """
    _uncover(received, surface)
    made = Light(np.empty_like(received.matte), np.empty(received.functions.size, np.float32))
    known = surface.separated

    def run(start: int, stop: int) -> None:
        reflect(
            start,
            stop,
            received.matte,
            received.functions,
            surface.coefficients,
            surface.slot,
            surface.row,
            known.matte,
            known.count,
            known.first,
            known.term,
            made.matte,
            made.functions,
        )

    workers.run(len(received.matte), CHUNK, run, job)
    return made


def _uncover(received: Light, surface: Surface) -> None:
    covered, known = surface.covered, surface.separated
    if covered is not None:
        of_rows = (surface.slot, surface.row, known.count, received.matte, received.functions)
        count = len(covered.vertices)
        uncover(0, count, covered.vertices, covered.others, covered.weights, *of_rows)


def received(
    sent: Light, tables: Sequence[KeptRays], surface: Surface, workers: Workers, job: Job | None = None
) -> Light:
    """What vertices receive of what others send: means over all the rays that each has in any table."""
    made = Light(np.zeros_like(sent.matte), np.zeros((surface.size, 3), np.float32))
    known = surface.separated
    many = np.zeros(len(sent.matte), np.float32)
    for table in tables:
        many[table.rows] += table.table.rays
    scale = np.asarray(np.pi / np.maximum(many, 1), np.float32)
    for table in tables:
        hits = table.table

        def run(start: int, stop: int, table: KeptRays = table, hits: HitTable = hits) -> None:
            gather_bounce(
                start,
                stop,
                scale,
                table.rows,
                table.variant,
                hits.vertex,
                hits.cell,
                ray_cells(table.pattern),
                sent.matte,
                surface.slot,
                surface.row,
                known.base,
                known.count,
                known.outgoing,
                known.incoming,
                sent.functions,
                made.matte,
                made.functions,
            )

        workers.run(len(table.rows), CHUNK, run, job)
    return made


def sent_towards(
    light: Light, surface: Surface, vertex: I64, cell: I64, workers: Workers, job: Job | None = None
) -> F32:
    """(K, 3) what each of vertices (K,) sends towards a cell (K,) of its own frame."""
    made, known = np.empty((len(vertex), 3), np.float32), surface.separated

    def run(start: int, stop: int) -> None:
        send(
            start,
            stop,
            vertex,
            cell,
            light.matte,
            surface.slot,
            surface.row,
            known.base,
            known.count,
            known.outgoing,
            light.functions,
            made,
        )

    workers.run(len(vertex), CHUNK, run, job)
    return made


@dataclass(frozen=True, eq=False)
class Sources:
    """What all vertices send after some bounces, and what they did with one bounce less (None: nothing).

    `left` is the last step's change over all, relative.
    """

    light: Light
    before: Light | None
    steps: int
    left: float = 0.0


def bounced(
    straight: Light,
    bounces: int | None,
    tables: Sequence[KeptRays],
    surface: Surface,
    workers: Workers,
    job: Job | None = None,
) -> Sources:
    """Sources of so many bounces, or (None) of all: until a step changes less than `SETTLED` of the light.

    `straight` is what vertices send of the light that comes straight to them.
    """

    def step(sent: Light) -> Light:
        return straight + reflected(received(sent, tables, surface, workers, job), surface, workers, job)

    if bounces is not None:
        sent, before = straight, None
        for _ in range(bounces - 1):
            sent, before = step(sent), sent
        return Sources(sent, before, bounces - 1)
    return _settled(straight, step)


class _Step(Protocol):
    def __call__(self, sent: Light, /) -> Light: ...


def _settled(straight: Light, step: _Step) -> Sources:
    """Anderson's mixing; ends with a plain step, so that nothing that is sent was subtracted."""
    count = straight.matte.size
    sent, size = straight, max(float(np.abs(straight.matte).max(initial=0)), 1e-30)
    changes: list[F64] = []
    results: list[F32] = []
    left = 0.0
    for number in range(1, MOST_STEPS + 1):
        following = step(sent)
        before, after = _flat(sent), _flat(following)
        change = (after - before).astype(np.float64)
        size = max(size, float(np.abs(after[:count]).max(initial=0)))
        left = float(np.abs(change[:count]).max(initial=0)) / size
        if left < SETTLED:
            return Sources(following, following, number, left)
        changes, results = [*changes, change][-HISTORY:], [*results, after][-HISTORY:]
        mixed = _mixed(changes, results)
        sent = Light(mixed[:count].reshape(sent.matte.shape), mixed[count:].reshape(sent.functions.shape))
    last = step(sent)
    return Sources(last, last, MOST_STEPS + 1, left)


def _flat(light: Light) -> F32:
    return np.concatenate([light.matte.ravel(), light.functions.ravel()])


def _mixed(changes: list[F64], results: list[F32]) -> F32:
    """Σ a_i results_i, Σ a_i = 1, with which Σ a_i changes_i is smallest."""
    if len(changes) == 1:
        return results[0]
    last = changes[-1]
    against = np.stack([last - change for change in changes[:-1]])
    gram = against @ against.T
    weights = np.linalg.lstsq(gram, against @ last, rcond=1e-12)[0]
    made = (1 - weights.sum()) * results[-1]
    for weight, result in zip(weights, results[:-1], strict=True):
        made = made + weight * result
    return np.asarray(made, np.float32)
